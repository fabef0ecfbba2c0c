"""JPL kernels, read by jplephem."""

from __future__ import annotations

from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite
from losnav.ephemeris.table import Ephemeris
from losnav.errors import InvalidInputError

# Julian date of J2000.
_J2000 = 2451545.0


def from_jpl(kernel: Any, target: int, times: ArrayLike, center: int = 10) -> Ephemeris:
    """Ephemeris of a body from a JPL kernel, read by jplephem (``pip install losnav[jpl]``).

    Parameters
    ----------
    kernel : str, os.PathLike or jplephem.spk.SPK
        Kernel file such as ``de440s.bsp``, or an open one.
    target : int
        NAIF number of the body: 3 the Earth with its moon, 399 the Earth, 4 Mars, 5 Jupiter.
    times : (T,)
        Epochs of the samples, seconds past J2000 (TDB), increasing.
    center : int, optional
        NAIF number of the origin; 10 is the Sun.

    Returns
    -------
    Ephemeris
        In the axes of the kernel: the ICRF, equatorial.

    Raises
    ------
    ImportError
        If jplephem is not installed.
    InvalidInputError
        If the kernel does not connect the two bodies, or does not cover the times.
    """
    try:
        from jplephem.spk import SPK  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError as error:
        raise ImportError('JPL kernels are read by jplephem: pip install "losnav[jpl]"') from error
    opened = kernel if isinstance(kernel, SPK) else SPK.open(str(kernel))
    try:
        epochs = finite(times, "times")

        def state(body: int) -> FloatArray:
            """Of a body from the barycentre of the solar system, up the tree of the kernel."""
            total, here = np.zeros((*epochs.shape, 6)), body
            while here != 0:
                origin = next((a for a, b in opened.pairs if b == here), None)
                if origin is None:
                    raise InvalidInputError(f"target: expected a body of the kernel, got {body}")
                try:
                    p, v = opened[origin, here].compute_and_differentiate(_J2000, epochs / 86400.0)
                except ValueError as error:
                    raise InvalidInputError(f"times: expected epochs within the kernel; {error}") from error
                total += 1e3 * np.concatenate([p, v / 86400.0]).T
                here = origin
            return total

        return Ephemeris.sampled(lambda _: state(target) - state(center), epochs)
    finally:
        if opened is not kernel:
            opened.close()

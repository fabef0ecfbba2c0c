"""How the body turns during a descent: any function of time, and a slow sway about three axes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, positive, rotations, vectors
from losnav.attitude import dcm_from_mrp
from losnav.errors import InvalidInputError

__all__ = ["NADIR", "AttitudeProfile", "Sway", "turned"]

#: Body from site with x East, y South, z down: a camera along +z looks at the ground.
NADIR: FloatArray = np.diag([1.0, -1.0, -1.0])
NADIR.flags.writeable = False

_AMPLITUDE = math.radians(3.0)


class AttitudeProfile(Protocol):
    """Anything that gives the attitude at times since the start."""

    def __call__(self, time: FloatArray, /) -> ArrayLike:
        """Body from site, (T, 3, 3), at times (T,), s."""


def turned(angles: FloatArray) -> FloatArray:
    """``exp(-[a x])`` of rotation vectors of less than half a turn (rad), (..., 3) -> (..., 3, 3)."""
    # tan(a/4) a/|a|: the MRP of the rotation; a series keeps it exact to rounding at zero.
    quarter = 0.25 * np.linalg.norm(angles, axis=-1, keepdims=True)
    ratio = np.where(quarter > 1e-4, np.tan(quarter) / np.maximum(quarter, 1e-4), 1 + quarter**2 / 3)
    return dcm_from_mrp(0.25 * ratio * angles)


@dataclass(frozen=True, eq=False, init=False)
class Sway:
    """A slow sway about a constant attitude: ``exp(-[a(t) x]) @ dcm``, ``a_i = A_i sin(2 pi t/P_i)``.

    Parameters
    ----------
    amplitude : scalar or (3,)
        A, rad, less than a radian.
    periods : (3,)
        P, s.
    dcm : (3, 3)
        The attitude swayed about, body from site.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, periods that are not positive, or an amplitude of a radian or more.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> still = ln.landing.Sway(amplitude=0.0)
    >>> still(np.array([0.0, 10.0])).shape
    (2, 3, 3)
    """

    amplitude: FloatArray
    periods: FloatArray
    dcm: FloatArray

    def __init__(
        self,
        amplitude: ArrayLike = _AMPLITUDE,
        periods: ArrayLike = (120.0, 170.0, 230.0),
        dcm: ArrayLike = NADIR,
    ) -> None:
        size = finite(amplitude, "amplitude")
        if size.shape not in ((), (3,)) or not (np.abs(size) < 1.0).all():
            raise InvalidInputError(
                f"amplitude: expected a number or shape (3,), below 1 rad, got {amplitude!r}"
            )
        period, attitude = vectors(positive(periods, "periods"), "periods"), rotations(dcm, "dcm")
        for name, array, shape in (("periods", period, (3,)), ("dcm", attitude, (3, 3))):
            if array.shape != shape:
                raise InvalidInputError(f"{name}: expected shape {shape}, got {array.shape}")
        named = (
            ("amplitude", np.broadcast_to(size, 3).copy()),
            ("periods", period.copy()),
            ("dcm", attitude.copy()),
        )
        for name, array in named:
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def __call__(self, time: ArrayLike) -> FloatArray:
        """Attitude at times.

        Parameters
        ----------
        time : (...)
            Since the start, s.

        Returns
        -------
        (..., 3, 3)
            Body from site.
        """
        phase = 2.0 * np.pi * finite(time, "time")[..., np.newaxis] / self.periods
        return np.asarray(turned(self.amplitude * np.sin(phase)) @ self.dcm)

"""Relative motion as the difference of two orbits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, vectors
from losnav.dynamics.listed import Listed, hold_numbers
from losnav.dynamics.two_body import hold_flattening
from losnav.errors import InvalidInputError


@dataclass(frozen=True, eq=False, init=False)
class RelativeTwoBody(Listed):
    """Relative motion as the difference of two orbits, the chaser's known from its own navigation.

    State ``[r v]``, ``(..., 6)``: chaser minus target, m and m/s, in the target's orbital frame (x along
    track, y along the negative orbit normal, z to nadir), velocity as seen in that rotating frame: that of
    :class:`ClohessyWiltshire`, without its limits: any separation well below the distance from the planet,
    any orbit, J2 included. The target's orbit need not be known: the relative state says where it is.

    The control is held in the target's frame. The chaser's orbit is taken from the last fix at or before the
    start of a step (the first, if there is none) and propagated from there without control; its errors act
    only through differences of gravity, 15 m as 1e-5 of the relative motion. A step depends on when it
    starts: ``time=`` is on the clock of the fixes, and a filter's own time must be too.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2.
    chaser : (6,) or (T, 6)
        Fixes ``[r v]`` of the chaser, inertial axes centred at the planet, m and m/s.
    times : float or (T,)
        Epochs of the fixes, s, increasing.
    acceleration_psd : float
        Spectral density of the disturbing acceleration on each axis, m^2/s^3.
    j2, radius : float, optional
        Flattening of the gravity field (pole along z) and the equatorial radius it goes with, m.

    Raises
    ------
    InvalidInputError
        If a parameter is out of range or of the wrong shape.

    Examples
    --------
    >>> import losnav as ln
    >>> from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
    >>> chaser = [7.0e6, 0.0, 0.0, 0.0, 1.0e3, 7.5e3]
    >>> model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, j2=EARTH_J2, radius=EARTH_RADIUS)
    >>> linear = ln.dynamics.ClohessyWiltshire(ln.orbits.mean_motion(EARTH_MU, 7.05e6))
    >>> state = [-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02]
    >>> moved = model.propagate(state, 3000.0, time=0.0)
    >>> float(abs(moved - linear.propagate(state, 3000.0))[:3].max().round(1)) > 1.0  # m
    True
    """

    mu: float
    chaser: FloatArray
    times: FloatArray
    acceleration_psd: float = 0.0
    j2: float | None = None
    radius: float | None = None

    time_varying: ClassVar[bool] = True

    def __init__(
        self,
        mu: float,
        chaser: ArrayLike,
        times: ArrayLike = 0.0,
        acceleration_psd: float = 0.0,
        *,
        j2: float | None = None,
        radius: float | None = None,
    ) -> None:
        fixes, epochs = vectors(chaser, "chaser", 6), np.atleast_1d(finite(times, "times"))
        if fixes.ndim > 2:
            raise InvalidInputError(f"chaser: expected shape (6,) or (T, 6), got {fixes.shape}")
        fixes = fixes.reshape(-1, 6).copy()
        if not len(fixes) or epochs.shape != (len(fixes),) or (np.diff(epochs) <= 0).any():
            raise InvalidInputError(
                f"times: expected increasing epochs, one for each of {len(fixes)} fixes, got {epochs.shape}"
            )
        values = {"mu": mu, "acceleration_psd": acceleration_psd, "j2": j2, "radius": radius}
        for name, value in (*values.items(), ("chaser", fixes), ("times", epochs.copy())):
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)
        hold_numbers(self, positive=("mu",), at_least_zero=("acceleration_psd",))
        hold_flattening(self, self.j2, self.radius)
        table = np.column_stack([self.times, self.chaser]).ravel()
        planet = [self.mu, self.j2 or 0.0, self.radius or 0.0, self.acceleration_psd]
        object.__setattr__(self, "_flat", np.concatenate([planet, table]))

    def _parameters(self) -> FloatArray:
        flat: FloatArray = self.__dict__["_flat"]
        return flat

"""Orbits in inertial axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, in_range, vectors
from losnav.dynamics.listed import Listed, hold_numbers
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class TwoBody(Listed):
    """Orbit about a planet: point mass, and the flattening of its poles if ``j2`` is given.

    State ``[r v]``, ``(..., 6)``: m and m/s, inertial axes centred at the planet, its pole along z if ``j2``
    matters. The control is an acceleration held in these axes. A point mass without control is propagated in
    closed form (universal variables: every conic, any number of revolutions, both ways), everything else
    numerically, each step to 1e-13 of the state. ``transition`` is the derivative of that very propagation.
    Process noise is that of white acceleration along the path without control.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2. Earth: 3.986004418e14; Sun: 1.32712440018e20.
    acceleration_psd : float
        Spectral density of the disturbing acceleration on each axis, m^2/s^3.
    j2 : float, optional
        Flattening of the gravity field. Earth: 1.08262668e-3.
    radius : float, optional
        Equatorial radius that ``j2`` goes with, m. Earth: 6378137.0.

    Raises
    ------
    InvalidInputError
        If a parameter is out of range, or of ``j2`` and ``radius`` only one is given.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> earth = ln.dynamics.TwoBody(mu=3.986004418e14)
    >>> state = np.array([7.0e6, 0.0, 0.0, 0.0, np.sqrt(3.986004418e14 / 7.0e6), 0.0])
    >>> period = 2 * np.pi * np.sqrt(7.0e6**3 / 3.986004418e14)
    >>> np.abs(earth.propagate(state, 100.25 * period)[:3] - [0.0, 7.0e6, 0.0]).max() < 1e-3
    np.True_
    """

    mu: float
    acceleration_psd: float = 0.0
    j2: float | None = None
    radius: float | None = None

    def __post_init__(self) -> None:
        hold_numbers(self, positive=("mu",), at_least_zero=("acceleration_psd",))
        hold_flattening(self, self.j2, self.radius)

    def acceleration(self, position: ArrayLike) -> FloatArray:
        """Gravitational acceleration of the model.

        Parameters
        ----------
        position : (..., 3)
            From the planet's centre, inertial axes, m.

        Returns
        -------
        (..., 3)
            m/s^2.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN, infinity, or the centre itself.
        """
        r = vectors(position, "position")
        with np.errstate(all="ignore"):
            square = np.einsum("...i,...i->...", r, r)[..., np.newaxis]
            lift = 1.5 * (self.j2 or 0.0) * (self.radius or 0.0) ** 2 / square
            tilt = np.array([1.0, 1.0, 3.0]) - 5 * r[..., 2:] ** 2 / square
            pull = -self.mu / (square * np.sqrt(square)) * r
            return in_range(np.asarray(pull * (1 + lift * tilt)), "position")

    def _parameters(self) -> list[float]:
        return [self.mu, self.j2 or 0.0, self.radius or 0.0, self.acceleration_psd]


def hold_flattening(model: object, j2: float | None, radius: float | None) -> None:
    """Both numbers of the flattening, or none."""
    if (j2 is None) != (radius is None):
        missing, other = ("radius", "j2") if radius is None else ("j2", "radius")
        raise InvalidInputError(f"{missing}: expected a number, since {other} is given")
    if j2 is not None:
        hold_numbers(model, positive=("radius",), at_least_zero=("j2",))

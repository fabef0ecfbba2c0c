"""Orbits in inertial axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, in_range, vectors
from losnav.dynamics.listed import Listed, hold_numbers
from losnav.dynamics.third_body import ThirdBody
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class TwoBody(Listed):
    """Orbit about the Sun or a planet: point mass, its flattening if ``j2`` is given, the pull of others.

    State ``[r v]``, ``(..., 6)``: m and m/s, inertial axes centred at the planet, its pole along z if ``j2``
    matters. The control is an acceleration held in these axes. A point mass without control is propagated in
    closed form (universal variables: every conic, any number of revolutions, both ways), everything else
    numerically, each step to 1e-13 of the state. ``transition`` is the derivative of that very propagation.
    Process noise is that of white acceleration along the path without control.

    Third bodies pull the spacecraft and the centre alike; what counts is the difference, formed without
    cancelling. With them a step depends on when it starts: ``time=`` is on the clock of the ephemerides, and
    a filter's own time must be too.

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
    third_bodies : sequence of ThirdBody, optional
        Bodies that pull, their paths from the centre.

    Raises
    ------
    InvalidInputError
        If a parameter is out of range, or of ``j2`` and ``radius`` only one is given; of a step, if it
        leaves the ephemerides.

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
    third_bodies: Sequence[ThirdBody] = ()

    def __post_init__(self) -> None:
        hold_numbers(self, positive=("mu",), at_least_zero=("acceleration_psd",))
        hold_flattening(self, self.j2, self.radius)
        bodies = self.third_bodies
        bodies = (bodies,) if isinstance(bodies, ThirdBody) else tuple(bodies)
        for k, body in enumerate(bodies):
            if not isinstance(body, ThirdBody):
                raise InvalidInputError(f"third_bodies[{k}]: expected a ThirdBody, got {type(body).__name__}")
        object.__setattr__(self, "third_bodies", bodies)
        object.__setattr__(self, "time_varying", bool(bodies))
        planet = [self.mu, self.j2 or 0.0, self.radius or 0.0, self.acceleration_psd]
        pulls = [body.stretches().ravel() for body in bodies]
        object.__setattr__(self, "_flat", np.concatenate([planet, *pulls]) if pulls else planet)

    def acceleration(self, position: ArrayLike, *, time: ArrayLike = 0.0) -> FloatArray:
        """Gravitational acceleration of the model.

        Parameters
        ----------
        position : (..., 3)
            From the planet's centre, inertial axes, m.
        time : scalar or (...), optional
            When, s; third bodies are somewhere else at another time.

        Returns
        -------
        (..., 3)
            m/s^2.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN, infinity, the centre itself, or a time outside the ephemerides.
        """
        r = vectors(position, "position")
        with np.errstate(all="ignore"):
            square = np.einsum("...i,...i->...", r, r)[..., np.newaxis]
            lift = 1.5 * (self.j2 or 0.0) * (self.radius or 0.0) ** 2 / square
            tilt = np.array([1.0, 1.0, 3.0]) - 5 * r[..., 2:] ** 2 / square
            pull = -self.mu / (square * np.sqrt(square)) * r
            total = np.asarray(pull * (1 + lift * tilt))
            for body in self.third_bodies:
                total = total + body.pull(r, finite(time, "time"))
            return in_range(total, "position")

    @property
    def _engine_name(self) -> str:
        return "PerturbedTwoBody" if self.third_bodies else "TwoBody"

    def _parameters(self) -> list[float] | FloatArray:
        flat: list[float] | FloatArray = self.__dict__["_flat"]
        return flat

    def _check_span(self, start: FloatArray, end: FloatArray, name: str) -> None:
        if self.third_bodies and start.size and end.size:
            span = np.array([min(start.min(), end.min()), max(start.max(), end.max())])
            for body in self.third_bodies:
                body.ephemeris._check(span, name)


def hold_flattening(model: object, j2: float | None, radius: float | None) -> None:
    """Both numbers of the flattening, or none."""
    if (j2 is None) != (radius is None):
        missing, other = ("radius", "j2") if radius is None else ("j2", "radius")
        raise InvalidInputError(f"{missing}: expected a number, since {other} is given")
    if j2 is not None:
        hold_numbers(model, positive=("radius",), at_least_zero=("j2",))

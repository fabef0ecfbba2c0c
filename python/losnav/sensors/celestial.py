"""Directions to the Sun and to planets, as a spacecraft on its way between them sees them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, positive
from losnav.ephemeris import Ephemeris
from losnav.errors import InvalidInputError
from losnav.sensors.listed import NO_TURN, Listed, turns_with, velocity_needed


class _Celestial(Listed):
    """What directions to one body share: isotropic noise, an attitude that may be missing."""

    unit_vectors: ClassVar[bool] = True
    sigma: float
    aberration: bool

    def _hold(self, sigma: ArrayLike, **switches: bool) -> None:
        value = positive(sigma, "sigma")
        if value.ndim:
            raise InvalidInputError(f"sigma: expected a number, got shape {value.shape}")
        object.__setattr__(self, "sigma", float(value))
        for name, switch in switches.items():
            if not isinstance(switch, (bool, np.bool_)):
                raise InvalidInputError(f"{name}: expected True or False, got {switch!r}")
            object.__setattr__(self, name, bool(switch))

    def _variances(self) -> FloatArray:
        return self.sigma**2 * np.eye(3)

    def _disturbed(self, exact: FloatArray, rng: np.random.Generator | int | None) -> FloatArray:
        """Across the direction by ``sigma``, then unit again."""
        noise = self.sigma * np.asarray(np.random.default_rng(rng).standard_normal(exact.shape))
        noise -= np.einsum("...i,...i->...", noise, exact)[..., np.newaxis] * exact
        measured: FloatArray = exact + noise
        measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
        return measured

    def _sight(
        self, state: Any, dcm: ArrayLike | None, parameter: FloatArray, name: str
    ) -> tuple[FloatArray, FloatArray]:
        if dcm is None and not turns_with(state):
            dcm = NO_TURN
        predicted, jacobian = self._ask(state, dcm, parameter, name=name, core=1)
        if self.aberration:
            velocity_needed(state, jacobian, "aberration")
        return predicted, jacobian


@dataclass(frozen=True, eq=False, init=False)
class SunDirection(_Celestial):
    """Unit vector from the observer to the Sun at the origin of a heliocentric state (equation D1).

    Measurement ``(..., 3)``: ``dcm @ (-r / |r|)``, two degrees of freedom. Without ``dcm=`` the components
    are those of the state's axes: a direction that a star tracker has already turned into them.

    A real sensor sees the Sun displaced by stellar aberration, up to 1.1e-4 rad (23") in an orbit like the
    Earth's. Left out of the model it looks like another orbit: at 5e-5 rad of noise the estimate is 1.7e4 km
    off while the NIS stays at 2.00. So measurements either are corrected before they come here
    (``losnav.star_tracker.remove_aberration``) and ``aberration`` stays False, or are not and it must be
    True. The Sun stands still in a heliocentric frame: its light time is no matter (5e-8 rad at most).

    Parameters
    ----------
    sigma : float
        1-sigma noise, rad per axis.
    aberration : bool, optional
        Predict the direction a moving observer sees (equation T11, exact), which needs the velocity, rather
        than the geometric one.

    Raises
    ------
    InvalidInputError
        On a ``sigma`` that is not a positive number, or a switch that is none.

    Examples
    --------
    >>> import losnav as ln
    >>> state = [0.0, 2.0e11, 0.0, -2.5e4, 0.0, 0.0]  # [r v], heliocentric, m and m/s
    >>> ln.sensors.SunDirection(5e-5).predict(state)
    array([ 0., -1.,  0.])
    >>> apparent = ln.sensors.SunDirection(5e-5, aberration=True).predict(state)
    >>> (1e6 * apparent[:2]).round(1).tolist()  # turned towards the velocity by v/c
    [-83.4, -1000000.0]
    >>> ln.sensors.SunDirection(5e-5).jacobian(state).shape
    (3, 6)
    """

    sigma: float
    aberration: bool

    def __init__(self, sigma: float, *, aberration: bool = False) -> None:
        self._hold(sigma, aberration=aberration)
        seen = np.array([float(self.aberration)])
        seen.flags.writeable = False
        object.__setattr__(self, "_seen", seen)

    def predict(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Direction expected at a state.

        Parameters
        ----------
        state : (..., 6), (..., 3) or (position, mrp)
            Heliocentric ``[r v]``, m and m/s; see the module. Aberration needs the velocity.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference; none leaves the components in the axes of the state.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN, infinity, a missing velocity, or a state at the Sun's centre.
        """
        return self._sight(state, dcm, self._place(), "aberration")[0]

    def jacobian(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`.

        Returns
        -------
        (..., 3, K)
            Columns ``[dr]``, ``[dr dv]`` or ``[dp dalpha]``; those of the velocity are zero without
            aberration.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._sight(state, dcm, self._place(), "aberration")[1]

    def noise(self, state: Any = None, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Covariance of the measurement: isotropic, ``sigma^2 I``; filters take what is across the direction.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`; they do not matter here.

        Returns
        -------
        (3, 3)
            rad^2.
        """
        del state, dcm
        return self._variances()

    def simulate(
        self, state: Any, rng: np.random.Generator | int | None = None, *, dcm: ArrayLike | None = None
    ) -> FloatArray:
        """Measurement with noise: disturbed across the direction by ``sigma``, then unit again.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._disturbed(self.predict(state, dcm=dcm), rng)

    def _place(self) -> FloatArray:
        place: FloatArray = self.__dict__["_seen"]
        return place


@dataclass(frozen=True, eq=False, init=False)
class BodyDirection(_Celestial):
    """Unit vector from the observer to a planet or asteroid whose path is given (equation D3).

    Measurement ``(..., 3)``, two degrees of freedom, in the axes of ``dcm=`` or, without it, of the state.
    It depends on when: ``time=``, on the clock of the ephemeris; a filter tells its own time by itself.

    A real sensor sees a body where it was when the light left it, and displaced by the observer's own
    velocity: 1e-4 rad each. Both are predicted unless told otherwise; switch off what the measurement has
    been corrected for. Velocities are those of the state's frame, so in a heliocentric state and ephemeris
    both effects are complete to 1e-9 rad. Not modelled: the bending of light by the Sun (2e-8 rad from 45
    degrees on), the body's extent and phase, and what its jerk does during the light time: 1 m for a planet,
    but 8e4 m for a moon like Io.

    The Doppler shift of the Sun's own light needs no sensor of its own: it is
    ``RangeRate(sigma)`` of the origin.

    Parameters
    ----------
    ephemeris : losnav.Ephemeris
        Path of the body in the frame of the state; of a function: ``Ephemeris.sampled(function, times)``.
    sigma : float
        1-sigma noise, rad per axis.
    light_time, aberration : bool, optional
        Predict with them; aberration needs the velocity.

    Raises
    ------
    InvalidInputError
        If the ephemeris is none, ``sigma`` is not a positive number, or a switch is none.

    Examples
    --------
    >>> import losnav as ln
    >>> times = [0.0, 1e5, 2e5, 3e5]
    >>> drifting = [[1.0e11, 2.0e4 * t, 0.0] for t in times]
    >>> planet = ln.Ephemeris(times, drifting, [[0.0, 2.0e4, 0.0]] * 4)
    >>> state = [0.0, 0.0, 0.0, 0.0, 0.0, 3.0e4]
    >>> camera = ln.sensors.BodyDirection(planet, 5e-6)
    >>> seen = camera.predict(state, time=0.5e5)  # back by 2e4 m/s * 334 s, up by v/c
    >>> (1e3 * seen).round(3).tolist()
    [999.951, 9.933, 0.1]
    """

    ephemeris: Ephemeris
    sigma: float
    light_time: bool
    aberration: bool

    time_varying: ClassVar[bool] = True
    told: ClassVar[tuple[str, ...]] = ("time",)

    def __init__(
        self, ephemeris: Ephemeris, sigma: float, *, light_time: bool = True, aberration: bool = True
    ) -> None:
        if not isinstance(ephemeris, Ephemeris):
            raise InvalidInputError(
                "ephemeris: expected a losnav.Ephemeris (of a function: Ephemeris.sampled(function, times)), "
                f"got {type(ephemeris).__name__}"
            )
        object.__setattr__(self, "ephemeris", ephemeris)
        self._hold(sigma, light_time=light_time, aberration=aberration)

    def predict(self, state: Any, *, time: ArrayLike, dcm: ArrayLike | None = None) -> FloatArray:
        """Direction expected at a state.

        Parameters
        ----------
        state : (..., 6), (..., 3) or (position, mrp)
            ``[r v]`` in the frame of the ephemeris, m and m/s; see the module. Aberration needs the velocity.
        time : scalar or (...)
            Of the measurement, s, on the clock of the ephemeris.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference; none leaves the components in the axes of the state.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN, infinity, a missing velocity, a state on the body, or a time that the
            ephemeris does not know.
        """
        return self._sight(state, dcm, self._seen_at(time), "time")[0]

    def jacobian(self, state: Any, *, time: ArrayLike, dcm: ArrayLike | None = None) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent, that of the light time included.

        Parameters
        ----------
        state, time, dcm
            As for :meth:`predict`.

        Returns
        -------
        (..., 3, K)
            Columns ``[dr]``, ``[dr dv]`` or ``[dp dalpha]``.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._sight(state, dcm, self._seen_at(time), "time")[1]

    def noise(
        self, state: Any = None, *, time: ArrayLike | None = None, dcm: ArrayLike | None = None
    ) -> FloatArray:
        """Covariance of the measurement: isotropic, ``sigma^2 I``; filters take what is across the direction.

        Parameters
        ----------
        state, time, dcm
            As for :meth:`predict`; they do not matter here.

        Returns
        -------
        (3, 3)
            rad^2.
        """
        del state, time, dcm
        return self._variances()

    def simulate(
        self,
        state: Any,
        rng: np.random.Generator | int | None = None,
        *,
        time: ArrayLike,
        dcm: ArrayLike | None = None,
    ) -> FloatArray:
        """Measurement with noise: disturbed across the direction by ``sigma``, then unit again.

        Parameters
        ----------
        state, time, dcm
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._disturbed(self.predict(state, time=time, dcm=dcm), rng)

    @property
    def _seen(self) -> FloatArray:
        """What the engine reads of a sensor that is told the rest at every epoch."""
        return np.array([float(self.light_time), float(self.aberration), *[np.nan] * 9])

    def _seen_at(self, time: ArrayLike) -> FloatArray:
        """Switches, and the body's position, velocity and acceleration, ``(..., 11)``."""
        motion = self.ephemeris._motion(time)
        switches = np.broadcast_to(self._seen[:2], (*motion.shape[:-1], 2))
        return np.concatenate([switches, motion], axis=-1)

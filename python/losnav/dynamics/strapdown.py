"""Inertial navigation with an unmodelled rest of gravity, in a frame that turns with a body."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from losnav import _core, gravity
from losnav._arrays import (
    ArrayLike,
    FloatArray,
    as_float64,
    broadcast,
    finite,
    hold_numbers,
    in_range,
    vectors,
)
from losnav.dynamics.imu import GaussMarkov, Imu
from losnav.dynamics.site import Site
from losnav.errors import InvalidInputError
from losnav.navigation_state import NavState

#: What the inertial unit shows: ``(specific_force, angular_rate)``, each (..., 3), or one array (..., 6).
Sample: TypeAlias = ArrayLike | tuple[ArrayLike, ArrayLike]


@dataclass(frozen=True, eq=False, init=False)
class Strapdown:
    """Motion of a lander from its inertial unit, in the frame of the site (L3).

    ``r' = v``, ``v' = dcm' f + g - 2 w x v - w x (w x (center + r)) + d``, and the attitude exactly: ``f``
    and the angular rate are the samples less the biases of the state, ``g`` the gravity model in site axes,
    ``w`` the rate of the site, ``d`` the state's unmodelled acceleration. The centrifugal term is about the
    centre of mass. One step holds one sample; position and velocity are of order 4 in it.

    The control is what the unit shows: ``(specific_force, angular_rate)``, m/s^2 and rad/s in body axes, or
    one array ``(..., 6)``; absent, a body in free fall that does not turn in inertial space.

    Errors are those of :class:`NavState`: 9 components, 15 with ``biases``, 3 more with ``acceleration``.

    Parameters
    ----------
    site : Site
        The frame.
    gravity : a model of :mod:`losnav.gravity`
        In body-fixed axes. A field of your own cannot be called from inside the engine: build it from these,
        or write a model of motion of your own.
    imu : Imu
        Its noise.
    biases : bool
        Are the biases of the unit estimated?
    acceleration : GaussMarkov, optional
        Is an unmodelled acceleration estimated (dynamic model compensation), and how does it vary?
    acceleration_psd : float
        Spectral density of white acceleration on each axis that nobody estimates, m^2/s^3, beside the unit's.

    Raises
    ------
    InvalidInputError
        If an argument is of the wrong kind or out of range.

    Warns
    -----
    BrillouinWarning
        If the site is where harmonics need not converge.

    Examples
    --------
    Ten minutes above the tip of Eros, hovering on 3 mm/s^2 of thrust:

    >>> import losnav as ln
    >>> site = ln.dynamics.Site.on_body(0.0349, 0.0, 15116.0, ln.gravity.eros.ROTATION_RATE)
    >>> field = ln.gravity.eros.five_terms(brillouin_radius=0.0)
    >>> model = ln.dynamics.Strapdown(site, field, ln.dynamics.Imu.navigation())
    >>> start = ln.NavState([0.0, 0.0, 2000.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
    >>> thrust = -model.free_acceleration(start.position, start.velocity)
    >>> end = model.propagate(start, 0.1, (thrust, site.angular_velocity))
    >>> bool(abs(end.position - start.position).max() < 1e-9)
    True
    >>> model.transition(start, 0.1, (thrust, site.angular_velocity)).shape
    (15, 15)
    """

    site: Site
    gravity: Any
    imu: Imu
    biases: bool
    acceleration: GaussMarkov | None
    acceleration_psd: float

    def __init__(
        self,
        site: Site,
        gravity: Any,
        imu: Imu,
        *,
        biases: bool = True,
        acceleration: GaussMarkov | None = None,
        acceleration_psd: float = 0.0,
    ) -> None:
        for name, value, kind in (("site", site, Site), ("imu", imu, Imu)):
            if not isinstance(value, kind):
                raise InvalidInputError(
                    f"{name}: expected a losnav {kind.__name__}, got {type(value).__name__}"
                )
        if acceleration is not None and not isinstance(acceleration, GaussMarkov):
            found = type(acceleration).__name__
            raise InvalidInputError(f"acceleration: expected a GaussMarkov or None, got {found}")
        _expect_listed(gravity)
        held = {"site": site, "gravity": gravity, "imu": imu, "biases": bool(biases)}
        for name, value in {
            **held,
            "acceleration": acceleration,
            "acceleration_psd": acceleration_psd,
        }.items():
            object.__setattr__(self, name, value)
        hold_numbers(self, at_least_zero=("acceleration_psd",))
        if hasattr(gravity, "_approach"):
            gravity._approach(float(np.linalg.norm(site.center)))

    @property
    def state_size(self) -> int:
        """Components of an error: 9, 12, 15 or 18."""
        return 9 + 6 * self.biases + 3 * (self.acceleration is not None)

    def propagate(
        self, state: NavState, dt: ArrayLike, control: Sample | None = None, *, time: ArrayLike = 0.0
    ) -> NavState:
        """State after one sample of the unit.

        Parameters
        ----------
        state : NavState
            Start; any batch.
        dt : scalar or (...)
            Time step, s; negative goes back in time.
        control : ((..., 3), (..., 3)) or (..., 6), optional
            Specific force and angular rate, held over the step.
        time : scalar or (...), optional
            When the step starts; the model does not depend on it.

        Returns
        -------
        NavState
            State at the end.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        shape, arrays = self._rows(state, dt, control)
        moved = in_range(self._engine.propagate(*arrays), "state, dt or control")
        return NavState._of(moved.reshape((*shape, 19)))

    def transition(
        self, state: NavState, dt: ArrayLike, control: Sample | None = None, *, time: ArrayLike = 0.0
    ) -> FloatArray:
        """State transition matrix ``Phi`` of the errors, from their equation at the middle of the step (L7).

        Parameters
        ----------
        state, dt, control, time
            As for :meth:`propagate`.

        Returns
        -------
        (..., n, n)
            ``Phi``, ``n`` the components of an error.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._linearized(False, state, dt, control)

    def process_noise(
        self, state: NavState, dt: ArrayLike, control: Sample | None = None, *, time: ArrayLike = 0.0
    ) -> FloatArray:
        """Covariance ``Q`` that the unit's noise, walks and white acceleration add over ``|dt|`` (L8).

        Parameters
        ----------
        state, dt, control, time
            As for :meth:`propagate`; the control matters where attitude noise turns the thrust.

        Returns
        -------
        (..., n, n)
            ``Q``, symmetric positive semidefinite.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._linearized(True, state, dt, control)

    def trajectory(
        self,
        state: NavState,
        times: ArrayLike,
        control: Sample | None = None,
        *,
        longest_step: float | None = None,
    ) -> NavState:
        """States at ``times``, the given state being that of ``times[0]``.

        Parameters
        ----------
        state : NavState
            Start; any batch.
        times : (T,)
            Epochs, s; equal or decreasing ones are welcome.
        control : ((..., T - 1, 3), (..., T - 1, 3)) or (..., T - 1, 6), optional
            A sample for each step from ``times[k]`` to ``times[k + 1]``; without the dimension of time, one
            for the whole arc.
        longest_step : float, optional
            Steps longer than this, s, are taken in equal parts with the same sample.

        Returns
        -------
        NavState
            Of shape ``(..., T)``; the first along time is the given state.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        epochs = finite(times, "times")
        if epochs.ndim != 1 or not epochs.size:
            raise InvalidInputError(f"times: expected shape (T,) with T >= 1, got {epochs.shape}")
        longest = np.inf if longest_step is None else float(finite(longest_step, "longest_step"))
        if not longest > 0.0:
            raise InvalidInputError(f"longest_step: expected a number > 0, got {longest_step!r}")
        steps = epochs.size - 1
        samples = _sample(control)
        if samples.ndim == 1:
            samples = np.broadcast_to(samples, (steps, 6))
        if samples.shape[-2] != steps:
            raise InvalidInputError(
                f"control: expected one sample or one for each of {steps} steps, got shape {samples.shape}"
            )
        shape, (x, u) = broadcast(("state", _numbers(state), 1), ("control", samples, 2))
        found = self._engine.trajectory(x, u.reshape(-1, 6), np.diff(epochs), longest)
        in_range(found, "state, times or control")
        return NavState._of(found.reshape((*shape, epochs.size, 19)))

    def free_acceleration(self, position: ArrayLike, velocity: ArrayLike) -> FloatArray:
        """Acceleration in the site frame of a body that nothing pushes: gravity, Coriolis, centrifugal.

        Parameters
        ----------
        position, velocity : (..., 3)
            Site frame, m and m/s.

        Returns
        -------
        (..., 3)
            Site axes, m/s^2; the specific force that holds an acceleration ``a`` is ``dcm @ (a - this)``.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        r, v = vectors(position, "position"), vectors(velocity, "velocity")
        w = self.site.angular_velocity
        pull = self.gravity.acceleration(self.site.to_fixed(r)) @ self.site.site_from_fixed.T
        with np.errstate(over="ignore", invalid="ignore"):
            turning = np.cross(w, 2.0 * v + np.cross(w, self.site.center + r))
            return in_range(np.asarray(pull - turning), "position or velocity")

    def jacobi_integral(self, state: NavState) -> FloatArray:
        """``v.v/2 - U - |w x (center + r)|^2/2``: what free flight in the turning frame keeps.

        Parameters
        ----------
        state : NavState
            Any batch.

        Returns
        -------
        (...)
            m^2/s^2.
        """
        arm = np.cross(self.site.angular_velocity, self.site.center + state.position)
        potential = self.gravity.potential(self.site.to_fixed(state.position))
        with np.errstate(over="ignore", invalid="ignore"):
            kinetic = 0.5 * np.sum(state.velocity**2 - arm**2, axis=-1)
            return in_range(np.asarray(kinetic - potential), "state")

    def _linearized(self, noise: bool, state: NavState, dt: ArrayLike, control: Sample | None) -> FloatArray:
        shape, arrays = self._rows(state, dt, control)
        n = self.state_size
        matrix = in_range(self._engine.linearize(n, noise, *arrays), "state, dt or control")
        return matrix.reshape((*shape, n, n))

    def _rows(
        self, state: NavState, dt: ArrayLike, control: Sample | None
    ) -> tuple[tuple[int, ...], list[FloatArray]]:
        return broadcast(
            ("state", _numbers(state), 1), ("control", _sample(control), 1), ("dt", finite(dt, "dt"), 0)
        )

    def _site_numbers(self) -> list[float]:
        """The frame as the engine takes it: matrix, centre, rate."""
        parts = (self.site.site_from_fixed, self.site.center, self.site.angular_velocity)
        return [float(value) for part in parts for value in np.ravel(part)]

    def _noise_numbers(self) -> list[float]:
        """Spectral densities, then deviation and time constant of the acceleration."""
        imu, wander = self.imu, self.acceleration
        return [
            imu.velocity_random_walk**2 + self.acceleration_psd,
            imu.angle_random_walk**2,
            imu.accelerometer_bias_walk**2,
            imu.gyroscope_bias_walk**2,
            wander.sigma if wander else 0.0,
            wander.time_constant if wander else np.inf,
        ]

    @cached_property
    def _engine(self) -> _core.StrapdownModel:
        return _core.StrapdownModel(self._site_numbers(), self.gravity, self._noise_numbers())

    # What the engine holds is made again on the other side.
    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_engine"}


def _expect_listed(given: object) -> None:
    """The engine's own fields, and no subclass that may mean something else."""
    if type(given) not in gravity.LISTED:
        names = ", ".join(kind.__name__ for kind in gravity.LISTED)
        raise InvalidInputError(
            f"gravity: expected one of losnav.gravity's {names}, got {type(given).__name__}; the engine "
            "cannot call a field of your own, a model of motion of your own can"
        )


def _numbers(state: NavState) -> FloatArray:
    if not isinstance(state, NavState):
        raise InvalidInputError(f"state: expected a NavState, got {type(state).__name__}")
    return state._numbers()


def _sample(control: Sample | None) -> FloatArray:
    """``[f w]``, (..., 6), finite."""
    return np.zeros(6) if control is None else finite(numbers_of(control), "control")


def numbers_of(control: Any) -> FloatArray:
    """``(specific_force, angular_rate)`` or ``(..., 6)`` as one array."""
    if isinstance(control, tuple) and len(control) == 2:
        force, rate = (as_float64(part, "control") for part in control)
        for name, part in (("specific_force", force), ("angular_rate", rate)):
            if part.ndim < 1 or part.shape[-1] != 3:
                raise InvalidInputError(f"control: expected {name} of shape (..., 3), got {part.shape}")
        try:
            shape = np.broadcast_shapes(force.shape, rate.shape)
        except ValueError as error:
            raise InvalidInputError(
                f"control: shapes {force.shape} and {rate.shape} do not broadcast"
            ) from error
        return np.concatenate([np.broadcast_to(force, shape), np.broadcast_to(rate, shape)], axis=-1)
    array = as_float64(control, "control")
    if array.ndim < 1 or array.shape[-1] != 6:
        raise InvalidInputError(
            f"control: expected (specific_force, angular_rate) or shape (..., 6), got {array.shape}"
        )
    return array

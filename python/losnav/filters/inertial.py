"""The filter on inertial navigation: a state with an attitude, poses and landmarks beside it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, as_float64, finite
from losnav.dynamics.strapdown import Strapdown, numbers_of
from losnav.errors import InvalidInputError, NumericalError
from losnav.filters.extended import ExtendedKalmanFilter
from losnav.filters.foreign import linearized
from losnav.filters.inertial_log import Flown, InertialLog
from losnav.filters.options import Bound, checked, definite, pairs_of, whole
from losnav.filters.step import Step
from losnav.navigation_state import NavState
from losnav.sensors import Delayed

__all__ = ["InertialKalmanFilter"]

# Rows of the largest block of a measurement that is judged as one.
_BLOCK = 8


class InertialKalmanFilter(ExtendedKalmanFilter):
    """What :class:`losnav.ExtendedKalmanFilter` is on :class:`losnav.dynamics.Strapdown`.

    Made by ``losnav.ExtendedKalmanFilter(strapdown, state, covariance, ...)``; the parameters not named here
    are its own.

    Parameters
    ----------
    dynamics : Strapdown
        Inertial navigation.
    state : NavState
        Estimate at ``time``: of shape ``()``, or ``(runs,)`` to :meth:`run` runs that start differently.
    covariance : (n, n) or (runs, n, n)
        Of its error ``[dr dv da]``, then ``[db_a db_g]`` and ``[dd]`` as the dynamics has them.
    gate : float, optional
        Judges every landmark, every direction by itself.
    adaptive : (float, float, float), optional
        Process noise that follows the innovations: ``(least, most, memory)``. The density of the acceleration
        is multiplied by a factor within ``[least, most]`` that rises while the mean of NIS over its degrees
        of freedom, over ``memory`` epochs, is above one, and falls while it is below.

    Notes
    -----
    A map whose landmarks err (``LandmarkCamera(..., landmark_sigma=, map_errors="consider" or "estimate")``)
    joins the covariance landmark by landmark as they are first seen. Poses of exposures that are processed
    late are remembered by :meth:`clone` and used by ``update(..., clone=key)``; in :meth:`run` by
    ``losnav.sensors.Delayed``. Both need ``form="joseph"``.
    """

    __slots__ = ()

    _engine: _core.InertialFilter  # type: ignore[assignment]

    def __init__(
        self,
        dynamics: Strapdown,
        state: NavState,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        relock_after: int | None = 3,
        iterations: int = 1,
        underweighting: float = 0.0,
        form: str = "joseph",
        consider: Sequence[int] = (),
        time: float = 0.0,
        adaptive: tuple[float, float, float] | None = None,
    ) -> None:
        given: dict[str, Any] = {
            "gate": gate,
            "relock_after": relock_after,
            "iterations": iterations,
            "underweighting": underweighting,
            "form": form,
            "consider": consider,
        }
        options = {**checked(given, dynamics.state_size), "adaptive": _adaptive(adaptive)}
        self._begin(dynamics, state, covariance, options, time, None)

    def _begin(  # noqa: PLR0917 - one call for both filters
        self,
        dynamics: Strapdown,
        state: NavState,
        covariance: ArrayLike,
        options: dict[str, Any],
        time: float,
        predictive: tuple[float, bool, bool] | None,
    ) -> None:
        if not isinstance(state, NavState) or len(state.shape) > 1:
            got = f"shape {state.shape}" if isinstance(state, NavState) else type(state).__name__
            raise InvalidInputError(f"state: expected a NavState of shape () or (runs,), got {got}")
        size = dynamics.state_size
        p = definite(covariance, (*state.shape, size))
        gate, relock = options["gate"], options["relock_after"]
        self._options, self._dynamics, self._listed, self._lead = options, dynamics, True, state.shape
        bound = None if gate is None else Bound(gate)
        self._engine = _core.InertialFilter(
            dynamics._site_numbers(),
            dynamics.gravity,
            dynamics._noise_numbers(),
            size,
            options["form"],
            options["iterations"],
            options["underweighting"],
            options["consider"],
            None if bound is None else [bound(dof) for dof in range(1, _BLOCK + 1)],
            float("inf") if relock is None else float(relock),
            predictive,
            options["adaptive"],
        )
        self._engine.set(state._numbers(), p, False)
        self._engine.time = float(finite(time, "time"))

    @property
    def state(self) -> NavState:  # type: ignore[override]
        """Estimate, of shape ``()`` or ``(runs,)``."""
        return NavState._of(self._engine.state().reshape((*self._lead, -1)))

    @property
    def joint_covariance(self) -> FloatArray:
        """Covariance of the state and of what is beside it: remembered poses ``[dr da]``, landmarks."""
        return self._engine.joint_covariance()

    @property
    def poses(self) -> dict[int, tuple[FloatArray, FloatArray]]:
        """Position ``(3,)`` and quaternion ``(4,)`` of every remembered pose, by its key."""
        return {key: (np.array(pose[:3]), np.array(pose[3:])) for key, pose in self._engine.poses()}

    def landmarks(self, sensor: Any) -> FloatArray:
        """Landmarks of a camera as far as the filter knows them.

        Parameters
        ----------
        sensor : LandmarkCamera
            The camera.

        Returns
        -------
        (N, 3)
            Those of its map, corrected where they are estimated.
        """
        places = np.array(sensor.landmarks, dtype=float)
        for index, correction in self._engine.landmarks(sensor):
            places[index] += correction
        return places

    def predict(self, dt: float, control: Any = None) -> None:
        """Move the estimate by ``dt``.

        Parameters
        ----------
        dt : float
            Time step, s; negative goes back in time.
        control : (specific_force, angular_rate) or (6,), optional
            What the unit shows, held over the step: ``(3,)`` m/s^2 and ``(3,)`` rad/s, body axes.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        NumericalError
            If the prediction is not finite; the filter is as it was.
        """
        self._engine.step(dt, [], control, {}, None)

    def update(self, sensor: Any, z: ArrayLike, *, clone: int | None = None, **context: Any) -> Step:
        """Take a measurement.

        Parameters
        ----------
        sensor, z, **context
            As for :meth:`losnav.ExtendedKalmanFilter.update`.
        clone : int, optional
            Key of the remembered pose that measured; it is forgotten afterwards.

        Returns
        -------
        Step
            As there; ``used`` ``(M,)`` tells which numbers were taken.

        Raises
        ------
        InvalidInputError, DegenerateGeometryError, NumericalError
            As there.
        """
        steps = self._engine.step(None, [(sensor, z)], None, context, clone)
        step: Step = steps[0] if steps is not None else self._foreign(sensor, z, clone, context)
        if clone is not None:
            self._engine.forget(clone)
        return step

    def step(self, dt: float, sensor: Any, z: ArrayLike, control: Any = None, **context: Any) -> Step:
        """Predict and update in one call.

        Parameters
        ----------
        dt, control
            As for :meth:`predict`.
        sensor, z, **context
            As for :meth:`update`.

        Returns
        -------
        Step
            As :meth:`update`.

        Raises
        ------
        InvalidInputError, DegenerateGeometryError, NumericalError
            As both; the filter is then as it was before both.
        """
        steps = self._engine.step(dt, [(sensor, z)], control, context, None)
        if steps is not None:
            return steps[0]
        before = self._frozen()
        try:
            self.predict(dt, control)
            return self.update(sensor, z, **context)
        except BaseException:
            self._thaw(*before[3:])
            self._engine.time = before[2]
            raise

    def clone(self) -> int:
        """Remember the pose of now, for a measurement exposed now and processed later.

        Returns
        -------
        int
            Its key, for ``update(..., clone=key)`` or :meth:`drop`.

        Raises
        ------
        InvalidInputError
            With ``form="ud"``, or a batch of states.
        """
        return self._engine.remember()

    def drop(self, key: int) -> None:
        """Forget a remembered pose without using it.

        Parameters
        ----------
        key : int
            From :meth:`clone`.

        Raises
        ------
        InvalidInputError
            If there is no such pose.
        """
        if not self._engine.forget(key):
            raise InvalidInputError(f"key: no pose is remembered under {key}")

    def run(
        self,
        times: ArrayLike,
        measurements: Sequence[tuple[Any, ArrayLike]],
        controls: Any = None,
        substeps: int = 1,
        **context: Any,
    ) -> InertialLog:
        """Filter a whole arc, or many at once on all cores.

        Parameters
        ----------
        times : (T,)
            Epochs, s. The step to ``times[0]`` starts at the filter's own time.
        measurements : sequence of (sensor, z)
            Each with ``(T, M)`` measurements of one arc or ``(runs, T, M)`` of many; NaN is no measurement.
            Of a ``losnav.sensors.Delayed`` sensor they stand at the epochs of their exposure.
        controls : (specific_force, angular_rate) or (..., 6), optional
            Of every step of the unit: ``(T * substeps, 3)`` or ``(runs, T * substeps, 3)`` each, or one array
            with both, ``(..., 6)``; ``(6,)`` if they are always the same.
        substeps : int
            Equal steps of the unit from one epoch to the next.
        **context
            As for :meth:`update`.

        Returns
        -------
        InertialLog
            States, covariances, innovations.

        Raises
        ------
        InvalidInputError
            On wrong shapes or infinity.

        Notes
        -----
        As for :meth:`losnav.ExtendedKalmanFilter.run`.
        """
        epochs, steps = finite(times, "times").copy(), whole(substeps, "substeps") or 1
        listed = [_with_delay(sensor, z) for sensor, z in pairs_of(measurements)]
        u = None if controls is None else numbers_of(controls)
        arrays = self._engine.run(epochs, listed, u, steps, context)
        if arrays is None:
            raise InvalidInputError(
                "measurements: run() on Strapdown takes built-in sensors; use update() for your own"
            )
        flown = Flown(self._dynamics, u, steps)
        return InertialLog(epochs, arrays.pop("rows"), arrays.pop("dof"), arrays, flown)

    def copy(self) -> InertialKalmanFilter:
        """An independent filter in the same state."""
        restore, frozen = self.__reduce__()
        return restore(*frozen)  # type: ignore[no-any-return]

    def __repr__(self) -> str:
        what = "one state" if not self._lead else f"{self._lead[0]} states"
        return f"{type(self).__name__}({self._dynamics.state_size} errors, {what}, time={self.time:g} s)"

    def _foreign(self, sensor: Any, z: ArrayLike, clone: int | None, context: dict[str, Any]) -> Step:
        """An update with a sensor in Python."""
        if clone is not None:
            raise InvalidInputError("clone: remembered poses are for built-in sensors")
        x, covariance, options = self.state, self.covariance, self._options
        y, rows, innovation, dof = linearized(sensor, x, as_float64(z, "z"), context)
        expected = (innovation.size, self._dynamics.state_size)
        if rows.ndim != 2 or rows.shape[-1] != expected[1]:
            raise InvalidInputError(f"sensor.jacobian(...): expected shape {expected}, got {rows.shape}")
        beta, consider = options["underweighting"], options["consider"]
        if np.isnan(innovation).any():
            return Step(sensor, context, x, covariance, innovation, np.nan, dof, False, beta, consider)
        relock, gate = options["relock_after"], options["gate"]
        lost = relock is not None and self._engine.rejected(sensor) >= relock
        bound = np.inf if gate is None or lost else Bound(gate)(dof)
        nis, accepted = self._engine.take(y, rows, bound)
        if not np.isfinite(nis):
            raise NumericalError("update: the innovation is not finite; the filter is unchanged")
        self._engine.set_rejections([(sensor, 0.0 if accepted else self._engine.rejected(sensor) + 1.0)])
        return Step(sensor, context, x, covariance, innovation, nis, dof, accepted, beta, consider)

    def _frozen(self) -> tuple[Any, ...]:
        engine = self._engine
        beside = [engine.beside(index) for index in range(max(1, *self._lead, 1) if self._lead else 1)]
        return (
            self._dynamics,
            self._options,
            self.time,
            engine.state().reshape((*self._lead, -1)),
            engine.stored(),
            beside,
            engine.rejections(),
        )

    def _thaw(
        self, numbers: FloatArray, stored: FloatArray, beside: list[Any], rejections: list[Any]
    ) -> None:
        self._engine.set(numbers, stored, True)
        for index, one in enumerate(beside):
            self._engine.set_beside(index, one)
        self._engine.set_rejections(rejections)

    def _anew(self, dynamics: Any, state: NavState, options: dict[str, Any], time: float) -> None:
        self._begin(dynamics, state, unit_covariance(dynamics, state), options, time, None)

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (type(self), *self._frozen())


def _restore(  # noqa: PLR0917 - what pickle hands over
    kind: type[InertialKalmanFilter],
    dynamics: Strapdown,
    options: dict[str, Any],
    time: float,
    numbers: FloatArray,
    stored: FloatArray,
    beside: list[Any],
    rejections: list[Any],
) -> InertialKalmanFilter:
    ekf: InertialKalmanFilter = object.__new__(kind)
    ekf._anew(dynamics, NavState._of(numbers), options, time)
    ekf._thaw(numbers, stored, beside, rejections)
    return ekf


def unit_covariance(dynamics: Strapdown, state: NavState) -> FloatArray:
    """Ones, to be replaced."""
    size = dynamics.state_size
    return np.broadcast_to(np.eye(size), (*state.shape, size, size))


def _with_delay(sensor: Any, z: Any) -> tuple[Any, Any, float]:
    if isinstance(sensor, Delayed):
        return sensor.sensor, z, float(sensor.latency)
    return sensor, z, 0.0


def _adaptive(value: Any) -> tuple[float, float, float] | None:
    if value is None:
        return None
    numbers = finite(value, "adaptive")
    if numbers.shape != (3,) or not (0.0 < numbers[0] <= numbers[1] and numbers[2] >= 1.0):
        raise InvalidInputError(
            f"adaptive: expected (least, most, memory) with 0 < least <= most and memory >= 1, got {value!r}"
        )
    least, most, memory = (float(number) for number in numbers)
    return least, most, memory

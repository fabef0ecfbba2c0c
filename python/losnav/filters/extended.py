"""The extended Kalman filter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import losnav.dynamics
from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, finite
from losnav.errors import InvalidInputError, NumericalError
from losnav.filters import foreign
from losnav.filters.backward import Journey
from losnav.filters.log import FilterLog
from losnav.filters.options import Bound, checked, definite, pairs_of
from losnav.filters.step import Step
from losnav.navigation_state import NavState

__all__ = ["ExtendedKalmanFilter"]


class ExtendedKalmanFilter:
    """Extended Kalman filter for any dynamics and sensors, built in or the user's own.

    Parameters
    ----------
    dynamics : model
        From :mod:`losnav.dynamics`, or any object with ``propagate(state, dt, control)``,
        ``transition(state, dt, control)`` and ``process_noise(state, dt)``; with ``time_varying = True`` it
        is also told ``time=``, when a step starts.
    state : (N,) or (runs, N), or NavState
        Estimate at ``time``; several to :meth:`run` a batch whose runs start differently. A
        :class:`losnav.NavState` with :class:`losnav.dynamics.Strapdown`; see
        :class:`losnav.filters.InertialKalmanFilter` for what that adds.
    covariance : (N, N) or (runs, N, N)
        Covariance of its error, true minus estimate; symmetric positive definite.
    gate : float, optional
        Editing of measurements by their normalised innovation squared (NIS). Below 1: the probability with
        which a good measurement passes, 0.9999 say; from 1 on: the bound on the NIS itself. None passes all.
    relock_after : int, optional
        After this many rejections of a sensor in a row its next measurement is taken regardless: a filter
        that has lost its way would reject the truth for ever. None never does.
    iterations : int
        Linearisations of a measurement; from 2 on at the state the one before has led to (iterated filter).
    underweighting : float
        Lear's ``beta``: measurements are taken to err by ``R + beta H P H'``, for priors so wide that the
        curvature of the measurement counts. 0.2 is customary.
    form : {"joseph", "ud"}
        How the covariance is kept: itself, updated in Joseph's form, or its factors ``U D U'``
        (Bierman & Thornton), which survive badly scaled problems.
    consider : sequence of int
        Components of the state that are uncertain but must not be corrected (Schmidt): biases too weakly
        observed to be estimated.
    time : float
        Epoch of the state, s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, a covariance that is not positive definite or impossible options.

    Notes
    -----
    A step that fails raises and leaves the filter as it was, bit for bit. Backward steps (``dt < 0``) add
    process noise too. Angles are wrapped where the sensor has a ``residual(z, predicted)``.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.04e-3, acceleration_psd=1e-9)
    >>> camera = ln.sensors.RangeBearing(sigma_range=0.2, sigma_angle=6e-4)
    >>> ekf = ln.ExtendedKalmanFilter(orbit, [-510.0, 0, 10, 0, 0, 0], np.diag([100.0] * 3 + [2.5e-3] * 3))
    >>> facing = np.diag([-1.0, 1.0, -1.0]) @ [[-1.0, 0, 0], [0, 1, 0], [0, 0, -1]]  # looks along +x
    >>> step = ekf.step(60.0, camera, [516.7, -0.019, -0.039], dcm=facing)
    >>> step.accepted, step.dof
    (True, 3)
    >>> ekf.time
    60.0
    """

    __slots__ = ("_dynamics", "_engine", "_lead", "_listed", "_options")

    def __init__(
        self,
        dynamics: Any,
        state: ArrayLike | NavState,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        relock_after: int | None = 3,
        iterations: int = 1,
        underweighting: float = 0.0,
        form: str = "joseph",
        consider: Sequence[int] = (),
        time: float = 0.0,
    ) -> None:
        given: dict[str, Any] = {
            "gate": gate,
            "relock_after": relock_after,
            "iterations": iterations,
            "underweighting": underweighting,
            "form": form,
            "consider": consider,
        }
        if isinstance(dynamics, losnav.dynamics.Strapdown):
            from losnav.filters.inertial import InertialKalmanFilter

            # The same calls by another engine: what is made is of the class that documents what is more.
            self.__class__ = InertialKalmanFilter
            self.__init__(dynamics, state, covariance, **given, time=time)  # type: ignore[misc]
            return
        foreign.needed(dynamics, "dynamics", ("propagate", "transition", "process_noise"))
        listed = _is_listed(dynamics)
        x = _vectors(state, dynamics, listed)
        p = definite(covariance, x.shape)
        options = checked(given, x.shape[-1])
        self._options = options
        self._dynamics = dynamics
        self._listed = listed
        self._lead = x.shape[:-1]
        self._engine = _core.Filter(
            dynamics._engine_name if listed else None,
            dynamics._parameters() if listed else [],
            x.shape[-1],
            form,
            options["iterations"],
            options["underweighting"],
            options["consider"],
            None if gate is None else Bound(options["gate"]),
            float("inf") if relock_after is None else float(relock_after),
        )
        self._engine.set(x, p, False)
        self._engine.time = float(finite(time, "time"))

    @property
    def dynamics(self) -> Any:
        """The model."""
        return self._dynamics

    @property
    def state(self) -> FloatArray:
        """Estimate, ``(N,)`` or ``(runs, N)``."""
        return self._engine.state().reshape((*self._lead, -1))

    @property
    def covariance(self) -> FloatArray:
        """Covariance of its error, ``(N, N)`` or ``(runs, N, N)``."""
        every = self._engine.covariance()
        return every.reshape((*self._lead, *every.shape[1:]))

    @property
    def time(self) -> float:
        """Epoch of the estimate, s."""
        return self._engine.time

    def predict(self, dt: float, control: ArrayLike | None = None) -> None:
        """Move the estimate by ``dt``.

        Parameters
        ----------
        dt : float
            Time step, s; negative goes back in time.
        control : (3,), optional
            Held over the step: an acceleration, m/s^2, for orbital models.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        NumericalError
            If the prediction is not finite; the filter is as it was.
        """
        if self._listed:
            try:
                self._engine.predict(dt, control)
            except NumericalError:
                self._check_span(self.time + dt, "dt")
                raise
        else:
            foreign.predict(self._engine, self._dynamics, dt, control)

    def update(self, sensor: Any, z: ArrayLike, **context: Any) -> Step:
        """Take a measurement.

        Parameters
        ----------
        sensor : sensor
            From :mod:`losnav.sensors`, or any object with ``predict(state, **context)``,
            ``jacobian(state, **context)`` and ``noise(state, **context)``, optionally
            ``residual(z, predicted)``; with ``time_varying = True`` it is also told ``time=``.
        z : (M,)
            Measurement; NaN if there is none.
        **context
            What the sensor is told besides the state: ``dcm=`` the known attitude, ``(3, 3)``; ``landmarks=``
            ``(N, 3)`` or ``target=`` ``(3,)`` in place of those of the sensors that have some; for a user's
            sensor, whatever it takes.

        Returns
        -------
        Step
            ``innovation`` ``(M,)``, ``innovation_covariance`` ``(M, M)``, ``nis`` with ``dof`` degrees of
            freedom, ``accepted``, ``gain`` ``(N, M)``.

        Raises
        ------
        InvalidInputError
            On wrong shapes, infinity, a missing attitude.
        DegenerateGeometryError
            Where the measurement is undefined at the estimate; the filter is as it was.
        NumericalError
            If the result is not finite; the filter is as it was.
        """
        step = self._engine.step(None, sensor, z, None, context)
        return step if step is not None else foreign.update(self._engine, self._options, sensor, z, context)

    def step(
        self, dt: float, sensor: Any, z: ArrayLike, control: ArrayLike | None = None, **context: Any
    ) -> Step:
        """Predict and update in one call: the loop of an embedded filter.

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
            As :meth:`predict` and :meth:`update`; the filter is then as it was before both.
        """
        if self._listed:
            try:
                step = self._engine.step(dt, sensor, z, control, context)
            except NumericalError:
                self._check_span(self.time + dt, "dt")
                raise
            if step is not None:
                return step
        return foreign.step(self, dt, sensor, z, control=control, context=context)

    def run(
        self,
        times: ArrayLike,
        measurements: Sequence[tuple[Any, ArrayLike]],
        controls: ArrayLike | None = None,
        **context: Any,
    ) -> FilterLog:
        """Filter a whole arc, or many at once on all cores.

        Parameters
        ----------
        times : (T,)
            Epochs, s. The step to ``times[0]`` starts at the filter's own time.
        measurements : sequence of (sensor, z)
            Each with ``(T, M)`` measurements of one arc or ``(runs, T, M)`` of many; a row with NaN is no
            measurement. At each epoch they are taken in this order.
        controls : (3,), (T, 3) or (runs, T, 3), optional
            ``controls[k]`` acts over the step that ends at ``times[k]``.
        **context
            As for :meth:`update`; ``dcm`` may be ``(3, 3)``, ``(T, 3, 3)`` or ``(runs, T, 3, 3)``.

        Returns
        -------
        FilterLog
            States, covariances, innovations; ``.smooth()``.

        Raises
        ------
        InvalidInputError
            On wrong shapes, infinity, rotations that are none, a missing attitude.

        Notes
        -----
        The filter ends at the last epoch, as after the same steps one by one. One filter run over many arcs
        stays where it is: there is no single end. A measurement that cannot be taken (undefined, or the
        result not finite) is logged as not accepted, and the arc goes on.
        """
        pairs = pairs_of(measurements)
        if self._listed:
            if self._dynamics.time_varying:
                self._check_span(times, "times")
            record = self._engine.run(times, pairs, controls, context)
            if record is not None:
                rows, dof = record.rows, record.dof
                u = None if controls is None else finite(controls, "controls").copy()
                return FilterLog(finite(times, "times").copy(), rows, dof, record, Journey(self._dynamics, u))
        return foreign.run(self, times, pairs, controls, context)

    def _check_span(self, times: ArrayLike, name: str) -> None:
        """Refuse times of which the model knows nothing."""
        epochs = finite(times, name)
        self._dynamics._check_span(np.asarray(self.time), epochs, name)

    def copy(self) -> ExtendedKalmanFilter:
        """An independent filter in the same state."""
        return ExtendedKalmanFilter._restore(*self._frozen())

    def __copy__(self) -> ExtendedKalmanFilter:
        return self.copy()

    def __deepcopy__(self, memo: dict[int, Any]) -> ExtendedKalmanFilter:
        return self.copy()

    def __repr__(self) -> str:
        shape = self._lead
        size = self._engine.state().shape[-1]
        what = f"{size} states" if not shape else f"{shape[0]} runs of {size} states"
        return f"ExtendedKalmanFilter({self._dynamics!r}, {what}, time={self.time:g} s)"

    def _frozen(self) -> tuple[Any, ...]:
        engine = self._engine
        state = engine.state().reshape((*self._lead, -1))
        return self._dynamics, self._options, self.time, state, engine.stored(), engine.rejections()

    @staticmethod
    def _restore(  # noqa: PLR0917 - what pickle hands over
        dynamics: Any,
        options: dict[str, Any],
        time: float,
        state: FloatArray,
        stored: FloatArray,
        rejections: list[tuple[Any, float]],
    ) -> ExtendedKalmanFilter:
        unit = np.broadcast_to(np.eye(state.shape[-1]), (*state.shape[:-1], *(2 * state.shape[-1:])))
        ekf = ExtendedKalmanFilter(dynamics, state, unit, **options, time=time)
        ekf._engine.set(state, stored, True)
        ekf._engine.set_rejections(rejections)
        return ekf

    def __reduce__(self) -> tuple[Any, ...]:
        return ExtendedKalmanFilter._restore, self._frozen()


def _vectors(state: Any, dynamics: Any, listed: bool) -> FloatArray:
    """One state or several, of a size that the model knows."""
    if isinstance(state, NavState):
        raise InvalidInputError("state: a NavState goes with dynamics.Strapdown; expected (N,) or (runs, N)")
    x = finite(state, "state")
    if x.ndim not in (1, 2) or not x.size:
        raise InvalidInputError(f"state: expected shape (N,) or (runs, N), got {x.shape}")
    if listed and x.shape[-1] != dynamics.state_size:
        raise InvalidInputError(
            f"state: expected {dynamics.state_size} components for {type(dynamics).__name__}, "
            f"got {x.shape[-1]}"
        )
    return x


def _is_listed(dynamics: Any) -> bool:
    """Is it exactly one of the engine's own models?  A subclass may have changed anything."""
    return type(dynamics) in losnav.dynamics.LISTED

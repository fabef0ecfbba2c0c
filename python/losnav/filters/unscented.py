"""The unscented Kalman filter, to compare the extended one with: no Jacobians, no linearisation.

1. Draw ``2 N + 1`` sigma points around the estimate, spread by the Cholesky factor of the covariance.
2. Predict: propagate each; their weighted mean and spread are the new estimate, plus the process noise.
3. Update: draw again, predict the measurement of each; the spread of the predictions is the innovation's
   covariance, their covariance with the points the gain.

Angles are averaged as differences from the prediction of the central point, so they wrap where they must.
Everything is NumPy over leading dimensions: a batch of runs is one filter.

Sources: Julier & Uhlmann, Proc. IEEE 92(3), 2004; scaled weights as in Wan & van der Merwe (2000).
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, covariances, finite, in_range, vectors
from losnav.consistency.chi_square import chi2_quantile
from losnav.errors import InvalidInputError, NumericalError
from losnav.filters.backward import started
from losnav.filters.foreign import needed
from losnav.filters.log import FilterLog
from losnav.filters.sigma_points import (
    UnscentedStep,
    congruence,
    logged,
    moment,
    one_by_one,
    right_divide,
    sigma_points,
    symmetrised,
)
from losnav.filters.step import with_time
from losnav.sensors.listed import measures_unit_vectors

# Context of which each epoch, and each run, may have its own.
_MATRICES = ("dcm", "landmarks")

__all__ = ["UnscentedKalmanFilter", "UnscentedStep"]


class UnscentedKalmanFilter:
    """Unscented Kalman filter with the surface of ``ExtendedKalmanFilter``.

    Parameters
    ----------
    dynamics : model
        Built in, or any object with ``propagate(state, dt, control)`` and ``process_noise(state, dt)``.
    state : (N,) or (runs, N)
        Estimate at ``time``, or one for each run.
    covariance : (N, N) or (runs, N, N)
        Covariance of its error.
    gate : float, optional
        Below 1 the probability with which a good measurement is accepted, from 1 on the bound of the
        normalised innovation squared itself; every measurement is accepted if absent.
    relock_after : int, optional
        After this many rejections of a sensor in a row its next measurement is accepted; None never.
    alpha, beta, kappa : float
        Spread of the sigma points, ``alpha sqrt(N + kappa)`` standard deviations; ``beta`` is 2 for Gaussian
        errors.
    time : float
        Epoch of the state, s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, a covariance that is not positive definite or impossible options.

    Notes
    -----
    A comparison filter: vector states, NumPy, tens of microseconds a step for one run. A user's model is
    called point by point, a built-in one with all points of all runs at once.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.04e-3, acceleration_psd=1e-9)
    >>> camera = ln.sensors.RangeBearing(sigma_range=0.2, sigma_angle=6e-4)
    >>> truth = np.array([-520.0, 10.0, 20.0, 0.03, -0.02, 0.02])
    >>> guess = truth + [10.0, -10.0, 10.0, 0.05, 0.05, -0.05]
    >>> ukf = ln.UnscentedKalmanFilter(orbit, guess, np.diag([100.0] * 3 + [0.0025] * 3))
    >>> for _ in range(20):
    ...     truth = orbit.propagate(truth, 60.0)
    ...     step = ukf.step(60.0, camera, camera.predict(truth, dcm=np.eye(3)), dcm=np.eye(3))
    >>> bool(np.linalg.norm(ukf.state[:3] - truth[:3]) < 0.5)
    True
    """

    def __init__(
        self,
        dynamics: Any,
        state: ArrayLike,
        covariance: ArrayLike,
        *,
        gate: float | None = None,
        relock_after: int | None = 3,
        alpha: float = 1.0,
        beta: float = 2.0,
        kappa: float = 0.0,
        time: float = 0.0,
    ) -> None:
        needed(dynamics, "dynamics", ("propagate", "process_noise"))
        x = finite(state, "state")
        if x.ndim < 1 or x.shape[-1] < 1:
            raise InvalidInputError(f"state: expected shape (..., N), got {x.shape}")
        n = x.shape[-1]
        p = covariances(covariance, "covariance", n)
        try:
            shape = np.broadcast_shapes(x.shape[:-1], p.shape[:-2])
        except ValueError:
            raise InvalidInputError(
                f"covariance: expected leading dimensions as the state's {x.shape[:-1]}, got {p.shape[:-2]}"
            ) from None
        _checked_gate(gate, relock_after)
        if alpha <= 0.0 or not np.isfinite(alpha) or n + kappa <= 0.0:
            raise InvalidInputError(f"alpha: expected alpha > 0 and N + kappa > 0, got {alpha}, {kappa}")
        self.dynamics = dynamics
        self._gate, self._relock_after = gate, relock_after
        spread = alpha**2 * (n + kappa)
        self._reach = float(np.sqrt(spread))
        self._mean_weights = np.full(2 * n + 1, 0.5 / spread)
        self._mean_weights[0] = 1.0 - n / spread
        self._weights = self._mean_weights.copy()
        self._weights[0] += 1.0 - alpha**2 + beta
        self._state = np.broadcast_to(x, (*shape, n)).copy()
        self._covariance = np.broadcast_to(p, (*shape, n, n)).copy()
        self._time = float(finite(time, "time"))
        self._rejections: list[tuple[Any, Any]] = []
        sigma_points(self._state, self._covariance, self._reach)

    @property
    def state(self) -> FloatArray:
        """Estimate, (..., N)."""
        return np.array(self._state)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of its error, (..., N, N)."""
        return np.array(self._covariance)

    @property
    def time(self) -> float:
        """Epoch of the estimate, s."""
        return self._time

    def predict(self, dt: float, control: ArrayLike | None = None) -> None:
        """Move the estimate by a time step.

        Parameters
        ----------
        dt : float
            s; negative goes back in time.
        control : (3,) or (..., 3), optional
            As the dynamics take it, held over the step.

        Raises
        ------
        InvalidInputError, NumericalError
            The filter is then as before.
        """
        self._predict(dt, control)

    def update(self, sensor: Any, z: ArrayLike, **context: Any) -> UnscentedStep:
        """Take one measurement of one sensor.

        Parameters
        ----------
        sensor : sensor
            Built in, or any object with ``predict(state, **context)`` and ``noise(state, **context)``, and
            ``residual(z, predicted)`` where a plain difference will not do.
        z : (..., M)
            Measurement; NaN is none.
        **context
            What the sensor needs, for instance ``dcm=``.

        Returns
        -------
        UnscentedStep

        Raises
        ------
        InvalidInputError, NumericalError
            The filter is then as before.
        """
        return self._update(sensor, as_float64(z, "z"), context)

    def step(
        self, dt: float, sensor: Any, z: ArrayLike, control: ArrayLike | None = None, **context: Any
    ) -> UnscentedStep:
        """Predict and update in one call.

        Parameters
        ----------
        dt, control
            As for :meth:`predict`.
        sensor, z, **context
            As for :meth:`update`.

        Returns
        -------
        UnscentedStep

        Raises
        ------
        InvalidInputError, NumericalError
            The filter is then as before.
        """
        before = copy.copy(self)
        self._predict(dt, control)
        try:
            return self.update(sensor, z, **context)
        except Exception:
            self.__dict__.update(before.__dict__)
            raise

    def run(
        self,
        times: ArrayLike,
        measurements: Sequence[tuple[Any, ArrayLike]],
        controls: ArrayLike | None = None,
        **context: Any,
    ) -> FilterLog:
        """Filter a whole arc: to each epoch, then the measurements taken there, in the order given.

        Parameters
        ----------
        times : (T,)
            Epochs, s; the first step leads from the filter's time to ``times[0]``.
        measurements : sequence of (sensor, z)
            ``z`` (T, M) or (runs, T, M); a row of NaN is no measurement.
        controls : (T, 3) or (..., T, 3), optional
            ``controls[k]`` acts over the step that ends at ``times[k]``.
        **context
            What the sensors need; ``dcm`` may be (3, 3), (T, 3, 3) or (runs, T, 3, 3).

        Returns
        -------
        FilterLog

        Raises
        ------
        InvalidInputError, NumericalError
            The filter is then as before.
        """
        epochs = finite(times, "times")
        if epochs.ndim != 1 or not epochs.size:
            raise InvalidInputError(f"times: expected shape (T,) with T >= 1, got {epochs.shape}")
        taken = [(sensor, _arc(z, epochs.size)) for sensor, z in measurements]
        pushes = None if controls is None else vectors(controls, "controls", np.shape(controls)[-1])
        if pushes is not None and (pushes.ndim < 2 or pushes.shape[-2] != epochs.size):
            raise InvalidInputError(f"controls: expected shape (..., {epochs.size}, 3), got {pushes.shape}")
        runs = np.broadcast_shapes(
            self._state.shape[:-1],
            *(z.shape[:-2] for _, z in taken),
            () if pushes is None else pushes.shape[:-2],
        )
        worker = copy.copy(self)
        worker._spread_over(runs)
        estimates, predictions, steps = [], [], []
        for k, epoch in enumerate(epochs):
            predicted = worker._predict(
                float(epoch) - worker._time, None if pushes is None else pushes[..., k, :]
            )
            worker._time = float(epoch)
            here = {name: _at_epoch(name, value, k) for name, value in context.items()}
            steps.append([worker._update(sensor, z[..., k, :], here) for sensor, z in taken])
            predictions.append(predicted)
            estimates.append((worker._state, worker._covariance))
        # As of the extended filter: one estimate that starts many runs stays where it is.
        if runs == self._state.shape[:-1]:
            self.__dict__.update(worker.__dict__)
        return logged(epochs, estimates, predictions, steps)

    def __copy__(self) -> UnscentedKalmanFilter:
        twin = type(self).__new__(type(self))
        twin.__dict__.update(self.__dict__)
        # Arrays are replaced, never written into: only the count of rejections has to be its own.
        twin._rejections = list(self._rejections)
        return twin

    def _spread_over(self, runs: tuple[int, ...]) -> None:
        n = self._state.shape[-1]
        self._state = np.broadcast_to(self._state, (*runs, n))
        self._covariance = np.broadcast_to(self._covariance, (*runs, n, n))

    def _predict(self, dt: float, control: ArrayLike | None) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Moves; returns (x-, P-, covariance of x with x-)."""
        step = float(finite(dt, "dt"))
        if step == 0.0:
            return self._state, self._covariance, self._covariance
        points = sigma_points(self._state, self._covariance, self._reach)
        push = None if control is None else finite(control, "control")
        if push is not None and push.ndim > 1:
            push = push[..., np.newaxis, :]
        model, when = self.dynamics, started(self.dynamics, self._time)
        if _broadcasts(model):
            moved = model.propagate(points, step, push, **when)
            noise = model.process_noise(self._state, step, **when)
        else:
            moved = one_by_one(lambda x, u: model.propagate(x, step, u, **when), points, push)
            noise = one_by_one(lambda x, _: model.process_noise(x, step, **when), self._state, None)
        mean = np.einsum("p,...pi->...i", self._mean_weights, moved)
        off = moved - mean[..., np.newaxis, :]
        spread = moment(self._weights, off, off) + noise
        cross = moment(self._weights, points - self._state[..., np.newaxis, :], off)
        in_range(spread, "state, dt or control")
        self._state, self._covariance = mean, symmetrised(spread)
        self._time += step
        return self._state, self._covariance, cross

    def _update(self, sensor: Any, z: FloatArray, context: dict[str, Any]) -> UnscentedStep:
        needed(sensor, "sensor", ("predict", "noise"))
        context = with_time(sensor, context, self._time)
        runs = self._state.shape[:-1]
        points = sigma_points(self._state, self._covariance, self._reach)
        if _broadcasts(sensor):
            each = {name: _over_points(name, value, len(runs)) for name, value in context.items()}
            seen = sensor.predict(points, **each)
            noise = sensor.noise(self._state, **context)
        else:
            seen = one_by_one(lambda x, _: sensor.predict(x, **context), points, None)
            noise = one_by_one(lambda x, _: sensor.noise(x, **context), self._state, None)
        residual = getattr(sensor, "residual", np.subtract)
        if z.shape[-1:] != seen.shape[-1:]:
            raise InvalidInputError(f"z: expected shape (..., {seen.shape[-1]}), got {z.shape}")
        if np.isinf(z).any():
            raise InvalidInputError(
                "z: expected finite numbers, or NaN where nothing was measured, got infinity"
            )
        first = seen[..., :1, :]
        expected = first[..., 0, :] + np.einsum("p,...pi->...i", self._mean_weights, residual(seen, first))
        off = residual(seen, expected[..., np.newaxis, :])
        s = symmetrised(moment(self._weights, off, off) + noise)
        deviation = points - self._state[..., np.newaxis, :]
        gain = right_divide(moment(self._weights, deviation, off), s)
        measured = np.broadcast_to(z, (*runs, z.shape[-1]))
        y = residual(measured, expected)
        there = ~np.isnan(y).any(axis=-1)
        nis = np.einsum("...i,...i->...", y, np.linalg.solve(s, np.nan_to_num(y)[..., np.newaxis])[..., 0])
        dof = _degrees_of_freedom(sensor, y.shape[-1])
        known, before = self._rejected(sensor, nis.shape)
        accepted, rejections = self._decide(nis, there, dof, before)
        used = np.where(accepted[..., np.newaxis, np.newaxis], gain, 0.0)
        state = self._state + np.einsum("...ij,...j->...i", used, np.nan_to_num(y))
        covariance = symmetrised(self._covariance - congruence(used, s))
        if not (np.isfinite(state).all() and np.isfinite(covariance).all()):
            raise NumericalError("z: the update is not finite")
        self._state, self._covariance = state, covariance
        self._rejections = [kept for kept in self._rejections if kept[0] is not known]
        self._rejections.append((sensor, rejections))
        return UnscentedStep(y, s, nis, dof, accepted, used)

    def _rejected(self, sensor: Any, runs: tuple[int, ...]) -> tuple[Any, Any]:
        """The sensor as it is remembered, and its rejections in a row: the same object, or one like it."""
        alike = [kept for kept in self._rejections if kept[0] is sensor]
        alike = alike or [kept for kept in self._rejections if _alike(kept[0], sensor)]
        return alike[0] if alike else (sensor, np.zeros(runs, np.intp))

    def _decide(self, nis: FloatArray, there: Any, dof: int, before: Any) -> tuple[Any, Any]:
        """Which measurements are used, and the rejections in a row from here."""
        if self._gate is None:
            return there, np.zeros(nis.shape, np.intp)
        bound = float(chi2_quantile(self._gate, dof)) if self._gate < 1.0 else self._gate
        locked_out = False if self._relock_after is None else before >= self._relock_after
        accepted = there & ((nis <= bound) | locked_out)
        return accepted, np.where(accepted, 0, before + there)


def _broadcasts(model: Any) -> bool:
    """A built-in model takes all points at once; a user's may not, and is asked one by one."""
    return type(model).__module__.split(".")[0] == __name__.split(".")[0]


def _over_points(name: str, value: Any, runs: int) -> Any:
    """Context of each run, for all sigma points of it."""
    if name in _MATRICES and runs and np.ndim(value) > 2:
        return np.expand_dims(value, -3)
    return value


def _at_epoch(name: str, value: Any, k: int) -> Any:
    if name in _MATRICES and np.ndim(value) > 2:
        return finite(value, name)[..., k, :, :]
    return value


def _arc(z: ArrayLike, epochs: int) -> FloatArray:
    array = as_float64(z, "z")
    if array.ndim < 2 or array.shape[-2] != epochs:
        raise InvalidInputError(f"z: expected shape (..., {epochs}, M), got {array.shape}")
    return array


def _alike(a: Any, b: Any) -> bool:
    """Built-in sensors of the same parameters, as after unpickling."""
    if type(a) is not type(b) or not _broadcasts(a):
        return bool(a is b)
    return all(np.array_equal(vars(a)[name], vars(b)[name]) for name in vars(a))


def _degrees_of_freedom(sensor: Any, rows: int) -> int:
    """Rank of a measurement: two for each unit vector."""
    given = getattr(sensor, "dof", None)
    if given is not None:
        return int(given)
    return 2 * rows // 3 if measures_unit_vectors(sensor) else rows


def _checked_gate(gate: float | None, relock_after: int | None) -> None:
    if gate is not None and not gate > 0.0:
        raise InvalidInputError(f"gate: expected a probability, a bound >= 1 or None, got {gate!r}")
    if relock_after is not None and relock_after < 1:
        raise InvalidInputError(f"relock_after: expected a count >= 1 or None, got {relock_after!r}")

"""Models that live in Python, in the same filter: they say what happens, the engine does the algebra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, as_float64, finite
from losnav.errors import InvalidInputError, NumericalError
from losnav.filters.backward import Journey, started
from losnav.filters.log import FilterLog
from losnav.filters.step import Step, told_to, with_time, within_blocks
from losnav.sensors import LandmarkCamera
from losnav.sensors.listed import measures_unit_vectors

if TYPE_CHECKING:
    from losnav.filters.extended import ExtendedKalmanFilter

__all__ = ["needed", "predict", "run", "step", "update"]


def needed(model: Any, argument: str, methods: tuple[str, ...]) -> None:
    """Refuse an object that cannot be a model, naming what it lacks."""
    missing = [method for method in methods if not callable(getattr(model, method, None))]
    if missing:
        raise InvalidInputError(
            f"{argument}: expected an object with {', '.join(methods)}; "
            f"{type(model).__name__} has no {', '.join(missing)}"
        )


def predict(engine: _core.Filter, dynamics: Any, dt: ArrayLike, control: ArrayLike | None) -> None:
    """Predict with a model in Python."""
    step = finite(dt, "dt")
    if step.ndim:
        raise InvalidInputError(f"dt: expected a finite number, s, got shape {step.shape}")
    x, seconds = _single(engine), float(step)
    if seconds == 0.0:
        return
    arguments = (x, seconds) if control is None else (x, seconds, finite(control, "control"))
    size, when = x.size, started(dynamics, engine.time)
    moved = _from_model(dynamics.propagate(*arguments, **when), "dynamics.propagate(...)", (size,))
    phi = _from_model(dynamics.transition(*arguments, **when), "dynamics.transition(...)", (size, size))
    noise = dynamics.process_noise(x, seconds, **when)
    noise = _from_model(noise, "dynamics.process_noise(...)", (size, size))
    if not engine.predict_given(seconds, moved, phi, noise):
        raise NumericalError(
            "predict: the predicted state or covariance is not finite; the filter is unchanged"
        )


def update(
    engine: _core.Filter, options: dict[str, Any], sensor: Any, z: ArrayLike, context: dict[str, Any]
) -> Step:
    """Update with a sensor in Python, or with any sensor in a filter whose model is in Python."""
    x = _single(engine)
    covariance = engine.covariance()[0]
    measured = as_float64(z, "z")
    if np.isinf(measured).any():
        raise InvalidInputError("z: expected finite numbers (or NaN: no measurement), got infinity")
    context = with_time(sensor, context, engine.time)
    if type(sensor) is LandmarkCamera and np.isnan(measured).all():
        # No landmark has to be in front of a camera that saw none.
        nothing = np.full(measured.size, np.nan)
        beta, consider = options["underweighting"], options["consider"]
        return Step(sensor, context, x, covariance, nothing, np.nan, nothing.size, False, beta, consider)
    look, there = _seen(sensor, measured, context)
    innovation, h, r = look.at(x)
    dof = look.dof(innovation.size)

    def report(nis: float, accepted: bool) -> Step:
        beta, consider = options["underweighting"], options["consider"]
        whole = np.full(measured.size, np.nan)
        whole[there] = innovation
        return Step(sensor, context, x, covariance, whole, nis, dof, accepted, beta, consider)

    if np.isnan(look.measured).any():
        return report(float("nan"), False)
    zero = np.zeros(x.size)
    delta, nis = engine.attempt(*_whitened(sensor, look.direction, innovation, h, r), zero)
    beta = options["underweighting"]
    if beta > 0.0:
        delta, _ = engine.attempt(
            *_underweighted(look, innovation, h, r, covariance=covariance, beta=beta), zero
        )
    if not nis <= engine.bound_for(sensor, dof):
        if not np.isfinite(nis):
            raise NumericalError("update: the innovation is not finite; the filter is unchanged")
        engine.count(sensor, False)
        return report(nis, False)
    for _ in range(1, options["iterations"]):
        again, h, r = look.at(x + delta)
        rows = _underweighted(look, again, h, r, covariance=covariance, beta=beta)
        delta, _ = engine.attempt(*rows, delta)
    if not engine.commit():
        raise NumericalError("update: the result is not finite; the filter is unchanged")
    engine.count(sensor, True)
    return report(nis, True)


def linearized(
    sensor: Any, state: Any, z: FloatArray, context: dict[str, Any]
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Whitened innovation ``(M,)`` and rows ``(M, n)`` of a sensor at a state; innovation; freedom."""
    if np.isinf(z).any():
        raise InvalidInputError("z: expected finite numbers (or NaN: no measurement), got infinity")
    look = _Look(sensor, z, context)
    innovation, h, r = look.at(state)
    if np.isnan(innovation).any():
        return innovation, h, innovation, look.dof(innovation.size)
    white, rows = _whitened(sensor, look.direction, innovation, h, r)
    return white, np.ascontiguousarray(rows), innovation, look.dof(innovation.size)


def step(
    ekf: ExtendedKalmanFilter,
    dt: ArrayLike,
    sensor: Any,
    z: ArrayLike,
    *,
    control: ArrayLike | None,
    context: dict[str, Any],
) -> Step:
    """Predict and update; if either fails nothing has happened."""
    engine = ekf._engine
    before, stored, time = engine.state(), engine.stored(), engine.time
    try:
        ekf.predict(dt, control)  # type: ignore[arg-type]
        return ekf.update(sensor, z, **context)
    except BaseException:
        engine.set(before, stored, True)
        engine.time = time
        raise


def run(
    ekf: ExtendedKalmanFilter,
    times: ArrayLike,
    pairs: list[tuple[Any, ArrayLike]],
    controls: ArrayLike | None,
    context: dict[str, Any],
) -> FilterLog:
    """Whole arcs, step by step in Python."""
    epochs = finite(times, "times").copy()
    if epochs.ndim != 1:
        raise InvalidInputError(f"times: expected shape (T,), got {epochs.shape}")
    series = [_series(f"measurements[{i}]", z, epochs.size) for i, (_, z) in enumerate(pairs)]
    journey = Journey(ekf.dynamics, None if controls is None else finite(controls, "controls").copy())
    known = {name: as_float64(value, name) for name, value in context.items()}
    leads = {z.shape[0] for z in series if z.ndim == 3} | {d.shape[0] for d in known.values() if d.ndim == 4}
    leads |= set(ekf.state.shape[:-1])
    if len(leads) > 1:
        raise InvalidInputError(f"measurements: expected one number of runs, got {sorted(leads)}")
    batch = bool(leads)
    runs = leads.pop() if leads else 1
    logs = []
    for index in range(runs):
        one = _one_of(ekf, index, keep=not batch)
        rows = [z if z.ndim == 2 else z[index] for z in series]
        logs.append(_arc(one, epochs, [s for s, _ in pairs], rows, journey=journey, known=known, run=index))
    arrays = {name: np.stack([log[name] for log in logs]) for name in logs[0]}
    dof = arrays.pop("dof").reshape(runs * epochs.size, -1).max(axis=0, initial=0).astype(int)
    if not batch:
        arrays = {name: array[0] for name, array in arrays.items()}
    return FilterLog(epochs, [z.shape[-1] for z in series], list(dof), arrays, journey)


def _one_of(ekf: ExtendedKalmanFilter, run: int, keep: bool) -> ExtendedKalmanFilter:
    """The filter of one run: itself, or a copy that starts where the batch has it."""
    if keep:
        return ekf
    dynamics, options, time, state, stored, rejections = ekf._frozen()
    if state.ndim == 2:
        state, stored = state[run], stored[run : run + 1]
    return type(ekf)._restore(dynamics, options, time, state, stored, rejections)


def _arc(
    ekf: ExtendedKalmanFilter,
    epochs: FloatArray,
    sensors: list[Any],
    measured: list[FloatArray],
    *,
    journey: Journey,
    known: dict[str, FloatArray],
    run: int,
) -> dict[str, FloatArray]:
    """One arc; a measurement that cannot be taken is not accepted and the arc goes on."""
    columns: dict[str, list[Any]] = {
        name: [] for name in ("state", "covariance", "nis", "accepted", "innovation", "dof")
    }
    for k, time in enumerate(epochs):
        if float(time) != ekf.time:
            ekf.predict(float(time) - ekf.time, journey.control(run, k))
            ekf._engine.time = float(time)
        told = {name: _now(name, value, run, k, epochs.size) for name, value in known.items()}
        seen: list[tuple[float, bool, int, FloatArray]] = []
        for sensor, rows in zip(sensors, measured, strict=True):
            try:
                step = ekf.update(sensor, rows[k], **told)
                missing = bool(np.isnan(step.nis))
                innovation = np.full(rows[k].size, np.nan) if missing else step.innovation
                seen.append((step.nis, step.accepted, step.dof, innovation))
            except NumericalError:
                seen.append((np.nan, False, 0, np.full(rows[k].size, np.nan)))
        columns["state"].append(ekf.state)
        columns["covariance"].append(ekf.covariance)
        columns["nis"].append([nis for nis, _, _, _ in seen])
        columns["accepted"].append([accepted for _, accepted, _, _ in seen])
        columns["dof"].append([dof for _, _, dof, _ in seen])
        columns["innovation"].append(np.concatenate([y for _, _, _, y in seen]) if seen else np.zeros(0))
    return {name: np.array(values) for name, values in columns.items()}


def _now(name: str, value: FloatArray, run: int, epoch: int, epochs: int) -> FloatArray:
    """What is told at one epoch: attitudes and other matrices may have axes for runs and epochs."""
    core = 2 if name in ("dcm", "landmarks") else 1
    lead = value.shape[: value.ndim - core]
    if len(lead) == 2 and lead[1] == epochs:
        return np.asarray(value[run, epoch])
    if len(lead) == 1 and lead[0] == epochs:
        return np.asarray(value[epoch])
    return value


def _series(name: str, z: ArrayLike, epochs: int) -> FloatArray:
    array = as_float64(z, name)
    if array.ndim == 1 and array.shape == (epochs,):
        array = array[:, np.newaxis]
    if array.ndim not in (2, 3) or array.shape[-2] != epochs:
        expected = f"(T, M) or (runs, T, M) with T = {epochs}"
        raise InvalidInputError(f"{name}: expected shape {expected}, got {array.shape}")
    return array


class _Look:
    """A sensor and what it measured, to be linearised anywhere."""

    def __init__(self, sensor: Any, measured: FloatArray, context: dict[str, Any]) -> None:
        needed(sensor, "sensor", ("predict", "jacobian", "noise"))
        self.sensor, self.measured, self.context = sensor, measured, told_to(sensor, context)
        self.direction = np.zeros(0)

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``y = z [-] h(x)``, ``H``, ``R``."""
        self.direction = np.ravel(_from_model(self.sensor.predict(x, **self.context), "sensor.predict(...)"))
        rows = self.direction.size
        z = self.measured.reshape(-1)
        if z.size != rows:
            raise InvalidInputError(f"z: expected shape ({rows},), got {self.measured.shape}")
        residual = getattr(self.sensor, "residual", None)
        y = z - self.direction if residual is None else np.asarray(residual(z, self.direction), dtype=float)
        shape = (rows, x.size) if isinstance(x, np.ndarray) else None
        h = _from_model(self.sensor.jacobian(x, **self.context), "sensor.jacobian(...)", shape)
        r = _from_model(self.sensor.noise(x, **self.context), "sensor.noise(...)", (rows, rows))
        return np.ravel(y), h, r

    def dof(self, rows: int) -> int:
        """Independent rows: two of the three of a direction."""
        if measures_unit_vectors(self.sensor):
            return 2 * rows // 3
        return int(getattr(self.sensor, "dof", rows))


def _seen(sensor: Any, measured: FloatArray, context: dict[str, Any]) -> tuple[_Look, Any]:
    """What there is of a measurement, and which of its numbers: of a camera the landmarks that were seen."""
    if type(sensor) is LandmarkCamera and measured.size == 2 * len(sensor.landmarks):
        seen = np.isfinite(measured.reshape(-1, 2)).all(axis=-1)
        if seen.any() and not seen.all() and context.get("landmarks") is None:
            return _Look(sensor.only(seen), measured.reshape(-1, 2)[seen], context), np.repeat(seen, 2)
    return _Look(sensor, measured, context), slice(None)


def _whitened(
    sensor: Any, direction: FloatArray, y: FloatArray, h: FloatArray, r: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Rows of unit noise. Of a unit vector only the two components across it are measured."""
    if measures_unit_vectors(sensor):
        across = _across(direction.reshape(-1, 3))
        y, h, r = across @ y, across @ h, across @ r @ across.T
    try:
        root = np.linalg.cholesky(r)
    except np.linalg.LinAlgError:
        raise InvalidInputError("sensor.noise(...): expected a symmetric positive definite matrix") from None
    return np.linalg.solve(root, y), np.linalg.solve(root, h)


def _underweighted(
    look: _Look, y: FloatArray, h: FloatArray, r: FloatArray, *, covariance: FloatArray, beta: float
) -> tuple[FloatArray, FloatArray]:
    """Rows that err by ``R + beta H P H'`` made rows of unit noise; with ``beta = 0`` by ``R`` alone."""
    return _whitened(
        look.sensor, look.direction, y, h, r + beta * within_blocks(look.sensor, h @ covariance @ h.T)
    )


def _across(directions: FloatArray) -> FloatArray:
    """``(2 N, 3 N)``: two unit vectors across each direction."""
    out = np.zeros((2 * len(directions), 3 * len(directions)))
    for i, b in enumerate(directions):
        _, _, v = np.linalg.svd(b[np.newaxis])
        out[2 * i : 2 * i + 2, 3 * i : 3 * i + 3] = v[1:]
    return out


def _single(engine: _core.Filter) -> FloatArray:
    states = engine.state()
    if len(states) != 1:
        raise InvalidInputError(
            "state: this filter holds a batch of states; step them with run(), or give one filter to each"
        )
    return np.asarray(states[0])


def _from_model(value: Any, what: str, shape: tuple[int, ...] | None = None) -> FloatArray:
    array = as_float64(value, what)
    if shape is not None and array.shape != shape:
        raise InvalidInputError(f"{what}: expected shape {shape}, got {array.shape}")
    return array

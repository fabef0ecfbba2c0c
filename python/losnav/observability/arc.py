"""An arc as its derivatives: the transitions of a model and the rows of its sensors, in units of their noise.

Whatever a model or a sensor of losnav can do for many epochs at once is asked once; a user's own is asked
epoch by epoch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, as_float64, finite, in_range
from losnav.errors import InvalidInputError

__all__ = ["Course", "Look", "course", "rows_of", "survey", "told_at", "triangular", "whitening"]

# Variance, relative to the largest of a measurement with unit diagonal, that counts as none at all.
_EXACT = 1e-12
# Columns of a sensor of navigation states.
_NAVIGATION = 15
# Context whose entries are matrices; the others are vectors, an epoch a number.
_MATRICES = ("dcm", "landmarks")


@dataclass(frozen=True, eq=False)
class Course:
    """Epochs of an arc and the model's own states there, with what led from each to the next.

    ``states`` is an array ``(..., T, N)``, or what the model's ``propagate`` returns: indexable by epoch.
    """

    times: FloatArray
    states: Any
    transition: FloatArray
    process_noise: FloatArray

    @property
    def size(self) -> int:
        """Number of components of the tangent."""
        return int(self.transition.shape[-1])

    def at(self, epochs: Any) -> Any:
        """States at some epochs."""
        return self.states[..., epochs, :] if isinstance(self.states, np.ndarray) else self.states[epochs]


@dataclass(frozen=True, eq=False)
class Look:
    """A sensor, and which of its components it measures at which epochs, ``(T, M)`` or ``(T, 1)``."""

    sensor: Any
    seen: npt.NDArray[np.bool_]


def survey(  # noqa: PLR0917 - the order of gramian and crlb
    dynamics: Any,
    sensor: Any,
    state: Any,
    times: ArrayLike,
    controls: Any,
    start: float | None,
    context: dict[str, Any],
) -> tuple[Course, list[Look], dict[str, Any]]:
    """The arc flown, its sensors, and what they are told, all with the start as an epoch of its own if that
    is given."""
    epochs = finite(times, "times")
    path = course(dynamics, state, epochs, controls, start)
    found = looks(sensor, epochs.size)
    known = {name: as_float64(value, name) for name, value in context.items()}
    if start is not None:
        found = [Look(x.sensor, np.vstack([np.zeros_like(x.seen[:1]), x.seen])) for x in found]
        for name, array in known.items():
            along = _along(name, array)
            if along >= 0 and array.shape[along] == epochs.size:
                known[name] = np.concatenate([array.take([0], along), array], axis=along)
    return path, found, known


def rows_of(path: Course, sensors: list[Look], context: dict[str, Any]) -> FloatArray:
    """Rows of unit noise of all sensors, ``(..., T, M, N)``, those not measured being zero."""
    rows = [_weighted(path, look, context) for look in sensors]
    lead = np.broadcast_shapes(path.transition.shape[:-3], *(r.shape[:-3] for r in rows))
    return np.concatenate([np.broadcast_to(r, (*lead, *r.shape[-3:])) for r in rows], axis=-2)


def triangular(rows: FloatArray) -> FloatArray:
    """``R`` of a QR decomposition: ``R' R`` is ``rows' rows``.

    Householder reflections treat each column by itself, so columns in any unit keep their digits.
    """
    return np.asarray(np.linalg.qr(rows, mode="r"), dtype=np.float64)


# --- the model -------------------------------------------------------------------------------------------


def course(
    dynamics: Any, state: Any, times: ArrayLike, controls: Any = None, start: float | None = None
) -> Course:
    """Fly the model from ``state``, at ``start`` or the first of ``times``, along all of them."""
    for method in ("propagate", "transition", "process_noise"):
        if not callable(getattr(dynamics, method, None)):
            raise InvalidInputError(
                "dynamics: expected an object with propagate, transition and process_noise; "
                f"{type(dynamics).__name__} has no {method}"
            )
    epochs = finite(times, "times")
    if epochs.ndim != 1 or not epochs.size:
        raise InvalidInputError(f"times: expected shape (T,) with T >= 1, got {epochs.shape}")
    if start is not None:
        epochs = np.concatenate([np.atleast_1d(finite(start, "start")), epochs])
    x = state if hasattr(state, "inject") else finite(state, "state")
    if isinstance(x, np.ndarray) and not x.ndim:
        raise InvalidInputError(f"state: expected shape (..., N), got {x.shape}")
    steps = _steps(controls, epochs.size - 1, start is not None)
    if _ours(dynamics, "dynamics") and hasattr(dynamics, "trajectory"):
        return _flown(dynamics, x, epochs, steps)
    if not isinstance(x, np.ndarray) or x.ndim == 1:
        return _stepped(dynamics, x, epochs, steps)
    every = [_stepped(dynamics, x[i], epochs, steps) for i in np.ndindex(x.shape[:-1])]
    joined = (
        np.stack([getattr(one, name) for one in every]) for name in ("states", "transition", "process_noise")
    )
    return Course(epochs, *(array.reshape((*x.shape[:-1], *array.shape[1:])) for array in joined))


def _ours(thing: Any, room: str) -> bool:
    """Is it exactly a class of losnav's?  A subclass may have changed anything."""
    return type(thing).__module__.split(".")[:2] == ["losnav", room]


def _steps(controls: Any, count: int, from_start: bool) -> FloatArray | None:
    """One control for each step, ``(count, C)``."""
    if controls is None:
        return None
    if isinstance(controls, tuple) and len(controls) == 2 and np.ndim(controls[0]):
        controls = np.concatenate([as_float64(c, "controls") for c in controls], axis=-1)
    u = finite(controls, "controls")
    if u.ndim == 1:
        return np.broadcast_to(u, (count, u.size))
    if u.ndim == 2 and len(u) == count + 1 and not from_start:
        u = u[1:]
    if u.ndim != 2 or len(u) != count:
        raise InvalidInputError(
            f"controls: expected shape (C,), ({count}, C) or ({count + 1}, C), the last with one control for "
            f"each epoch, which acts over the step that ends there; got {u.shape}"
        )
    return u


def _flown(dynamics: Any, state: Any, epochs: FloatArray, steps: FloatArray | None) -> Course:
    """All steps of a model of losnav's in three calls."""
    states = dynamics.trajectory(state, epochs, steps)
    path = Course(epochs, states, np.empty(0), np.empty(0))
    before, dt = path.at(slice(-1)), np.diff(epochs)
    when: dict[str, Any] = {"time": epochs[:-1]} if getattr(dynamics, "time_varying", False) else {}
    if not dt.size:
        size = dynamics.state_size
        lead = state.shape[:-1] if isinstance(state, np.ndarray) else ()
        nothing = np.zeros((*lead, 0, size, size))
        return Course(epochs, states, nothing, nothing)
    phi = dynamics.transition(before, dt, steps, **when)
    if hasattr(state, "inject"):  # noise of its attitude turns what pushes it
        when["control"] = steps
    return Course(epochs, states, phi, dynamics.process_noise(before, dt, **when))


def _stepped(dynamics: Any, state: Any, epochs: FloatArray, steps: FloatArray | None) -> Course:
    """Any model, step by step."""
    states, transitions, noises = [state], [], []
    for k, dt in enumerate(np.diff(epochs)):
        x, step = states[-1], float(dt)
        when = {"time": float(epochs[k])} if getattr(dynamics, "time_varying", False) else {}
        known = (x, step) if steps is None else (x, step, steps[k])
        transitions.append(finite(dynamics.transition(*known, **when), "dynamics.transition(...)"))
        noises.append(finite(dynamics.process_noise(x, step, **when), "dynamics.process_noise(...)"))
        moved = dynamics.propagate(*known, **when)
        states.append(finite(moved, "dynamics.propagate(...)") if isinstance(x, np.ndarray) else moved)
    if not transitions:
        transitions = noises = [np.asarray(dynamics.transition(state, 0.0), dtype=float)]
    count = epochs.size - 1
    together: Any = np.array(states) if isinstance(state, np.ndarray) else states
    phi, noise = np.array(transitions)[:count], np.array(noises)[:count]
    for name, array in (("transition", phi), ("process_noise", noise)):
        if array.ndim != 3 or array.shape[1:] != (phi.shape[-1], phi.shape[-1]):
            raise InvalidInputError(f"dynamics.{name}(...): expected a square matrix, got {array.shape[1:]}")
    return Course(epochs, together, phi, noise)


# --- the sensors -----------------------------------------------------------------------------------------


def looks(sensor: Any, epochs: int) -> list[Look]:
    """One or several sensors, each with what it measures when.

    ``sensor`` is a sensor, or a sequence whose members are sensors or pairs ``(sensor, seen)``; ``seen`` is
    ``(T,)`` or ``(T, M)`` of bools, or measurements ``(T, M)`` with NaN where there are none.
    """
    many = [sensor] if hasattr(sensor, "jacobian") or not isinstance(sensor, list | tuple) else sensor
    found = []
    for i, item in enumerate(many):
        name = "sensor" if many is not sensor else f"sensor[{i}]"
        one, seen = (item, None) if hasattr(item, "jacobian") or not isinstance(item, tuple) else item[:2]
        for method in ("jacobian", "noise"):
            if not callable(getattr(one, method, None)):
                raise InvalidInputError(
                    f"{name}: expected an object with predict, jacobian and noise, or a sequence of such "
                    f"objects or pairs (object, seen); {type(one).__name__} has no {method}"
                )
        found.append(Look(one, _seen(seen, name, epochs, getattr(one, "block", 0))))
    return found


def _seen(value: Any, name: str, epochs: int, block: int) -> npt.NDArray[np.bool_]:
    if value is None:
        return np.ones((epochs, 1), dtype=bool)
    mask = np.array(value)
    if mask.dtype != bool:
        mask = np.isfinite(as_float64(value, name))
        # A measurement with a NaN is none; of one in blocks, the images of landmarks, that block is none.
        if mask.ndim == 2 and mask.shape[1]:
            whole = mask.reshape(len(mask), -1, block or mask.shape[1]).all(axis=-1)
            mask = np.asarray(np.repeat(whole, block, axis=1) if block else whole)
    if mask.ndim == 1:
        mask = mask[:, np.newaxis]
    if mask.ndim != 2 or len(mask) != epochs:
        raise InvalidInputError(
            f"{name}: expected which epochs are measured as bools ({epochs},) or ({epochs}, M), or "
            f"measurements ({epochs}, M) with NaN where there are none, got shape {np.shape(value)}"
        )
    return mask


def _weighted(path: Course, look: Look, context: dict[str, Any]) -> FloatArray:
    """Rows of unit noise of one sensor, ``(..., T, M, N)``; zero where nothing is measured."""
    epochs = np.flatnonzero(look.seen.any(axis=1))
    if not epochs.size:
        return np.zeros((path.times.size, 1, path.size))
    told = told_at(look.sensor, context, epochs, path.times)
    if _ours(look.sensor, "sensors") and not isinstance(path.states, list):
        x = path.at(epochs)
        jacobian, noise = look.sensor.jacobian(x, **told), look.sensor.noise(x, **told)
    else:
        jacobian, noise = _asked(path, look, context, epochs)
    h, r = finite(jacobian, "sensor.jacobian(...)"), finite(noise, "sensor.noise(...)")
    if hasattr(path.at(0), "inject"):
        h = _columns(h, path.size)
    if h.ndim < 3 or h.shape[-1] != path.size or r.shape[-2:] != (h.shape[-2], h.shape[-2]):
        raise InvalidInputError(
            f"sensor.jacobian(...): expected (M, {path.size}) and of sensor.noise(...) (M, M), got "
            f"{h.shape[-2:]} and {r.shape[-2:]}"
        )
    return _scattered(_whitened(h, r, look.seen[epochs]), epochs, path.times.size)


def _columns(h: FloatArray, size: int) -> FloatArray:
    """Columns ``[dr dv da db_a db_g]`` of a sensor as the model's tangent has them: without biases 9, or 12
    with an acceleration; with biases 15, or 18."""
    if h.shape[-1] != _NAVIGATION or size == _NAVIGATION:
        return h
    kept = h[..., : _NAVIGATION if size >= _NAVIGATION else _NAVIGATION - 6]
    more = np.zeros((*h.shape[:-1], max(size - kept.shape[-1], 0)))
    return np.concatenate([kept, more], axis=-1)


def _scattered(rows: FloatArray, epochs: npt.NDArray[np.intp], count: int) -> FloatArray:
    out = np.zeros((*rows.shape[:-3], count, *rows.shape[-2:]))
    out[..., epochs, :, :] = rows
    return in_range(out, "state, times or sensor")


def _asked(
    path: Course, look: Look, context: dict[str, Any], epochs: npt.NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Jacobians and noise of a user's sensor, state by state."""
    arrays = isinstance(path.states, np.ndarray)
    lead = path.states.shape[:-2] if arrays else ()
    jacobians, noises = [], []
    for index in np.ndindex(lead):
        for k in epochs:
            told = told_at(look.sensor, context, int(k), path.times)
            x = path.states[index][k] if arrays else path.states[k]
            jacobians.append(as_float64(look.sensor.jacobian(x, **told), "sensor.jacobian(...)"))
            noises.append(as_float64(look.sensor.noise(x, **told), "sensor.noise(...)"))
    shape = (*lead, epochs.size)
    return tuple(np.array(a).reshape((*shape, *a[0].shape)) for a in (jacobians, noises))  # type: ignore[return-value]


def told_at(sensor: Any, context: dict[str, Any], epochs: Any, times: FloatArray) -> dict[str, Any]:
    """What concerns a sensor of the context, at one epoch or some; when, if it changes with time."""
    from losnav.filters.step import told_to

    told = {}
    for name, value in told_to(sensor, context).items():
        array = as_float64(value, name)
        along = _along(name, array)
        varies = along >= 0 and array.shape[along] == times.size
        told[name] = np.take(array, epochs, axis=along) if varies else array
    if getattr(sensor, "time_varying", False) is True:
        told.setdefault("time", times[epochs])
    return told


def _along(name: str, array: FloatArray) -> int:
    """Axis that may be that of the epochs; negative if there is none."""
    return array.ndim - 1 - (2 if name in _MATRICES else 0 if name == "time" else 1)


def _whitened(h: FloatArray, r: FloatArray, seen: npt.NDArray[np.bool_]) -> FloatArray:
    """``V H`` with ``V R V' = I``; rows not seen, and combinations known exactly that say nothing, are 0."""
    if seen.shape[-1] not in (1, h.shape[-2]):
        raise InvalidInputError(f"seen: expected 1 or {h.shape[-2]} columns, got {seen.shape[-1]}")
    off = ~np.broadcast_to(seen, (*seen.shape[:-1], h.shape[-2]))
    if off.any():
        r = np.where(off[..., :, np.newaxis] | off[..., np.newaxis, :], 0.0, r)
        r = r + off[..., np.newaxis] * np.eye(h.shape[-2])
        h = np.where(off[..., np.newaxis], 0.0, h)
    return whitening(r, h)


def whitening(r: FloatArray, h: FloatArray) -> FloatArray:
    """Rows ``h`` in units of their noise: ``V h`` with ``V r V' = I``.

    Of a measurement whose noise has no extent along some direction (the length of a unit vector) only what
    remains is weighed.
    """
    deviation = np.sqrt(np.maximum(np.diagonal(r, axis1=-2, axis2=-1), 0.0))
    deviation = np.where(deviation > 0.0, deviation, 1.0)[..., np.newaxis]
    unit, rows = r / deviation / np.swapaxes(deviation, -1, -2), h / deviation
    if not (unit - np.eye(r.shape[-1])).any():
        return np.asarray(rows)
    values, vectors = np.linalg.eigh(unit)
    if (values < -_EXACT).any() or np.abs(unit - np.swapaxes(unit, -1, -2)).max() > _EXACT:
        raise InvalidInputError("sensor.noise(...): expected a symmetric positive semidefinite matrix")
    turned = np.swapaxes(vectors, -1, -2) @ rows
    exact = values <= _EXACT * values[..., -1:]
    size = np.abs(rows).max(axis=(-2, -1), keepdims=True)
    if (np.abs(turned) * exact[..., np.newaxis] > np.sqrt(_EXACT) * size).any():
        raise InvalidInputError("sensor.noise(...): expected noise on everything that depends on the state")
    root = np.sqrt(np.where(exact, 1.0, values))
    return np.asarray(np.where(exact[..., np.newaxis], 0.0, turned / root[..., np.newaxis]))

"""What every built-in sensor does the same way: read the state, broadcast, ask the engine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, as_float64, broadcast, finite, in_range, rotations, vectors
from losnav.attitude import dcm_from_mrp
from losnav.errors import InvalidInputError
from losnav.navigation_state import NavState

# Columns of the engine's rows, [dp dv dalpha], that each kind of state has.
POSITION = np.arange(3)
POSITION_VELOCITY = np.arange(6)
POSE = np.array([0, 1, 2, 6, 7, 8])
NAVIGATION = np.arange(9)
# Columns of the biases, which no sensor sees.
BIASES = 6

# Stands in for the attitude where a sensor does not need one.
NO_TURN = np.eye(3)
NO_TURN.flags.writeable = False


@dataclass(frozen=True)
class Observer:
    """Position, velocity and attitude of a state, and which columns its tangent has."""

    position: FloatArray
    velocity: FloatArray
    dcm: FloatArray
    columns: np.ndarray[Any, np.dtype[np.intp]]
    # Further columns of the tangent, all zero.
    unseen: int = 0


def observer(state: Any, dcm: ArrayLike | None) -> Observer:
    """A state of any kind as a sensor sees it."""
    if dcm is not None and turns_with(state):
        raise InvalidInputError("dcm: the state has an attitude of its own; give one or the other")
    if isinstance(state, NavState):
        return Observer(state.position, state.velocity, state.dcm, NAVIGATION, BIASES)
    if hasattr(state, "position") and hasattr(state, "mrp"):
        state = (state.position, state.mrp)
    if isinstance(state, tuple) and len(state) == 2:
        position = vectors(state[0], "position")
        return Observer(position, np.zeros(3), dcm_from_mrp(vectors(state[1], "mrp")), POSE)
    array = finite(state, "state")
    if array.ndim < 1 or array.shape[-1] not in (3, 6):
        raise InvalidInputError(
            "state: expected shape (..., 3), (..., 6), a tuple (position, mrp) or a NavState, "
            f"got shape {array.shape}"
        )
    if dcm is None:
        raise InvalidInputError(
            "dcm: expected the attitude (body from reference), which this state does not hold"
        )
    attitude = rotations(dcm, "dcm")
    if array.shape[-1] == 3:
        return Observer(array, np.zeros(3), attitude, POSITION)
    return Observer(array[..., :3], array[..., 3:], attitude, POSITION_VELOCITY)


def is_listed(sensor: Any) -> bool:
    """Is it one of the library's own?  A subclass may have changed anything."""
    return type(sensor).__module__.startswith("losnav.sensors")


def measures_unit_vectors(sensor: Any) -> bool:
    """Does each three numbers of its measurement have two degrees of freedom?"""
    return is_listed(sensor) and bool(sensor.unit_vectors)


def turns_with(state: Any) -> bool:
    """Does the state hold an attitude?"""
    pair = isinstance(state, tuple) and len(state) == 2
    return pair or isinstance(state, NavState) or hasattr(state, "mrp")


def velocity_needed(state: Any, jacobian: FloatArray, sensor: str) -> None:
    """Refuse a state without a velocity, going by the columns of its tangent."""
    if not isinstance(state, NavState) and (turns_with(state) or jacobian.shape[-1] == 3):
        raise InvalidInputError(
            f"state: expected [r v], (..., 6), or a NavState, of which {sensor} needs the velocity"
        )


class Listed:
    """The engine's side of a sensor."""

    # Columns of the measurement that are angles.
    angles: ClassVar[tuple[int, ...]] = ()
    # Is the measurement unit vectors one after another, each with two degrees of freedom?
    unit_vectors: ClassVar[bool] = False
    # What it takes as context besides the attitude.
    told: ClassVar[tuple[str, ...]] = ()
    # Rows that come with one landmark or beam, taken together; 0: all.
    block: ClassVar[int] = 0
    # Does the measurement depend on when it is made?
    time_varying: ClassVar[bool] = False
    # What the engine calls the sensor.
    _built_in: ClassVar[str]

    def __init_subclass__(cls) -> None:
        # A user's subclass goes by the name of the sensor it extends.
        if cls.__module__.startswith("losnav."):
            cls._built_in = cls.__name__

    def residual(self, z: ArrayLike, predicted: ArrayLike) -> FloatArray:
        """Innovation ``z - predicted``, angles wrapped to (-pi, pi].

        Parameters
        ----------
        z, predicted : (..., M)
            Measured and expected; NaN passes through.

        Returns
        -------
        (..., M)
            What a filter weighs.

        Raises
        ------
        InvalidInputError
            On shapes that do not broadcast.
        """
        measured, expected = as_float64(z, "z"), as_float64(predicted, "predicted")
        try:
            difference: FloatArray = measured - expected
        except ValueError as error:
            raise InvalidInputError(
                f"z: expected a shape that broadcasts with {expected.shape}, got {measured.shape}"
            ) from error
        for column in self.angles:
            difference[..., column] = wrapped(difference[..., column])
        return difference

    def _ask(
        self,
        state: Any,
        dcm: ArrayLike | None,
        parameter: FloatArray,
        *,
        name: str,
        core: int,
        fixed: tuple[FloatArray, ...] = (),
    ) -> tuple[FloatArray, FloatArray]:
        """Prediction and Jacobian; ``parameter`` is the array of the sensor the engine needs.

        It may have leading dimensions beyond its ``core`` ones, ``fixed`` are those that have none.
        """
        if dcm is not None and parameter.ndim == core and not turns_with(state):
            single = _core.sensor_single(self._built_in, (parameter, *fixed), state, dcm)
            if single is not None:
                predicted, jacobian = single
                return predicted, jacobian[:, : np.shape(state)[-1]]
        x = observer(state, dcm)
        named = (("position", x.position, 1), ("velocity", x.velocity, 1), ("dcm", x.dcm, 2))
        if parameter.ndim == core:
            shape, (p, v, a) = broadcast(*named)
            parameter = parameter[np.newaxis]
        else:
            shape, (p, v, a, parameter) = broadcast(*named, (name, parameter, core))
        others = tuple(array[np.newaxis] for array in fixed)
        predicted, jacobian = _core.sensor_linearize(self._built_in, (parameter, *others), p, v, a)
        in_range(jacobian, f"state or {name}")
        rows = np.shape(predicted)[1]
        seen = np.asarray(jacobian).reshape((*shape, rows, 9))[..., x.columns]
        if x.unseen:
            seen = np.concatenate([seen, np.zeros((*shape, rows, x.unseen))], axis=-1)
        return np.asarray(predicted).reshape((*shape, rows)), seen


def wrapped(angle: FloatArray) -> FloatArray:
    """The same angle in (-pi, pi], unchanged if it is there."""
    turned: FloatArray = angle - 2 * np.pi * np.round(angle / (2 * np.pi))
    return np.where(turned <= -np.pi, turned + 2 * np.pi, turned)

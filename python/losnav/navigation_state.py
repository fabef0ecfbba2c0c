"""What an inertial navigator knows of itself: place, motion, attitude and the errors of its instruments."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, broadcast, in_range, quaternions, vectors
from losnav.attitude import dcm_from_quaternion, quaternion_from_dcm, rotation_error
from losnav.errors import InvalidInputError

__all__ = ["NavState"]

# Name and components, in the order the engine keeps them.
_PARTS = (
    ("position", 3),
    ("velocity", 3),
    ("quaternion", 4),
    ("accelerometer_bias", 3),
    ("gyroscope_bias", 3),
    ("acceleration", 3),
)
_NUMBERS = sum(size for _, size in _PARTS)
_COLUMNS = {
    "accelerometer_bias": slice(10, 13),
    "gyroscope_bias": slice(13, 16),
    "acceleration": slice(16, 19),
}
# Parts of an error beyond position, velocity and attitude, by its size.
_BIASES, _ACCELERATION = ("accelerometer_bias", "gyroscope_bias"), ("acceleration",)
_EXTRAS: dict[int, tuple[str, ...]] = {
    9: (),
    12: _ACCELERATION,
    15: _BIASES,
    18: (*_BIASES, *_ACCELERATION),
}


@dataclass(frozen=True, eq=False, repr=False, init=False)
class NavState:
    """Position, velocity, attitude, biases of the inertial unit, an unmodelled acceleration; one or a batch.

    All in the reference frame of the problem, for a landing the site's (East, North, Up, origin at the site,
    turning with the body). Fields broadcast. Errors are true minus estimate in the order position, velocity,
    attitude ``[dr dv da]``, then ``[db_a db_g]``, then ``[dd]``, where ``da`` is the small rotation in body
    axes with ``dcm_true = (I - [da x]) dcm_estimate``.

    Parameters
    ----------
    position : (..., 3)
        m.
    velocity : (..., 3)
        As seen in the reference frame, m/s.
    quaternion : (..., 4)
        Orientation of the body in the reference frame, scalar last; either sign, unit within 1e-2. Kept unit,
        ``w >= 0``.
    accelerometer_bias : (..., 3)
        Body axes, m/s^2: what the accelerometers show too much.
    gyroscope_bias : (..., 3)
        Body axes, rad/s: what the gyroscopes show too much.
    acceleration : (..., 3)
        Acceleration that the model of gravity and thrust leaves out, reference axes, m/s^2.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a quaternion that is not unit.

    Examples
    --------
    >>> import losnav as ln
    >>> state = ln.NavState([400.0, -300.0, 2000.0], [-1.0, 0.7, -5.0], [0.0, 0.0, 0.0, 1.0])
    >>> moved = state.inject([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.02])
    >>> moved.minus(state, 9).round(12)
    array([1.  , 0.  , 0.  , 0.  , 0.  , 0.  , 0.  , 0.  , 0.02])
    """

    position: FloatArray
    velocity: FloatArray
    quaternion: FloatArray
    accelerometer_bias: FloatArray
    gyroscope_bias: FloatArray
    acceleration: FloatArray

    # NumPy is to leave operators alone.
    __array_ufunc__: ClassVar[None] = None

    def __init__(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        quaternion: ArrayLike,
        accelerometer_bias: ArrayLike = (0.0, 0.0, 0.0),
        gyroscope_bias: ArrayLike = (0.0, 0.0, 0.0),
        *,
        acceleration: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        given = (position, velocity, quaternion, accelerometer_bias, gyroscope_bias, acceleration)
        named = []
        for (name, size), value in zip(_PARTS, given, strict=True):
            if name == "quaternion":
                named.append((name, _canonical(quaternions(value, name)), 1))
                continue
            array = as_float64(value, name)
            if not array.ndim and name not in {"position", "velocity"}:
                # A plain zero stands for three.
                array = np.broadcast_to(array, 3)
            named.append((name, vectors(array, name, size), 1))
        shape, flat = broadcast(*named)
        # Copies: what the caller does with the arrays afterwards is not the state's affair.
        self._hold([array.reshape((*shape, array.shape[-1])).copy() for array in flat])

    @classmethod
    def from_dcm(
        cls, position: ArrayLike, velocity: ArrayLike, dcm: ArrayLike, **others: ArrayLike
    ) -> NavState:
        """State with the attitude given as a matrix.

        Parameters
        ----------
        position, velocity : (..., 3)
            As for the class.
        dcm : (..., 3, 3)
            Body from reference.
        **others
            ``accelerometer_bias``, ``gyroscope_bias``, ``acceleration`` as for the class.

        Returns
        -------
        NavState
            The state.

        Raises
        ------
        InvalidInputError
            As the class, or if ``dcm`` is no rotation.
        """
        return cls(position, velocity, quaternion_from_dcm(dcm), **others)

    @classmethod
    def stack(cls, states: Sequence[NavState]) -> NavState:
        """Batch of states of equal shape, along a new first dimension.

        Parameters
        ----------
        states : sequence of NavState
            At least one.

        Returns
        -------
        NavState
            Of shape ``(len(states), ...)``.

        Raises
        ------
        InvalidInputError
            If there is none, or shapes differ.
        """
        shapes = {state.shape for state in states}
        if len(shapes) != 1:
            raise InvalidInputError(f"states: expected one or more of equal shape, got {sorted(shapes)}")
        return cls._of(np.stack([state._numbers() for state in states]))

    @property
    def dcm(self) -> FloatArray:
        """Body from reference, (..., 3, 3)."""
        return dcm_from_quaternion(self.quaternion)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the batch, ``()`` for one state."""
        return self.position.shape[:-1]

    def inject(self, delta: ArrayLike) -> NavState:
        """State corrected by an error.

        Parameters
        ----------
        delta : (..., 9), (..., 12), (..., 15) or (..., 18)
            ``[dr dv da]``, with 12 also ``[dd]``, with 15 ``[db_a db_g]``, with 18 ``[db_a db_g dd]``.

        Returns
        -------
        NavState
            ``q (x) Exp(da)`` for the attitude, sums for the rest.

        Raises
        ------
        InvalidInputError
            On another size, or shapes that do not broadcast.
        """
        array = as_float64(delta, "delta")
        size = array.shape[-1] if array.ndim else 0
        if size not in _EXTRAS:
            raise InvalidInputError(f"delta: expected shape (..., 9), 12, 15 or 18, got {array.shape}")
        error = vectors(array, "delta", size)
        try:
            shape = np.broadcast_shapes(self.shape, error.shape[:-1])
        except ValueError as reason:
            raise InvalidInputError(
                f"delta: leading dimensions {error.shape[:-1]} do not broadcast with {self.shape}"
            ) from reason
        moved = np.empty((*shape, _NUMBERS))
        moved[...] = self._numbers()
        with np.errstate(over="ignore", invalid="ignore"):
            moved[..., :6] += error[..., :6]
            turned = _product(self.quaternion, _exp(error[..., 6:9]))
            moved[..., 6:10] = turned / np.linalg.norm(turned, axis=-1, keepdims=True)
            for k, name in enumerate(_EXTRAS[size], 3):
                moved[..., _COLUMNS[name]] += error[..., 3 * k : 3 * k + 3]
        return NavState._of(in_range(moved, "delta"))

    def minus(self, other: NavState, n: int = 15) -> FloatArray:
        """Error that leads from ``other`` to this: true minus estimate, if this is the truth.

        Parameters
        ----------
        other : NavState
            The estimate; shapes broadcast.
        n : int
            How much of it: 9 ``[dr dv da]``, 12 with ``[dd]``, 15 with ``[db_a db_g]``, 18 with
            ``[db_a db_g dd]``.

        Returns
        -------
        (..., n)
            The error; ``other.inject`` of it is this state in the parts it speaks of.

        Raises
        ------
        InvalidInputError
            On another ``n``, something that is no state, or shapes that do not broadcast.
        """
        if n not in _EXTRAS:
            raise InvalidInputError(f"n: expected 9, 12, 15 or 18, got {n!r}")
        if not isinstance(other, NavState):
            raise InvalidInputError(f"other: expected a NavState, got {type(other).__name__}")
        try:
            shape = np.broadcast_shapes(self.shape, other.shape)
        except ValueError as reason:
            raise InvalidInputError(
                f"other: shape {other.shape} does not broadcast with {self.shape}"
            ) from reason
        error = np.empty((*shape, n))
        for k, name in enumerate(("position", "velocity", None, *_EXTRAS[n])):
            columns = slice(3 * k, 3 * k + 3)
            if name is None:
                error[..., columns] = rotation_error(self.dcm, other.dcm)
            else:
                with np.errstate(over="ignore"):
                    error[..., columns] = getattr(self, name) - getattr(other, name)
        return in_range(error, "other")

    def __getitem__(self, index: Any) -> NavState:
        """States of the batch, as NumPy picks along its dimensions."""
        if not self.shape:
            raise TypeError("one NavState, not a batch, has no members")
        return NavState._of(self._numbers()[(*index, slice(None)) if isinstance(index, tuple) else index])

    def __len__(self) -> int:
        """States along the first dimension of the batch."""
        if not self.shape:
            raise TypeError("one NavState, not a batch, has no length")
        return self.shape[0]

    def __iter__(self) -> Iterator[NavState]:
        """States along the first dimension of the batch."""
        return (self[k] for k in range(len(self)))

    def __bool__(self) -> bool:
        """A state is something, one without members too."""
        return True

    def __repr__(self) -> str:
        if self.shape:
            return f"NavState of shape {self.shape}"
        shown = []
        for name, _ in _PARTS:
            value = getattr(self, name)
            if name in ("position", "velocity", "quaternion") or value.any():
                shown.append(f"{name}={value.tolist()}")
        return f"NavState({', '.join(shown)})"

    @classmethod
    def _of(cls, numbers: FloatArray) -> NavState:
        """State of ``(..., 19)`` numbers that are known to be right."""
        state, parts, start = object.__new__(cls), [], 0
        for _, size in _PARTS:
            parts.append(numbers[..., start : start + size])
            start += size
        parts[2] = _canonical(parts[2])
        state._hold([np.ascontiguousarray(part) for part in parts])
        return state

    def _numbers(self) -> FloatArray:
        """The state as the engine keeps it, ``(..., 19)``."""
        return np.concatenate([getattr(self, name) for name, _ in _PARTS], axis=-1)

    def _hold(self, parts: list[FloatArray]) -> None:
        for (name, _), part in zip(_PARTS, parts, strict=True):
            part.flags.writeable = False
            object.__setattr__(self, name, part)


def _canonical(q: FloatArray) -> FloatArray:
    """Of ``q`` and ``-q`` the one with ``w >= 0``; of half turns that whose first component is positive."""
    if (q[..., 3] > 0.0).all():
        return q
    turned = q[..., 3] < 0.0
    half = q[..., 3] == 0.0
    if half.any():
        first = np.take_along_axis(q, (q != 0.0).argmax(axis=-1)[..., np.newaxis], axis=-1)[..., 0]
        turned |= half & (first < 0.0)
    # Adding zero turns -0 into 0.
    return np.asarray(np.where(turned[..., np.newaxis], -q, q) + 0.0)


def _exp(turn: FloatArray) -> FloatArray:
    """``[sin(a/2) e, cos(a/2)]`` of a rotation vector ``a e``."""
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    return np.concatenate([0.5 * np.sinc(angle / (2 * np.pi)) * turn, np.cos(0.5 * angle)], axis=-1)


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Hamilton product, scalar last."""
    vector = p[..., 3:] * q[..., :3] + q[..., 3:] * p[..., :3] + np.cross(p[..., :3], q[..., :3])
    scalar = p[..., 3:] * q[..., 3:] - np.sum(p[..., :3] * q[..., :3], axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)

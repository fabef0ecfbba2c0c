"""The one place where arguments become arrays: float64, C order, known shape, finite.

Rust reads well-formed arrays directly and calls :func:`as_float64` only for the rest, so a list, an integer
array, a strided view or a byte-swapped array is welcome everywhere and costs one copy.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from losnav.errors import InvalidInputError

FloatArray: TypeAlias = npt.NDArray[np.float64]
ArrayLike: TypeAlias = npt.ArrayLike

# A direction may carry unnormalised isotropic noise (1e-3 rad and 5 sigma stay well inside); anything further
# off is not a direction but a mistake.
UNIT_TOLERANCE = 1e-2
# Orthonormality of a matrix a user calls a rotation: single precision input passes, a typing error does not.
ROTATION_TOLERANCE = 1e-5
# Asymmetry and negative eigenvalues of a covariance, relative to its largest entry.
COVARIANCE_TOLERANCE = 1e-9


def as_float64(value: Any, name: str) -> FloatArray:
    """Convert anything array-like of real numbers to float64 in C order, native byte order."""
    if isinstance(value, np.ma.MaskedArray):
        rule = "expected a plain array, got a masked array; fill or drop the masked entries"
        raise InvalidInputError(f"{name}: {rule}")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name}: expected an array of numbers, got {_describe(value)}") from error
    if array.dtype.kind not in "fiu":
        raise InvalidInputError(f"{name}: expected real numbers, got {_describe(value)}")
    with np.errstate(over="ignore"):
        converted = np.asarray(array, dtype=np.float64, order="C")
    # np.asarray keeps a subclass' memory; Rust wants the base class, contiguous and aligned.
    return np.require(converted, dtype=np.float64, requirements=["C", "A", "E"])


def _first(bad: npt.NDArray[np.bool_]) -> tuple[tuple[int, ...], str]:
    """Index of the first flag, and how the message writes it."""
    index = tuple(int(i) for i in np.argwhere(bad)[0])
    return index, str(list(index)) if index else ""


def _describe(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"an array of dtype {value.dtype}"
    text = repr(value)
    return f"{type(value).__name__} {text if len(text) <= 40 else text[:37] + '...'}"


def finite(value: Any, name: str) -> FloatArray:
    """Convert and refuse NaN and infinity, naming the first bad index."""
    array = as_float64(value, name)
    good = np.isfinite(array)
    if not good.all():
        index, where = _first(~good)
        raise InvalidInputError(f"{name}{where}: expected a finite number, got {array[index]}")
    return array


def vectors(value: Any, name: str, last: int = 3) -> FloatArray:
    """Finite ``(..., last)``."""
    array = finite(value, name)
    if array.ndim < 1 or array.shape[-1] != last:
        raise InvalidInputError(f"{name}: expected shape (..., {last}), got {array.shape}")
    return array


def matrices(value: Any, name: str, rows: int = 3, columns: int = 3) -> FloatArray:
    """Finite ``(..., rows, columns)``."""
    array = finite(value, name)
    if array.ndim < 2 or array.shape[-2:] != (rows, columns):
        raise InvalidInputError(f"{name}: expected shape (..., {rows}, {columns}), got {array.shape}")
    return array


def points(value: Any, name: str, minimum: int = 1) -> FloatArray:
    """Finite ``(N, 3)`` with at least ``minimum`` rows."""
    array = finite(value, name)
    if array.ndim != 2 or array.shape[-1] != 3:
        raise InvalidInputError(f"{name}: expected shape (N, 3), got {array.shape}")
    if len(array) < minimum:
        raise InvalidInputError(f"{name}: expected at least {minimum} rows, got {len(array)}")
    return array


def units(value: Any, name: str, tolerance: float = UNIT_TOLERANCE) -> FloatArray:
    """Finite ``(..., 3)`` of unit length within tolerance; returned as given."""
    array = vectors(value, name)
    with np.errstate(over="ignore", under="ignore"):
        norm = np.linalg.norm(array, axis=-1)
    bad = ~(np.abs(norm - 1.0) <= tolerance)
    if bad.any():
        index, where = _first(bad)
        rule = f"expected a unit vector (tolerance {tolerance:g})"
        raise InvalidInputError(f"{name}{where}: {rule}, got norm {norm[index]:.6g}")
    return array


def quaternions(value: Any, name: str) -> FloatArray:
    """Finite ``(..., 4)`` of unit length within :data:`UNIT_TOLERANCE`; returned with unit length."""
    array = vectors(value, name, 4)
    with np.errstate(over="ignore", under="ignore"):
        norm = np.linalg.norm(array, axis=-1)
    bad = ~(np.abs(norm - 1.0) <= UNIT_TOLERANCE)
    if bad.any():
        index, where = _first(bad)
        rule = f"expected a unit quaternion [x, y, z, w] (tolerance {UNIT_TOLERANCE:g})"
        raise InvalidInputError(f"{name}{where}: {rule}, got norm {norm[index]:.6g}")
    return np.asarray(array / norm[..., np.newaxis])


def rotations(value: Any, name: str) -> FloatArray:
    """Finite ``(..., 3, 3)``, orthonormal, determinant +1."""
    array = matrices(value, name)
    with np.errstate(all="ignore"):
        error = np.abs(array @ np.swapaxes(array, -1, -2) - np.eye(3)).max(axis=(-2, -1))
        bad = ~(error <= ROTATION_TOLERANCE) | (np.linalg.det(array) < 0.0)
    if bad.any():
        index, where = _first(bad)
        raise InvalidInputError(
            f"{name}{where}: expected a rotation matrix (orthonormal within {ROTATION_TOLERANCE:g}, "
            f"determinant +1), got max|R Rᵀ - I| = {float(error[index]):.3g}"
        )
    return array


def broadcast(*named: tuple[str, FloatArray, int]) -> tuple[tuple[int, ...], list[FloatArray]]:
    """Broadcast leading dimensions: ``(name, array, core dimensions)`` to ``(batch shape, flat arrays)``.

    Every returned array is ``(batch, *core)`` in C order.
    """
    leads = [array.shape[: array.ndim - core] for _, array, core in named]
    try:
        shape = np.broadcast_shapes(*leads)
    except ValueError as error:
        listing = ", ".join(f"{name} {lead}" for (name, _, _), lead in zip(named, leads, strict=True))
        raise InvalidInputError(f"leading dimensions do not broadcast: {listing}") from error
    size = int(np.prod(shape, dtype=np.int64))
    flat = []
    for _, array, core in named:
        tail = array.shape[array.ndim - core :]
        flat.append(np.ascontiguousarray(np.broadcast_to(array, shape + tail)).reshape((size, *tail)))
    return shape, flat


def together(*named: tuple[str, Any, int]) -> list[FloatArray]:
    """Broadcast leading dimensions of ``(name, value, core dimensions)``, keeping them in the result."""
    arrays = [(name, as_float64(value, name), core) for name, value, core in named]
    shape, flat = broadcast(*arrays)
    return [array.reshape((*shape, *array.shape[1:])) for array in flat]


def positive(value: Any, name: str) -> FloatArray:
    """Finite and greater than zero, any shape."""
    array = finite(value, name)
    bad = ~(array > 0.0)
    if bad.any():
        index, where = _first(bad)
        raise InvalidInputError(f"{name}{where}: expected a positive number, got {array[index]}")
    return array


def covariances(value: Any, name: str, size: int = 3) -> FloatArray:
    """Finite ``(..., size, size)``, symmetric, no negative eigenvalue."""
    array = matrices(value, name, size, size)
    # Only ratios are judged; of order one they neither overflow nor underflow.
    largest = np.abs(array).max(axis=(-2, -1), keepdims=True)
    unit = array / np.where(largest > 0.0, largest, 1.0)
    skewed = np.abs(unit - np.swapaxes(unit, -1, -2)).max(axis=(-2, -1))
    bad = (skewed > COVARIANCE_TOLERANCE) | (np.linalg.eigvalsh(unit)[..., 0] < -COVARIANCE_TOLERANCE)
    if bad.any():
        _, where = _first(bad)
        raise InvalidInputError(f"{name}{where}: expected a symmetric positive semidefinite matrix")
    return array


def in_range(result: FloatArray, names: str) -> FloatArray:
    """The result, if it is finite: valid arguments may still be too large for it."""
    if not np.isfinite(result).all():
        raise InvalidInputError(f"{names}: too large, the result is not a finite number")
    return result


def indices(value: Any, name: str, size: int) -> npt.NDArray[np.int64]:
    """Triples ``(F, 3)`` of whole numbers from 0 to ``size - 1``."""
    array = np.asarray(value)
    if array.dtype.kind not in "iu" or array.ndim != 2 or array.shape[-1] != 3 or not array.size:
        raise InvalidInputError(
            f"{name}: expected whole numbers of shape (F, 3), got {array.dtype} of {array.shape}"
        )
    bad = (array < 0) | (array >= size)
    if bad.any():
        index, where = _first(bad)
        raise InvalidInputError(f"{name}{where}: expected an index from 0 to {size - 1}, got {array[index]}")
    return array.astype(np.int64)


def hold_numbers(model: object, *, positive: Sequence[str] = (), at_least_zero: Sequence[str] = ()) -> None:
    """Check the fields of a frozen model that are numbers, and hold them as floats."""
    for name in (*positive, *at_least_zero):
        value = finite(getattr(model, name), name)
        strict = name in positive
        if value.ndim or value < 0.0 or (strict and value == 0.0):
            rule = "a number > 0" if strict else "a number >= 0"
            raise InvalidInputError(f"{name}: expected {rule}, got {getattr(model, name)!r}")
        object.__setattr__(model, name, float(value))

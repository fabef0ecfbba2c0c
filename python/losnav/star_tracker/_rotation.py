"""Small rotations and directions as arrays: what every part of the package needs of geometry."""

from __future__ import annotations

import numpy as np

from losnav._arrays import FloatArray
from losnav.errors import InvalidInputError


def unit(array: FloatArray) -> FloatArray:
    """Vectors ``(..., 3)`` brought to unit length."""
    return np.asarray(array / np.linalg.norm(array, axis=-1, keepdims=True))


def cross_matrices(vectors: FloatArray) -> FloatArray:
    """``[v x]`` of ``(..., 3)``."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)


def rotation_matrices(turns: FloatArray) -> FloatArray:
    """``exp(-[v x])`` of ``(..., 3)``, rad: components after turning the axes by ``v``."""
    angle = np.linalg.norm(turns, axis=-1)[..., np.newaxis, np.newaxis]
    cross = cross_matrices(turns)
    # sin(a)/a and (1 - cos a)/a^2, the latter without cancellation.
    half = np.sinc(angle / (2 * np.pi))
    return np.asarray(np.eye(3) - np.sinc(angle / np.pi) * cross + 0.5 * half**2 * (cross @ cross))


def mounting_of(boresight: FloatArray) -> FloatArray:
    """Rotation from head to fusion axes that takes +z to ``(..., 3)`` the short way."""
    norm = np.linalg.norm(boresight, axis=-1, keepdims=True)
    if not (norm > 0.0).all():
        raise InvalidInputError("boresight: expected a vector that is not zero")
    x, y, z = np.moveaxis(boresight / norm, -1, 0)
    across = x * x + y * y
    # Straight back there is no short way: half a turn about x.
    back = (z < 0.0) & (across == 0.0)
    # 1 / (1 + z), without cancellation behind.
    s = np.where(z < 0.0, (1.0 - z) / np.where(across > 0.0, across, 1.0), 1.0 / np.maximum(1.0 + z, 1.0))
    rows = [
        np.stack([1.0 - s * x * x, -s * x * y, x], axis=-1),
        np.stack([-s * x * y, 1.0 - s * y * y, y], axis=-1),
        np.stack([-x, -y, z], axis=-1),
    ]
    turned = np.stack(rows, axis=-2)
    return np.asarray(np.where(back[..., np.newaxis, np.newaxis], np.diag([1.0, -1.0, -1.0]), turned))

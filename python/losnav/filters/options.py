"""Options of the filters, checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, covariances, finite
from losnav.consistency.chi_square import chi2_quantile
from losnav.errors import InvalidInputError


class Bound:
    """The bound of a gate on the normalised innovation squared, by degrees of freedom."""

    def __init__(self, gate: float) -> None:
        self.gate = gate

    def __call__(self, dof: int) -> float:
        return self.gate if self.gate >= 1.0 else float(chi2_quantile(self.gate, dof))


def checked(given: dict[str, Any], size: int) -> dict[str, Any]:
    """What every Kalman filter is told, for an error of a size."""
    return {
        "gate": _gate(given["gate"]),
        "relock_after": whole(given["relock_after"], "relock_after", optional=True),
        "iterations": whole(given["iterations"], "iterations"),
        "underweighting": _not_negative(given["underweighting"], "underweighting"),
        "form": given["form"],
        "consider": _components(given["consider"], size),
    }


def definite(value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """A symmetric positive definite covariance of states of a shape, with their leading dimensions."""
    size = shape[-1]
    p = covariances(value, "covariance", size)
    if p.shape[:-2] not in ((), shape[:-1]):
        raise InvalidInputError(
            f"covariance: expected shape {(size, size)} or {(*shape, size)} like the state, got {p.shape}"
        )
    scale = np.sqrt(np.diagonal(p, axis1=-2, axis2=-1))
    if not (scale > 0.0).all():
        raise InvalidInputError("covariance: expected positive variances on the diagonal")
    unit = p / (scale[..., :, np.newaxis] * scale[..., np.newaxis, :])
    try:
        np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        raise InvalidInputError("covariance: expected a positive definite matrix") from None
    return np.ascontiguousarray(np.broadcast_to(p, (*shape, size)))


def _gate(gate: Any) -> float | None:
    """A probability below 1, a bound from 1 on, or none."""
    if gate is None:
        return None
    value = finite(gate, "gate")
    if value.ndim or value <= 0.0:
        raise InvalidInputError(
            f"gate: expected a probability below 1 or a bound on the NIS from 1 on, got {gate!r}"
        )
    return float(value)


def whole(value: Any, name: str, optional: bool = False) -> int | None:
    """An integer from 1 on."""
    if value is None and optional:
        return None
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 1:
        expected = "an integer >= 1 or None" if optional else "an integer >= 1"
        raise InvalidInputError(f"{name}: expected {expected}, got {value!r}")
    return int(value)


def _not_negative(value: Any, name: str) -> float:
    """A finite number from 0 on."""
    number = finite(value, name)
    if number.ndim or number < 0.0:
        raise InvalidInputError(f"{name}: expected a number >= 0, got {value!r}")
    return float(number)


def _components(consider: Sequence[int], size: int) -> list[int]:
    """Indices of components, in order."""
    indices = []
    for index in consider:
        if isinstance(index, bool) or not isinstance(index, (int, np.integer)) or not 0 <= index < size:
            raise InvalidInputError(f"consider: expected indices from 0 to {size - 1}, got {index!r}")
        indices.append(int(index))
    return sorted(set(indices))


def pairs_of(measurements: Any) -> list[tuple[Any, npt.ArrayLike]]:
    """Sensors with what they measured."""
    try:
        pairs = [(sensor, z) for sensor, z in measurements]
    except (TypeError, ValueError):
        raise InvalidInputError(
            f"measurements: expected a sequence of pairs (sensor, z), got {type(measurements).__name__}"
        ) from None
    return pairs

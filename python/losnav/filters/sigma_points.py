"""Sigma points, what is summed over them, and what they leave behind of an arc."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from losnav._arrays import FloatArray, as_float64
from losnav.errors import NumericalError
from losnav.filters.log import FilterLog

__all__ = [
    "Crossing",
    "UnscentedStep",
    "congruence",
    "logged",
    "moment",
    "one_by_one",
    "right_divide",
    "sigma_points",
    "symmetrised",
]


@dataclass(frozen=True, eq=False)
class UnscentedStep:
    """What one update did.

    Attributes
    ----------
    innovation : (..., M) array
        Measured minus expected, angles wrapped; NaN where there was no measurement.
    innovation_covariance : (..., M, M) array
        Its covariance.
    nis : (...) array
        Normalised innovation squared.
    dof : int
        Its degrees of freedom.
    accepted : (...) bool array
        Whether the measurement was used.
    gain : (..., N, M) array
        From the innovation to the correction; zero where it was not used.
    """

    innovation: FloatArray
    innovation_covariance: FloatArray
    nis: FloatArray
    dof: int
    accepted: np.ndarray[Any, np.dtype[np.bool_]]
    gain: FloatArray


def sigma_points(state: FloatArray, covariance: FloatArray, reach: float) -> FloatArray:
    """(..., 2 N + 1, N): the estimate, and ``reach`` columns of the covariance's Cholesky factor off it."""
    n = state.shape[-1]
    deviation = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    with np.errstate(invalid="ignore", divide="ignore"):
        scaled = covariance / (deviation[..., :, np.newaxis] * deviation[..., np.newaxis, :])
    try:
        root = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        raise NumericalError("covariance: no longer positive definite") from None
    # Columns of the factor, as rows.
    step = reach * np.swapaxes(root * deviation[..., :, np.newaxis], -1, -2)
    points = np.concatenate([np.zeros((*step.shape[:-2], 1, n)), step, -step], axis=-2)
    points = points + state[..., np.newaxis, :]
    if not np.isfinite(points).all():
        raise NumericalError("covariance: no longer positive definite")
    return points


def moment(weights: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """Weighted sum of ``a b'`` over the points."""
    return np.asarray(np.swapaxes(a, -1, -2) @ (weights[:, np.newaxis] * b))


def one_by_one(function: Callable[[Any, Any], Any], x: FloatArray, other: FloatArray | None) -> FloatArray:
    lead = x.shape[:-1]
    flat = x.reshape(-1, x.shape[-1])
    beside = [None] * len(flat)
    if other is not None:
        beside = list(np.broadcast_to(other, (*lead, other.shape[-1])).reshape(-1, other.shape[-1]))
    results = [as_float64(function(a.copy(), b), "model") for a, b in zip(flat, beside, strict=True)]
    return np.stack(results).reshape((*lead, *results[0].shape)) if results else x


def symmetrised(p: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (p + np.swapaxes(p, -1, -2)))


def congruence(a: FloatArray, p: FloatArray) -> FloatArray:
    return np.asarray(a @ p @ np.swapaxes(a, -1, -2))


def right_divide(a: FloatArray, p: FloatArray) -> FloatArray:
    """a p^-1, p symmetric."""
    return np.swapaxes(np.linalg.solve(p, np.swapaxes(a, -1, -2)), -1, -2)


@dataclass(frozen=True, eq=False)
class Crossing:
    """How sigma points travelled an arc: predictions, their covariances, what each step carried over."""

    state: FloatArray
    covariance: FloatArray
    cross: FloatArray

    def back(
        self, time: FloatArray, state: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Unscented Rauch-Tung-Striebel smoother (Särkkä, IEEE Trans. Automatic Control 53(3), 2008).

        The gain is the covariance of the state before a step with that after it, times the inverse of the
        latter's.
        """
        x, p = state.copy(), covariance.copy()
        for k in reversed(range(time.size - 1)):
            ahead = self.covariance[..., k + 1, :, :]
            gain = right_divide(self.cross[..., k + 1, :, :], ahead)
            step = x[..., k + 1, :] - self.state[..., k + 1, :]
            x[..., k, :] += np.einsum("...ij,...j->...i", gain, step)
            p[..., k, :, :] += congruence(gain, p[..., k + 1, :, :] - ahead)
        return x, symmetrised(p)


def logged(
    times: FloatArray,
    estimates: list[tuple[FloatArray, FloatArray]],
    predictions: list[tuple[FloatArray, FloatArray, FloatArray]],
    steps: list[list[UnscentedStep]],
) -> FilterLog:
    """A log in which epochs come after runs."""
    runs = estimates[0][0].shape[:-1]

    def over_sensors(name: str, kind: type) -> Any:
        values: Any = np.array([[getattr(each, name) for each in row] for row in steps], dtype=kind)
        return np.moveaxis(values.reshape((times.size, -1, *runs)), (0, 1), (-2, -1))

    x, p = (list(column) for column in zip(*estimates, strict=True))
    moved, ahead, cross = (list(column) for column in zip(*predictions, strict=True))
    rows = [each.innovation.shape[-1] for each in steps[0]]
    innovations = [np.concatenate([each.innovation for each in row], axis=-1) for row in steps if row]
    arrays = {
        "state": np.stack(x, axis=-2),
        "covariance": np.stack(p, axis=-3),
        "nis": over_sensors("nis", float),
        "accepted": over_sensors("accepted", bool),
        "innovation": np.stack(innovations, axis=-2) if rows else np.zeros((*runs, times.size, 0)),
    }
    journey = Crossing(np.stack(moved, axis=-2), np.stack(ahead, axis=-3), np.stack(cross, axis=-3))
    return FilterLog(times.copy(), rows, [each.dof for each in steps[0]], arrays, journey)

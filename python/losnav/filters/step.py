"""What one update did."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from losnav._arrays import FloatArray
from losnav._core import Step
from losnav.sensors.listed import is_listed

__all__ = ["Step", "linear_update", "told_to", "with_time", "within_blocks"]

# Context that concerns some of the library's sensors and not others; the attitude concerns all.
OF_SOME_SENSORS = ("landmarks", "target", "time")


def linear_update(  # noqa: PLR0917 - the engine calls it by position
    sensor: Any,
    context: dict[str, Any],
    state: FloatArray,
    covariance: FloatArray,
    underweighting: float,
    consider: Sequence[int],
) -> tuple[FloatArray, FloatArray]:
    """Innovation covariance and gain of an update linearised at its prior.

    Parameters
    ----------
    sensor, context
        The sensor, and what it was told.
    state : (N,)
        Before the update.
    covariance : (N, N)
        Of its error.
    underweighting : float
        Lear's factor.
    consider : sequence of int
        Components that are not corrected.

    Returns
    -------
    innovation_covariance : (M, M)
        ``S = H P H' + R``.
    gain : (N, M)
        ``P H' (S + beta H P H')^-1``, zero for considered components; of several directions, ``beta H P H'``
        of each by itself.
    """
    told = told_to(sensor, context)
    h = _of_size(np.asarray(sensor.jacobian(state, **told), dtype=float), len(covariance))
    r = np.asarray(sensor.noise(state, **told), dtype=float)
    spread = h @ covariance @ h.T
    innovation_covariance = spread + r
    weighed = innovation_covariance + underweighting * within_blocks(sensor, spread)
    gain = np.linalg.solve(weighed, h @ covariance).T
    gain[list(consider)] = 0.0
    return innovation_covariance, gain


def _of_size(jacobian: FloatArray, size: int) -> FloatArray:
    """Columns of the errors that the filter has: what is not seen is zero."""
    missing = max(0, size - jacobian.shape[-1])
    return np.pad(jacobian, ((0, 0), (0, missing)))[:, :size]


def told_to(sensor: Any, context: dict[str, Any]) -> dict[str, Any]:
    """What of the context concerns a sensor: landmarks those that have some, a target those of a target."""
    if not is_listed(sensor):
        return context
    return {
        name: value for name, value in context.items() if name in sensor.told or name not in OF_SOME_SENSORS
    }


def with_time(sensor: Any, context: dict[str, Any], time: float) -> dict[str, Any]:
    """What a sensor is told, the time of the measurement included if it has ``time_varying = True``."""
    return {**context, "time": time} if getattr(sensor, "time_varying", False) is True else context


def within_blocks(sensor: Any, spread: FloatArray) -> FloatArray:
    """What rows share with those of their own landmark, or beam; rows of a user's sensor are one block."""
    size = sensor.block if is_listed(sensor) and sensor.block else len(spread)
    return np.asarray(spread * np.kron(np.eye(len(spread) // size), np.ones((size, size))))

"""Going back over an arc with any model, built in or the user's own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from losnav._arrays import FloatArray

__all__ = ["Journey", "Travelled", "started"]


def started(dynamics: Any, time: float) -> dict[str, float]:
    """What a model that changes with time is told of a step, as keyword arguments."""
    return {"time": time} if getattr(dynamics, "time_varying", False) else {}


class Travelled(Protocol):
    """An arc that can be gone back over."""

    def back(
        self, time: FloatArray, state: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Smoothed states and covariances of the filtered ones."""


@dataclass(frozen=True, eq=False)
class Journey:
    """How an arc was travelled: the model and its controls, ``(3,)``, ``(T, 3)`` or ``(runs, T, 3)``."""

    dynamics: Any
    controls: FloatArray | None

    def control(self, run: int, epoch: int) -> FloatArray | None:
        """What acted over the step that ends at ``epoch``."""
        if self.controls is None:
            return None
        if self.controls.ndim == 1:
            return self.controls
        return np.asarray(self.controls[epoch] if self.controls.ndim == 2 else self.controls[run, epoch])

    def back(
        self, time: FloatArray, state: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Smoothed states and covariances (Rauch, Tung & Striebel 1965)."""
        x, p = state.copy(), covariance.copy()
        for run in np.ndindex(state.shape[:-2]):
            for k in reversed(range(len(time) - 1)):
                dt = float(time[k + 1] - time[k])
                u = self.control(run[0] if run else 0, k + 1)
                when = started(self.dynamics, float(time[k]))
                phi = np.asarray(self.dynamics.transition(state[run][k], dt, u, **when))
                ahead = np.asarray(self.dynamics.propagate(state[run][k], dt, u, **when))
                before = phi @ covariance[run][k] @ phi.T
                before += np.asarray(self.dynamics.process_noise(state[run][k], dt, **when))
                try:
                    np.linalg.cholesky(before)
                except np.linalg.LinAlgError:
                    continue
                gain = np.linalg.solve(before, phi @ covariance[run][k]).T
                x[run][k] += gain @ (x[run][k + 1] - ahead)
                p[run][k] += gain @ (p[run][k + 1] - before) @ gain.T
                p[run][k] = 0.5 * (p[run][k] + p[run][k].T)
        return x, p

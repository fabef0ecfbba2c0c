"""What a filter on inertial navigation leaves behind of an arc."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav._arrays import FloatArray
from losnav.filters.log import FilterLog
from losnav.navigation_state import NavState

__all__ = ["Flown", "InertialLog"]


class InertialLog(FilterLog):
    """As :class:`losnav.filters.FilterLog`, its state a :class:`losnav.NavState` of shape ``(..., T)``.

    Attributes
    ----------
    state : NavState of shape (..., T)
        States.
    covariance : (..., T, n, n) array
        Covariances of ``[dr dv da]``, then biases and acceleration as the dynamics has them.
    used : (..., T, M) bool array
        Which numbers of the measurements were taken: a landmark that is not was not seen, or rejected.
    dof : (..., T, sensors) array
        Degrees of freedom of ``nis``, which depend on how many landmarks were taken.
    model_error : (..., T, 3) array
        What a predictive filter found the model to lack, site axes, m/s^2.
    """

    __slots__ = ()

    @property
    def state(self) -> NavState:  # type: ignore[override]
        return NavState._of(self._array("state"))

    @property
    def used(self) -> npt.NDArray[np.bool_]:
        return self._array("used")

    @property
    def model_error(self) -> FloatArray:
        return self._array("model_error")

    def smooth(self) -> InertialLog:
        numbers, covariance = self._journey.back(self.time, self._array("state"), self.covariance)
        arrays = {**self._arrays, "state": numbers, "covariance": covariance}
        return InertialLog(self.time, self._rows, self.dof, arrays, self._journey)

    def __repr__(self) -> str:
        lead = self._array("state").shape[:-1]
        runs = "one arc" if len(lead) == 1 else f"{lead[0]} arcs"
        used, seen = int(self.accepted.sum()), int(np.isfinite(self.nis).sum())
        size = self.covariance.shape[-1]
        return f"InertialLog({runs}, {lead[-1]} epochs, {size} errors, {used} of {seen} measurements used)"

    def __reduce__(self) -> tuple[Any, ...]:
        return InertialLog, (self.time, self._rows, self.dof, self._arrays, self._journey)


@dataclass(frozen=True, eq=False)
class Flown:
    """How an arc was flown: the model, what its unit showed and in how many steps from epoch to epoch."""

    dynamics: Any
    controls: FloatArray | None
    substeps: int

    def control(self, run: tuple[int, ...], step: int) -> FloatArray:
        """What the unit showed over a step."""
        if self.controls is None:
            return np.zeros(6)
        u = self.controls
        return np.asarray(u if u.ndim == 1 else u[step] if u.ndim == 2 else u[run][step])

    def back(
        self, time: FloatArray, state: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Smoothed states (numbers) and covariances (Rauch, Tung & Striebel 1965)."""
        x, p = state.copy(), covariance.copy()
        size = covariance.shape[-1]
        for run in np.ndindex(state.shape[:-2]):
            for k in reversed(range(len(time) - 1)):
                dt = float(time[k + 1] - time[k])
                if dt == 0.0:
                    x[run][k], p[run][k] = x[run][k + 1], p[run][k + 1]
                    continue
                filtered = NavState._of(state[run][k])
                ahead, phi, before = self._ahead(filtered, covariance[run][k], dt, run, k + 1)
                gain = np.linalg.solve(before, phi @ covariance[run][k]).T
                error = NavState._of(x[run][k + 1]).minus(ahead, size)
                x[run][k] = filtered.inject(gain @ error)._numbers()
                p[run][k] += gain @ (p[run][k + 1] - before) @ gain.T
                p[run][k] = 0.5 * (p[run][k] + p[run][k].T)
        return x, p

    def _ahead(
        self, state: NavState, covariance: FloatArray, dt: float, run: tuple[int, ...], epoch: int
    ) -> tuple[NavState, FloatArray, FloatArray]:
        """State, transition and covariance at an epoch from those at the one before."""
        phi, before = np.eye(len(covariance)), covariance
        h = dt / self.substeps
        for step in range(epoch * self.substeps, (epoch + 1) * self.substeps):
            u = self.control(run, step)
            part = self.dynamics.transition(state, h, u)
            before = part @ before @ part.T + self.dynamics.process_noise(state, h)
            phi = part @ phi
            state = self.dynamics.propagate(state, h, u)
        return state, phi, before

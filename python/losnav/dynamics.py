"""How a state moves: propagation, state transition and process noise of the built-in models.

A model is a small frozen object; anything with ``propagate``, ``transition`` and ``process_noise`` of the
same signatures can stand in its place. States, time steps and controls broadcast over leading dimensions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, broadcast, finite, in_range, vectors
from losnav.errors import InvalidInputError

__all__ = ["ClohessyWiltshire"]


class _Listed:
    """What every built-in model does the same way: check, broadcast, ask the engine."""

    state_size: ClassVar[int]

    def propagate(self, state: ArrayLike, dt: ArrayLike, control: ArrayLike | None = None) -> FloatArray:
        """State after ``dt``.

        Parameters
        ----------
        state : (..., N)
            Start; see the class for its components.
        dt : scalar or (...)
            Time step, s; negative goes back in time.
        control : (3,) or (..., 3), optional
            Acceleration held over the step, m/s^2, in the axes of the state; none if absent.

        Returns
        -------
        (..., N)
            State at the end.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._ask(_core.dynamics_propagate, 0, state, dt, control)

    def transition(self, state: ArrayLike, dt: ArrayLike, control: ArrayLike | None = None) -> FloatArray:
        """State transition matrix ``Phi``, the derivative of :meth:`propagate` with respect to the state.

        Parameters
        ----------
        state, dt, control
            As for :meth:`propagate`.

        Returns
        -------
        (..., N, N)
            ``Phi``.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._ask(_core.dynamics_transition, 1, state, dt, control)

    def process_noise(self, state: ArrayLike, dt: ArrayLike) -> FloatArray:
        """Covariance ``Q`` that the disturbing acceleration adds over ``|dt|``.

        Parameters
        ----------
        state, dt
            As for :meth:`propagate`.

        Returns
        -------
        (..., N, N)
            ``Q``, symmetric positive semidefinite.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._ask(_core.dynamics_process_noise, 2, state, dt, None)

    def trajectory(self, state: ArrayLike, times: ArrayLike, control: ArrayLike | None = None) -> FloatArray:
        """States at ``times``, the given state being that of ``times[0]``.

        Parameters
        ----------
        state : (..., N)
            State at ``times[0]``.
        times : (T,)
            Epochs, s; equal or decreasing ones are welcome.
        control : (3,) or (..., T - 1, 3), optional
            Acceleration, m/s^2: one for the whole arc, or one for each step from ``times[k]`` to ``times[k +
            1]``.

        Returns
        -------
        (..., T, N)
            States; the first is the given one.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        x, epochs = vectors(state, "state", self.state_size), finite(times, "times")
        if epochs.ndim != 1 or not epochs.size:
            raise InvalidInputError(f"times: expected shape (T,) with T >= 1, got {epochs.shape}")
        steps = epochs.size - 1
        u = np.zeros(3) if control is None else vectors(control, "control")
        if u.ndim == 1:
            u = np.broadcast_to(u, (steps, 3))
        if u.shape[-2] != steps:
            raise InvalidInputError(
                f"control: expected shape (3,) or (..., {steps}, 3), one for each step, got {u.shape}"
            )
        shape, (x, u) = broadcast(("state", x, 1), ("control", u, 2))
        states = _core.dynamics_trajectory(
            type(self).__name__, self._parameters(), x, u.reshape(-1, 3), np.diff(epochs)
        )
        in_range(states, "state, times or control")
        return np.asarray(states).reshape((*shape, epochs.size, self.state_size))

    def _parameters(self) -> list[float]:
        raise NotImplementedError

    def _ask(
        self,
        question: Callable[[str, Sequence[float], FloatArray, FloatArray, FloatArray], FloatArray],
        number: int,
        state: ArrayLike,
        dt: ArrayLike,
        control: ArrayLike | None,
    ) -> FloatArray:
        name, parameters = type(self).__name__, self._parameters()
        single = _core.dynamics_single(name, parameters, number, state, control, dt)
        if single is not None:
            return single
        x, step = vectors(state, "state", self.state_size), finite(dt, "dt")
        u = np.zeros(3) if control is None else vectors(control, "control")
        shape, (x, step, u) = broadcast(("state", x, 1), ("dt", step, 0), ("control", u, 1))
        answer = question(name, parameters, x, u, step)
        in_range(answer, "state, dt or control")
        return np.asarray(answer).reshape((*shape, *((2 if number else 1) * (self.state_size,))))


@dataclass(frozen=True)
class ClohessyWiltshire(_Listed):
    """Motion relative to a target on a circular orbit (Clohessy & Wiltshire 1960).

    State ``[r v]``, ``(..., 6)``: chaser minus target, m and m/s, in the target's orbital frame (x along
    track, y along the negative orbit normal, z to nadir), velocity as seen in that rotating frame. Exact for
    ``x'' - 2 w z' = a_x``, ``y'' + w^2 y = a_y``, ``z'' + 2 w x' - 3 w^2 z = a_z`` with the control held over
    the step; the process noise is exact for white acceleration, the coupling of x and z included. Left out:
    eccentricity, the curvature of the orbit (0.1 m at 1.2 km), J2 (a few metres an orbit).

    Parameters
    ----------
    mean_motion : float
        ``w = sqrt(mu / a^3)`` of the target, rad/s; zero is free space.
    acceleration_psd : float
        Spectral density of the disturbing acceleration on each axis, m^2/s^3.

    Raises
    ------
    InvalidInputError
        If a parameter is negative or not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.04248275e-3, acceleration_psd=1e-9)
    >>> closed = [0.0, 0.0, 100.0, 2 * 1.04248275e-3 * 100.0, 0.0, 0.0]  # vx = 2 w z: bounded motion
    >>> period = 2 * np.pi / orbit.mean_motion
    >>> orbit.propagate(closed, period).round(6) + 0.0
    array([  0.      ,   0.      , 100.      ,   0.208497,   0.      ,
             0.      ])
    """

    mean_motion: float
    acceleration_psd: float = 0.0

    state_size: ClassVar[int] = 6

    def __post_init__(self) -> None:
        for name in ("mean_motion", "acceleration_psd"):
            value = finite(getattr(self, name), name)
            if value.ndim or value < 0.0:
                raise InvalidInputError(f"{name}: expected a number >= 0, got {getattr(self, name)!r}")
            object.__setattr__(self, name, float(value))

    def _parameters(self) -> list[float]:
        return [self.mean_motion, self.acceleration_psd]

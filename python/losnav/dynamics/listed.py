"""What every built-in model does the same way: check, broadcast, ask the engine."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, broadcast, finite, hold_numbers, in_range, vectors
from losnav.errors import InvalidInputError

__all__ = ["Listed", "hold_numbers"]

# In the order the engine numbers them for single states.
_QUESTIONS = (_core.dynamics_propagate, _core.dynamics_transition, _core.dynamics_process_noise)


class Listed:
    """The engine's side of a model."""

    state_size: ClassVar[int] = 6
    # Do steps depend on when they start?
    time_varying: ClassVar[bool] = False
    # What the engine calls the model.
    _built_in: ClassVar[str]

    def __init_subclass__(cls) -> None:
        # A user's subclass goes by the name of the model it extends.
        if cls.__module__.startswith("losnav."):
            cls._built_in = cls.__name__

    def propagate(
        self, state: ArrayLike, dt: ArrayLike, control: ArrayLike | None = None, *, time: ArrayLike = 0.0
    ) -> FloatArray:
        """State after ``dt``.

        Parameters
        ----------
        state : (..., N)
            Start; see the class for its components.
        dt : scalar or (...)
            Time step, s; negative goes back in time.
        control : (3,) or (..., 3), optional
            Acceleration held over the step, m/s^2, in the axes of the state; none if absent.
        time : scalar or (...), optional
            When the step starts, s; only models that change with time look at it.

        Returns
        -------
        (..., N)
            State at the end.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN or infinity.
        """
        return self._ask(0, state, dt, control, time)

    def transition(
        self, state: ArrayLike, dt: ArrayLike, control: ArrayLike | None = None, *, time: ArrayLike = 0.0
    ) -> FloatArray:
        """State transition matrix ``Phi``, the derivative of :meth:`propagate` with respect to the state.

        Parameters
        ----------
        state, dt, control, time
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
        return self._ask(1, state, dt, control, time)

    def process_noise(self, state: ArrayLike, dt: ArrayLike, *, time: ArrayLike = 0.0) -> FloatArray:
        """Covariance ``Q`` that the disturbing acceleration adds over ``|dt|``.

        Parameters
        ----------
        state, dt, time
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
        return self._ask(2, state, dt, None, time)

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
        self._check_span(epochs.min(), epochs.max(), "times")
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
            self._engine_name, self._parameters(), x, u.reshape(-1, 3), np.diff(epochs), epochs[:1]
        )
        in_range(states, "state, times or control")
        return np.asarray(states).reshape((*shape, epochs.size, self.state_size))

    @property
    def _engine_name(self) -> str:
        """What the engine calls the model."""
        return self._built_in

    def _parameters(self) -> list[float] | FloatArray:
        """Numbers the engine makes the model of: a list of a few, or an array of many."""
        raise NotImplementedError

    def _check_span(self, start: FloatArray, end: FloatArray, name: str) -> None:
        """Refuse times the model knows nothing of."""

    def _ask(
        self,
        number: int,
        state: ArrayLike,
        dt: ArrayLike,
        control: ArrayLike | None,
        time: ArrayLike,
    ) -> FloatArray:
        name, parameters = self._engine_name, self._parameters()
        single = _core.dynamics_single(name, parameters, number, state, control, dt, time)
        if single is not None:
            return single
        x, step = vectors(state, "state", self.state_size), finite(dt, "dt")
        start = finite(time, "time")
        self._check_span(start, start + step, "time")
        u = np.zeros(3) if control is None else vectors(control, "control")
        shape, (x, step, u, start) = broadcast(
            ("state", x, 1), ("dt", step, 0), ("control", u, 1), ("time", start, 0)
        )
        answer = _QUESTIONS[number](name, parameters, x, u, step, start)
        in_range(answer, "state, dt or control")
        return np.asarray(answer).reshape((*shape, *((2 if number else 1) * (self.state_size,))))

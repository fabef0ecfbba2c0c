"""Commanded acceleration of a descent.

    a = 12 (r_f - r)/t_go^2 - 6 (v_f + v)/t_go + a_f,    t_go = t_f - t        (Apollo polynomial)

The fourth-degree polynomial in time that meets position, velocity and acceleration at ``t_f``. Source: A. R.
Klumpp, "Apollo lunar descent guidance", Automatica 10(2), 1974. Left out: limits of the thrust, the command
delay of the original, and terrain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, positive, vectors
from losnav.errors import InvalidInputError

__all__ = ["ApolloGuidance", "Guidance"]


class Guidance(Protocol):
    """Anything that says how the lander should accelerate."""

    def __call__(self, time: float, position: FloatArray, velocity: FloatArray, /) -> ArrayLike:
        """Wanted acceleration as seen in the site frame, m/s^2, (..., 3), at a time since the start, s."""


@dataclass(frozen=True, eq=False, init=False)
class ApolloGuidance:
    """Guidance to a target state at a given time (L11).

    Parameters
    ----------
    target_position, target_velocity, target_acceleration : (3,)
        What is to be reached at ``final_time``, site frame; m, m/s, m/s^2.
    final_time : float
        Time of arrival since the start, s.
    hold : float
        The last so many seconds repeat the last command: its gains grow without bound towards the end, s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or times that are not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> guide = ln.landing.ApolloGuidance([0, 0, 30], [0, 0, -0.1], [0, 0, 0], final_time=600.0)
    >>> guide(0.0, [400.0, -300.0, 2000.0], [-1.0, 0.7, -5.0]).round(6)
    array([-0.003333,  0.003   , -0.014667])
    """

    target_position: FloatArray
    target_velocity: FloatArray
    target_acceleration: FloatArray
    final_time: float
    hold: float

    def __init__(
        self,
        target_position: ArrayLike,
        target_velocity: ArrayLike,
        target_acceleration: ArrayLike,
        final_time: float,
        hold: float = 5.0,
    ) -> None:
        named = (
            ("target_position", target_position),
            ("target_velocity", target_velocity),
            ("target_acceleration", target_acceleration),
        )
        for name, value in named:
            vector = vectors(value, name).copy()
            if vector.ndim != 1:
                raise InvalidInputError(f"{name}: expected shape (3,), got {vector.shape}")
            vector.flags.writeable = False
            object.__setattr__(self, name, vector)
        for name, number in (("final_time", final_time), ("hold", hold)):
            scalar = positive(number, name)
            if scalar.ndim:
                raise InvalidInputError(f"{name}: expected a number, got shape {scalar.shape}")
            object.__setattr__(self, name, float(scalar))
        if self.hold >= self.final_time:
            raise InvalidInputError(
                f"hold: expected less than final_time, {self.final_time:g} s, got {self.hold:g} s"
            )

    @property
    def hold_from(self) -> float:
        """Time from which the last command is repeated, s."""
        return self.final_time - self.hold

    def __call__(self, time: float, position: ArrayLike, velocity: ArrayLike) -> FloatArray:
        """Wanted acceleration.

        Parameters
        ----------
        time : float
            Since the start, s.
        position, velocity : (..., 3)
            Where the lander is, site frame, m and m/s.

        Returns
        -------
        (..., 3)
            m/s^2. From ``hold_from`` on the time to go stands still; who flies by it repeats the last command
            of before instead, as :func:`losnav.landing.simulate_descent` does.
        """
        r, v = vectors(position, "position"), vectors(velocity, "velocity")
        left = max(self.final_time - float(finite(time, "time")), self.hold)
        reach = 12.0 * (self.target_position - r) / left**2
        brake = -6.0 * (self.target_velocity + v) / left
        return np.asarray(reach + brake + self.target_acceleration)

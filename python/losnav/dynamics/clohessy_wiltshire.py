"""Relative motion about a circular orbit."""

from __future__ import annotations

from dataclasses import dataclass

from losnav.dynamics.listed import Listed, hold_numbers


@dataclass(frozen=True)
class ClohessyWiltshire(Listed):
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

    def __post_init__(self) -> None:
        hold_numbers(self, at_least_zero=("mean_motion", "acceleration_psd"))

    def _parameters(self) -> list[float]:
        return [self.mean_motion, self.acceleration_psd]

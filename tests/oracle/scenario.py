"""Descent to a landing site beside four landmarks: the reference scenario of the paper.

The paper gives the landmarks and the state at t = 0; the profile between there and touchdown is a cubic
Hermite curve in position and in MRP, ending at rest at the origin with zero MRP.
"""

from __future__ import annotations

import numpy as np

from tests.oracle.attitude import mrp_kinematics

LANDMARKS = np.array([[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0]])
POSITION_0 = np.array([-50.0, 50.0, 500.0])
VELOCITY_0 = np.array([0.01, -0.075, -0.2])
MRP_0 = np.array([0.09, -0.04, 0.03])
RATE_0 = np.radians([0.1, 0.1, 0.1])
FOCAL_LENGTH = 0.05
SIGMA_METRES = 1e-6
SIGMA = SIGMA_METRES / FOCAL_LENGTH
SAMPLING = 2.0
LANDING_TIME = 430.0
EPOCHS = np.arange(0.0, LANDING_TIME + SAMPLING / 2, SAMPLING)


def hermite_to_rest(start, slope, t):
    """Cubic from (start, slope) at t = 0 to (0, 0) at the landing time."""
    s = t / LANDING_TIME
    return (2 * s**3 - 3 * s**2 + 1) * start + (s**3 - 2 * s**2 + s) * LANDING_TIME * slope


def true_pose(t):
    """Position and MRP at time t in seconds."""
    return (
        hermite_to_rest(POSITION_0, VELOCITY_0, t),
        hermite_to_rest(MRP_0, mrp_kinematics(MRP_0) @ RATE_0 / 4, t),
    )

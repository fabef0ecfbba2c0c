"""Relative motion about an eccentric orbit in closed form over the true anomaly.

Yamanaka & Ankersen, New state transition matrix for relative motion on an arbitrary elliptical orbit, JGCD
25(1), 2002, 60-66: x along track, y along the negative normal, z to nadir.
"""

from __future__ import annotations

import numpy as np


def true_anomaly(mean, e):
    """Kepler's equation by bisection, then the half-angle formula; revolutions kept."""
    turns = np.round(mean / (2 * np.pi))
    m = mean - 2 * np.pi * turns
    low, high = m - e - 1e-9, m + e + 1e-9
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle - e * np.sin(middle) < m else (low, middle)
    eccentric = 0.5 * (low + high)
    half = np.arctan2(np.sqrt(1 + e) * np.sin(eccentric / 2), np.sqrt(1 - e) * np.cos(eccentric / 2))
    return 2 * half + 2 * np.pi * turns


def mean_anomaly(theta, e):
    eccentric = 2 * np.arctan2(np.sqrt(1 - e) * np.sin(theta / 2), np.sqrt(1 + e) * np.cos(theta / 2))
    return eccentric - e * np.sin(eccentric)


def scaled(theta, e, k2):
    """To the scaled state: r~ = rho r, r~' = -e sin r + v/(k^2 rho), and the rate of theta."""
    rho = 1 + e * np.cos(theta)
    forward = np.zeros((6, 6))
    for i in range(3):
        forward[i, i] = rho
        forward[3 + i, i] = -e * np.sin(theta)
        forward[3 + i, 3 + i] = 1 / (k2 * rho)
    return forward


def fundamental(theta, e, j):
    """In-plane solutions, rows x, z, x', z'."""
    rho = 1 + e * np.cos(theta)
    s, c = rho * np.sin(theta), rho * np.cos(theta)
    ds = np.cos(theta) + e * np.cos(2 * theta)
    dc = -(np.sin(theta) + e * np.sin(2 * theta))
    return np.array(
        [
            [1, -c * (1 + 1 / rho), s * (1 + 1 / rho), 3 * rho**2 * j],
            [0, s, c, 2 - 3 * e * s * j],
            [0, 2 * s, 2 * c - e, 3 * (1 - 2 * e * s * j)],
            [0, ds, dc, -3 * e * (ds * j + s / rho**2)],
        ]
    )


def yamanaka_ankersen(mu, a, e, theta0, dt):
    """State transition matrix over ``dt`` from true anomaly ``theta0``."""
    n = np.sqrt(mu / a**3)
    theta = true_anomaly(mean_anomaly(theta0, e) + n * dt, e)
    k2 = np.sqrt(mu / (a * (1 - e**2)) ** 3)
    whole = np.zeros((6, 6))
    plane, across = np.ix_([0, 2, 3, 5], [0, 2, 3, 5]), np.ix_([1, 4], [1, 4])
    whole[plane] = fundamental(theta, e, k2 * dt) @ np.linalg.inv(fundamental(theta0, e, 0.0))
    turn = theta - theta0
    whole[across] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    return np.linalg.solve(scaled(theta, e, k2), whole @ scaled(theta0, e, k2))

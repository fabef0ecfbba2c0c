"""The extended Kalman filter of ``benches/filters.py`` in numba: relative motion, range and two angles.

Structured like the engine's: rows one after another, Joseph's form, no factorisation. It is spared what a
public function has beside that: the transition and its process noise are computed once by the caller, nothing
is checked, nothing is reported, the results are written over the arguments.
"""

# Compiled code takes arrays one by one.
# ruff: noqa: PLR0917

from __future__ import annotations

import math

import numba
import numpy as np

OPTIONS = {"fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", "boundscheck": False}


@numba.njit(**OPTIONS)
def predict(x, p, phi, q, work):
    """x and p moved in place."""
    n = 6
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += phi[i, k] * x[k]
        work[6, i] = total
    for i in range(n):
        x[i] = work[6, i]
        for j in range(n):
            total = 0.0
            for k in range(n):
                total += phi[i, k] * p[k, j]
            work[i, j] = total
    for i in range(n):
        for j in range(i, n):
            total = q[i, j]
            for k in range(n):
                total += work[i, k] * phi[j, k]
            p[i, j] = total
            p[j, i] = total


@numba.njit(**OPTIONS)
def _absorb(p, h0, h1, h2, r, y, delta, work):
    """One row; ``h`` has three entries."""
    s = r
    for i in range(6):
        work[0, i] = p[i, 0] * h0 + p[i, 1] * h1 + p[i, 2] * h2
    s += h0 * work[0, 0] + h1 * work[0, 1] + h2 * work[0, 2]
    scale = 1.0 / s
    left = y - h0 * delta[0] - h1 * delta[1] - h2 * delta[2]
    for i in range(6):
        work[1, i] = work[0, i] * scale
        delta[i] += work[1, i] * left
    # A = P - k f', P+ = A - (A h) k' + r k k'.
    for i in range(6):
        k = work[1, i]
        rest = r * k
        rest -= (p[i, 0] - k * work[0, 0]) * h0
        rest -= (p[i, 1] - k * work[0, 1]) * h1
        rest -= (p[i, 2] - k * work[0, 2]) * h2
        work[2, i] = rest
    for i in range(6):
        for j in range(i, 6):
            value = p[i, j] - work[1, i] * work[0, j] + work[2, i] * work[1, j]
            p[i, j] = value
            p[j, i] = value


@numba.njit(**OPTIONS)
def update(x, p, z, dcm, variances, work):
    """x and p corrected in place."""
    a = -(dcm[0, 0] * x[0] + dcm[0, 1] * x[1] + dcm[0, 2] * x[2])
    b = -(dcm[1, 0] * x[0] + dcm[1, 1] * x[1] + dcm[1, 2] * x[2])
    c = -(dcm[2, 0] * x[0] + dcm[2, 1] * x[1] + dcm[2, 2] * x[2])
    flat2 = a * a + b * b
    rho2 = flat2 + c * c
    flat, rho = math.sqrt(flat2), math.sqrt(rho2)
    delta = work[5]
    for i in range(6):
        delta[i] = 0.0
    for row in range(3):
        if row == 0:
            y, ga, gb, gc = z[0] - rho, a / rho, b / rho, c / rho
        elif row == 1:
            y, ga, gb, gc = z[1] - math.atan2(b, a), -b / flat2, a / flat2, 0.0
        else:
            y = z[2] - math.atan2(c, flat)
            k = 1.0 / (rho2 * flat)
            ga, gb, gc = -a * c * k, -b * c * k, flat2 * k
        if row > 0:
            y -= 2 * math.pi * math.floor(y / (2 * math.pi) + 0.5)
        h0 = -(dcm[0, 0] * ga + dcm[1, 0] * gb + dcm[2, 0] * gc)
        h1 = -(dcm[0, 1] * ga + dcm[1, 1] * gb + dcm[2, 1] * gc)
        h2 = -(dcm[0, 2] * ga + dcm[1, 2] * gb + dcm[2, 2] * gc)
        _absorb(p, h0, h1, h2, variances[row], y, delta, work)
    for i in range(6):
        x[i] += delta[i]


@numba.njit(**OPTIONS)
def step(x, p, phi, q, z, dcm, variances, work):
    """Predict and update in place."""
    predict(x, p, phi, q, work)
    update(x, p, z, dcm, variances, work)


@numba.njit(**OPTIONS)
def run(x, p, phi, q, z, dcm, variances, work, states, covariances):
    """A whole arc, every estimate kept."""
    for k in range(z.shape[0]):
        step(x, p, phi, q, z[k], dcm, variances, work)
        states[k] = x
        covariances[k] = p


@numba.njit(parallel=True, **OPTIONS)
def run_batch(x, p, phi, q, z, dcm, variances, states, covariances):
    """Many arcs, every estimate kept."""
    for r in numba.prange(z.shape[0]):
        mean, spread, work = x.copy(), p.copy(), np.empty((7, 6))
        for k in range(z.shape[1]):
            step(mean, spread, phi, q, z[r, k], dcm, variances, work)
            states[r, k] = mean
            covariances[r, k] = spread

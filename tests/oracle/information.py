"""Bounds the long way round: information matrices in 60 digits, and the Fisher information of orbit elements.

Source of the recursion: Tichavsky, Muravchik & Nehorai 1998, equations 21 to 25 (additive Gaussian noise). Of
process noise that is singular the recursion is taken in its covariance form.
"""

from __future__ import annotations

import mpmath as mp
import numpy as np

DIGITS = 60


def _matrix(a):
    return mp.matrix(np.asarray(a, dtype=float).tolist())


def posterior_bounds(transitions, noises, rows, prior):
    """(T, N, N): ``rows[k]`` of unit noise at k, ``transitions[k]`` and ``noises[k]`` from k to k + 1."""
    out = []
    with mp.workdps(DIGITS):
        p = _matrix(prior)
        for k, h in enumerate(rows):
            if k:
                f = _matrix(transitions[k - 1])
                p = f * p * f.T + _matrix(noises[k - 1])
            c = _matrix(h)
            p = mp.inverse(mp.inverse(p) + c.T * c)
            out.append(np.array(p.tolist(), dtype=float))
    return np.array(out)


def information(transitions, rows):
    """Information about the first state, (N, N), no process noise."""
    with mp.workdps(DIGITS):
        phi, total = None, None
        for k, h in enumerate(rows):
            phi = mp.eye(len(rows[0][0])) if phi is None else _matrix(transitions[k - 1]) * phi
            a = _matrix(h) * phi
            total = a.T * a if total is None else total + a.T * a
        return np.array(total.tolist(), dtype=float)


# --- elements of an orbit -----------------------------------------------------------------------------


def orbit_state(elements, t, mu):
    """``[r v]`` at ``t`` of ``(a, e, i, node, argument, mean anomaly at 0)``; complex-safe."""
    a, e, i, node, argument, mean = elements
    m = mean + np.sqrt(mu / a**3) * t
    eccentric = m + e * np.sin(m)
    for _ in range(60):
        eccentric = eccentric - (eccentric - e * np.sin(eccentric) - m) / (1 - e * np.cos(eccentric))
    c, s = np.cos(eccentric), np.sin(eccentric)
    r = a * (1 - e * c)
    minor = np.sqrt(1 - e * e)
    position, velocity = (a * (c - e), a * minor * s), np.sqrt(mu * a) / r * np.array([-s, minor * c])
    p = np.array(
        [
            np.cos(node) * np.cos(argument) - np.sin(node) * np.sin(argument) * np.cos(i),
            np.sin(node) * np.cos(argument) + np.cos(node) * np.sin(argument) * np.cos(i),
            np.sin(argument) * np.sin(i),
        ]
    )
    q = np.array(
        [
            -np.cos(node) * np.sin(argument) - np.sin(node) * np.cos(argument) * np.cos(i),
            -np.sin(node) * np.sin(argument) + np.cos(node) * np.cos(argument) * np.cos(i),
            np.cos(argument) * np.sin(i),
        ]
    )
    return np.concatenate([x * p + y * q for x, y in (position, velocity)])


def sun_bound(elements, times, sigma, prior, mu):
    """Bound at the last of ``times`` from Sun directions at all of them but the first, (6, 6).

    ``prior`` is the covariance of ``[r v]`` at the first. Everything is a derivative along the elements; no
    transition matrix takes part.
    """
    step = 1e-30 * np.diag(np.abs(elements))
    start, end = [], []
    total = np.zeros((6, 6))
    moved = [np.asarray(elements) + 1j * row for row in step]
    for column in moved:
        start.append(orbit_state(column, times[0], mu).imag / 1e-30)
        end.append(orbit_state(column, times[-1], mu).imag / 1e-30)
    start, end = np.array(start).T, np.array(end).T
    for t in times[1:]:
        columns = []
        for column in moved:
            r = orbit_state(column, t, mu)[:3]
            columns.append((-r / np.sqrt(r @ r)).imag / 1e-30)
        h = np.array(columns).T / sigma
        total += h.T @ h
    known = np.linalg.inv(np.linalg.cholesky(prior)) @ start
    whole = total + known.T @ known
    scale = 1 / np.sqrt(np.diag(whole))
    inverse = np.linalg.inv(whole * np.outer(scale, scale)) * np.outer(scale, scale)
    return end @ inverse @ end.T

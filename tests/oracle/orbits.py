"""Orbits by SciPy: motion, variational equations and covariance, each as one differential equation."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp


def gravity(r, mu, j2=0.0, radius=0.0):
    """Point mass and J2, pole along z; complex-safe."""
    x, y, z = r
    r2 = r @ r
    r1 = np.sqrt(r2)
    pull = -mu * r / r1**3
    k = 1.5 * j2 * mu * radius**2 / r1**5
    return pull - k * np.array([x * (1 - 5 * z * z / r2), y * (1 - 5 * z * z / r2), z * (3 - 5 * z * z / r2)])


def gradient(r, **field):
    """Derivative of :func:`gravity`, by complex step."""
    nudged = r + 1e-20j * np.linalg.norm(r) * np.eye(3)
    columns = [gravity(p, **field).imag / (1e-20 * np.linalg.norm(r)) for p in nudged]
    return np.array(columns).T


def integrate(rates, start, span):
    """The end of an arc, to rounding: components are scaled by their size on the way."""
    if span == 0:
        return np.array(start, dtype=float)
    size = np.maximum(np.abs(start), np.abs(rates(0.0, start) * span))
    scale = np.where(size > 0, size, 1.0)
    solution = solve_ivp(
        lambda t, y: rates(t, y * scale) / scale,
        (0, span),
        np.asarray(start) / scale,
        method="DOP853",
        rtol=3e-14,
        atol=1e-15,
    )
    return solution.y[:, -1] * scale


def propagate(state, dt, control=(0.0, 0.0, 0.0), **field):
    """``[r v]`` after ``dt``."""

    def rates(_, y):
        return np.concatenate([y[3:], gravity(y[:3], **field) + control])

    return integrate(rates, state, dt)


def transition(state, dt, control=(0.0, 0.0, 0.0), **field):
    """State transition matrix by the variational equations, in units of the step."""
    unit = np.array([abs(dt) or 1.0] * 3 + [1.0] * 3)

    def rates(_, y):
        phi = y[6:].reshape(6, 6)
        a = np.zeros((6, 6))
        a[:3, 3:] = np.eye(3) / unit[0]
        a[3:, :3] = gradient(y[:3], **field) * unit[0]
        return np.concatenate([y[3:6], gravity(y[:3], **field) + control, (a @ phi).ravel()])

    end = integrate(rates, np.concatenate([state, np.eye(6).ravel()]), dt)
    return end[6:].reshape(6, 6) * np.outer(unit, 1 / unit)


def process_noise(state, dt, psd, **field):
    """``Q`` by its own differential equation, ``dQ/dt = A Q + Q A' + G q G'``."""
    unit = np.array([abs(dt)] * 3 + [1.0] * 3)
    sign = np.sign(dt)

    def rates(_, y):
        q = y[6:].reshape(6, 6)
        a = np.zeros((6, 6))
        a[:3, 3:] = np.eye(3) / unit[0]
        a[3:, :3] = gradient(y[:3], **field) * unit[0]
        g = np.diag([0.0, 0, 0, 1, 1, 1]) * sign / abs(dt)
        return np.concatenate([y[3:6], gravity(y[:3], **field), (a @ q + q @ a.T + g).ravel()])

    end = integrate(rates, np.concatenate([state, np.zeros(36)]), dt)
    return psd * abs(dt) * end[6:].reshape(6, 6) * np.outer(unit, unit)


def pulled(r, bodies, mu):
    """Gravity of a centre and of bodies ``(mu, place)``, which pull the centre too; complex-safe."""
    total = gravity(r, mu)
    for strength, place in bodies:
        d = r - place
        total = total - strength * (d / np.sqrt(d @ d) ** 3 + place / np.sqrt(place @ place) ** 3)
    return total


def propagate_among(state, dt, bodies, *, time, mu, control=(0.0, 0.0, 0.0)):
    """``[r v]`` after ``dt`` from ``time`` among bodies ``(mu, place of t)``."""

    def rates(t, y):
        there = [(strength, place(time + t)) for strength, place in bodies]
        return np.concatenate([y[3:], pulled(y[:3], there, mu) + control])

    return integrate(rates, state, dt)

"""Models the filters of the oracle run on: relative motion, range and angles, directions, and made-up ones.

Transition matrices are exponentials, process noise is Van Loan's exponential, Jacobians of measurements are
taken by complex step of the one formula.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from tests.oracle import los


def complex_step(function, x):
    """Derivative of a complex-safe function, (M, N)."""
    columns = []
    for j in range(len(x)):
        moved = np.array(x, dtype=complex)
        moved[j] += 1e-200j
        columns.append(np.imag(function(moved)) / 1e-200)
    return np.array(columns).T


@dataclass(frozen=True)
class Linear:
    """x' = A x + G (u + w), white w of spectral density psd on every axis."""

    a: np.ndarray
    g: np.ndarray
    psd: float

    def _exponential(self, dt):
        n, m = self.g.shape
        block = np.zeros((n + m, n + m))
        block[:n, :n], block[:n, n:] = self.a, self.g
        whole = expm(block * dt)
        return whole[:n, :n], whole[:n, n:]

    def propagate(self, x, dt, u=None):
        phi, response = self._exponential(dt)
        return phi @ x + (0.0 if u is None else response @ u)

    def transition(self, x, dt, u=None):
        return self._exponential(dt)[0]

    def process_noise(self, x, dt):
        n, a = len(self.a), self.a * np.sign(dt)
        block = np.zeros((2 * n, 2 * n))
        block[:n, :n], block[:n, n:], block[n:, n:] = -a, self.psd * self.g @ self.g.T, a.T
        whole = expm(block * abs(dt))
        return whole[n:, n:].T @ whole[:n, n:]


def clohessy_wiltshire(w, psd):
    """x'' - 2 w z' = a_x, y'' + w^2 y = a_y, z'' + 2 w x' - 3 w^2 z = a_z."""
    a = np.zeros((6, 6))
    a[:3, 3:] = np.eye(3)
    a[3, 5] = 2 * w
    a[4, 1] = -(w**2)
    a[5, 2], a[5, 3] = 3 * w**2, -2 * w
    return Linear(a, np.vstack([np.zeros((3, 3)), np.eye(3)]), psd)


@dataclass(frozen=True)
class Swirl:
    """A made-up nonlinear flow of any size: x + dt A x + dt^2 c sin(x) + dt B u."""

    a: np.ndarray
    c: float
    b: np.ndarray
    q: np.ndarray

    def propagate(self, x, dt, u=None):
        push = 0.0 if u is None else dt * (self.b @ u)
        return x + dt * (self.a @ x) + dt**2 * self.c * np.sin(x) + push

    def transition(self, x, dt, u=None):
        return complex_step(lambda v: self.propagate(v, dt, u), x)

    def process_noise(self, x, dt):
        return abs(dt) * self.q


class Smooth:
    """What every sensor here does the same way."""

    unit = False

    def jacobian(self, x):
        return complex_step(self.predict, x)

    def residual(self, z, h):
        return z - h


@dataclass(frozen=True)
class RangeBearing(Smooth):
    """Range, azimuth, elevation of the target, ``L = -dcm r``: the state is chaser minus target."""

    sigma_range: float
    sigma_angle: float
    dcm: np.ndarray
    blocks = (3,)

    def predict(self, x):
        a, b, c = -self.dcm @ x[:3]
        rho = np.sqrt(a * a + b * b + c * c)
        flat = np.sqrt(a * a + b * b)
        if np.iscomplexobj(x):
            # atan2 for complex step: value from the real parts, derivative by the chain rule.
            azimuth = np.arctan2(b.real, a.real) + 1j * (a.real * b.imag - b.real * a.imag) / (flat.real**2)
            elevation = np.arctan2(c.real, flat.real) + 1j * (flat.real * c.imag - c.real * flat.imag) / (
                rho.real**2
            )
            return np.array([rho, azimuth, elevation])
        return np.array([rho, np.arctan2(b, a), np.arctan2(c, flat)])

    def noise(self):
        return np.diag(np.square([self.sigma_range, self.sigma_angle, self.sigma_angle]))

    def residual(self, z, h):
        y = z - h
        y[1:] = np.remainder(y[1:] + np.pi, 2 * np.pi) - np.pi
        return y


@dataclass(frozen=True)
class LineOfSight(Smooth):
    """Unit directions to known landmarks, body axes."""

    landmarks: np.ndarray
    sigma: float
    dcm: np.ndarray
    unit = True

    @property
    def blocks(self):
        return (2,) * len(self.landmarks)

    def predict(self, x):
        return los.los_from_dcm(self.landmarks, x[:3], self.dcm).ravel()

    def noise(self):
        return self.sigma**2 * np.eye(3 * len(self.landmarks))


@dataclass(frozen=True)
class Wavy(Smooth):
    """A made-up measurement of any size: H x + c sin(H x), any noise; one group of rows."""

    h: np.ndarray
    c: float
    r: np.ndarray

    @property
    def blocks(self):
        return (len(self.h),)

    def predict(self, x):
        seen = self.h @ x
        return seen + self.c * np.sin(seen)

    def noise(self):
        return self.r

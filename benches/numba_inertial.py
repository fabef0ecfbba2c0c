"""The error-state filter of ``benches/inertial.py`` in numba: inertial navigation, landmarks in a camera.

Structured like the engine's: rows one after another, Joseph's form, no factorisation, the zeros of the
transition used. It is spared what a public function has beside that: nothing is checked, nothing is reported,
no gate, no biased sample is refused, the results are written over the arguments.
"""

# Compiled code takes arrays one by one.
# ruff: noqa: PLR0917

from __future__ import annotations

import math

import numba
import numpy as np

OPTIONS = {"fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", "boundscheck": False}
N = 15


@numba.njit(**OPTIONS)
def _turned(c, w, out):
    """``out = c Exp(w)``: body axes to reference."""
    angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    if angle2 < 1e-8:
        s, k = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0
    else:
        angle = math.sqrt(angle2)
        s, k = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
    for i in range(3):
        # c (I + s [w x] + k [w x]^2)
        a, b, d = c[i, 0], c[i, 1], c[i, 2]
        p = b * w[2] - d * w[1]
        q = d * w[0] - a * w[2]
        r = a * w[1] - b * w[0]
        out[i, 0] = a + s * p + k * (q * w[2] - r * w[1])
        out[i, 1] = b + s * q + k * (r * w[0] - p * w[2])
        out[i, 2] = d + s * r + k * (p * w[1] - q * w[0])


@numba.njit(**OPTIONS)
def _transition(ch, f, w, dt, phi, work):
    """``Phi = I + A + A^2/2 + A^3/6`` of F at mid-step, block by block."""
    for i in range(N):
        for j in range(N):
            phi[i, j] = 1.0 if i == j else 0.0
    # G = -C [f x], how a turn moves the velocity.
    g, w1, w2, t1 = work[0], work[1], work[2], work[3]
    for i in range(3):
        g[i, 0] = -(ch[i, 1] * f[2] - ch[i, 2] * f[1])
        g[i, 1] = -(ch[i, 2] * f[0] - ch[i, 0] * f[2])
        g[i, 2] = -(ch[i, 0] * f[1] - ch[i, 1] * f[0])
    # W = -[w x].
    w1[0, 0] = w1[1, 1] = w1[2, 2] = 0.0
    w1[0, 1], w1[0, 2], w1[1, 2] = w[2], -w[1], w[0]
    w1[1, 0], w1[2, 0], w1[2, 1] = -w[2], w[1], -w[0]
    for i in range(3):
        for j in range(3):
            total = 0.0
            gw = 0.0
            for k in range(3):
                total += w1[i, k] * w1[k, j]
                gw += g[i, k] * w1[k, j]
            w2[i, j] = total
            t1[i, j] = gw
    h2, h3 = dt * dt / 2, dt * dt * dt / 6
    for i in range(3):
        phi[i, 3 + i] = dt
        for j in range(3):
            cube = 0.0
            gw2 = 0.0
            for k in range(3):
                cube += w2[i, k] * w1[k, j]
                gw2 += t1[i, k] * w1[k, j]
            one = 1.0 if i == j else 0.0
            phi[6 + i, 6 + j] = one + dt * w1[i, j] + h2 * w2[i, j] + h3 * cube
            phi[6 + i, 12 + j] = -(dt * one + h2 * w1[i, j] + h3 * w2[i, j])
            phi[3 + i, 6 + j] = dt * g[i, j] + h2 * t1[i, j] + h3 * gw2
            phi[3 + i, 9 + j] = -dt * ch[i, j]
            phi[3 + i, 12 + j] = -(h2 * g[i, j] + h3 * t1[i, j])
            phi[i, 6 + j] = h2 * g[i, j] + h3 * t1[i, j]
            phi[i, 9 + j] = -h2 * ch[i, j]
            phi[i, 12 + j] = -h3 * g[i, j]


@numba.njit(**OPTIONS)
def _support(i):
    """Where row ``i`` of Phi has entries off its diagonal: from, to."""
    return (0, N) if i < 6 else ((6, N) if i < 9 else (i, i + 1))


@numba.njit(**OPTIONS)
def _carry(p, phi, half):
    """``Phi P Phi'`` in place."""
    for i in range(N):
        start, end = _support(i)
        for j in range(N):
            half[i, j] = 0.0
        for k in range(start, end):
            for j in range(N):
                half[i, j] += phi[i, k] * p[k, j]
    for i in range(N):
        for j in range(i, N):
            start, end = _support(j)
            total = 0.0
            for k in range(start, end):
                total += half[i, k] * phi[j, k]
            p[i, j] = total
            p[j, i] = total


@numba.njit(**OPTIONS)
def propagate(r, v, c, biases, p, f_m, w_m, gravity, dt, densities, work, phi, half):
    """State and covariance moved in place; ``c`` takes body to reference axes."""
    f, w, u = work[4, 0], work[4, 1], work[4, 2]
    for i in range(3):
        f[i], w[i] = f_m[i] - biases[i], w_m[i] - biases[3 + i]
        u[i] = 0.5 * dt * w[i]
    ch, c1 = work[5], work[6]
    _turned(c, u, ch)
    for i in range(3):
        u[i] = dt * w[i]
    _turned(c, u, c1)
    for i in range(3):
        a0 = c[i, 0] * f[0] + c[i, 1] * f[1] + c[i, 2] * f[2] + gravity[i]
        ah = ch[i, 0] * f[0] + ch[i, 1] * f[1] + ch[i, 2] * f[2] + gravity[i]
        a1 = c1[i, 0] * f[0] + c1[i, 1] * f[1] + c1[i, 2] * f[2] + gravity[i]
        r[i] += dt * v[i] + dt * dt / 6 * (a0 + 2 * ah)
        v[i] += dt / 6 * (a0 + 4 * ah + a1)
    for i in range(3):
        for j in range(3):
            c[i, j] = c1[i, j]
    _transition(ch, f, w, dt, phi, work)
    _carry(p, phi, half)
    # White noise over the step; its small couplings are spared.
    for i in range(3):
        p[i, i] += densities[0] * dt**3 / 3
        p[i, 3 + i] += densities[0] * dt * dt / 2
        p[3 + i, i] = p[i, 3 + i]
        p[3 + i, 3 + i] += densities[0] * dt
        p[6 + i, 6 + i] += densities[1] * dt
        p[9 + i, 9 + i] += densities[2] * dt
        p[12 + i, 12 + i] += densities[3] * dt


@numba.njit(**OPTIONS)
def _absorb(p, h, noise, y, delta, work):
    """One row; ``h`` has entries for position and attitude."""
    f, gain, rest = work[0], work[1], work[2]
    s, left = noise, y
    for i in range(N):
        f[i] = (
            p[i, 0] * h[0] + p[i, 1] * h[1] + p[i, 2] * h[2]
            + p[i, 6] * h[3] + p[i, 7] * h[4] + p[i, 8] * h[5]
        )  # fmt: skip
    for k in range(3):
        s += h[k] * f[k] + h[3 + k] * f[6 + k]
        left -= h[k] * delta[k] + h[3 + k] * delta[6 + k]
    for i in range(N):
        gain[i] = f[i] / s
        delta[i] += gain[i] * left
    # A = P - k f', P+ = A - (A h) k' + r k k'; f'h = s - r.
    for i in range(N):
        rest[i] = noise * gain[i] - (f[i] - gain[i] * (s - noise))
    for i in range(N):
        for j in range(i, N):
            value = p[i, j] - gain[i] * f[j] + rest[i] * gain[j]
            p[i, j] = value
            p[j, i] = value


@numba.njit(**OPTIONS)
def update(r, v, c, biases, p, pixels, landmarks, focal, variance, work, small):
    """All landmarks of an image, one after another, linearised at the prior."""
    delta, h = work[3], work[4]
    for i in range(N):
        delta[i] = 0.0
    for n in range(landmarks.shape[0]):
        dx, dy, dz = landmarks[n, 0] - r[0], landmarks[n, 1] - r[1], landmarks[n, 2] - r[2]
        x = c[0, 0] * dx + c[1, 0] * dy + c[2, 0] * dz
        y = c[0, 1] * dx + c[1, 1] * dy + c[2, 1] * dz
        z = c[0, 2] * dx + c[1, 2] * dy + c[2, 2] * dz
        inverse = 1.0 / z
        for m in range(2):
            side = x if m == 0 else y
            a, b, d = 0.0, 0.0, -focal * side * inverse * inverse
            if m == 0:
                a = focal * inverse
            else:
                b = focal * inverse
            for i in range(3):
                h[i] = -(c[i, 0] * a + c[i, 1] * b + c[i, 2] * d)
            # gradient x body
            h[3], h[4], h[5] = b * z - d * y, d * x - a * z, a * y - b * x
            _absorb(p, h, variance, pixels[2 * n + m] - focal * side * inverse, delta, work)
    for i in range(3):
        r[i] += delta[i]
        v[i] += delta[3 + i]
        biases[i] += delta[9 + i]
        biases[3 + i] += delta[12 + i]
    _turned(c, delta[6:9], small)
    for i in range(3):
        for j in range(3):
            c[i, j] = small[i, j]


@numba.njit(**OPTIONS)
def run(
    r,
    v,
    c,
    biases,
    p,
    f,
    w,
    pixels,
    gravity,
    dt,
    densities,
    landmarks,
    focal,
    variance,
    memory,
    states,
    covariances,
):
    """A whole arc, as many samples from image to image as there are; the estimate after every image kept."""
    work, phi, half, rows, small = memory
    every = f.shape[0] // pixels.shape[0]
    for k in range(pixels.shape[0]):
        for j in range(every * k, every * (k + 1)):
            propagate(r, v, c, biases, p, f[j], w[j], gravity, dt, densities, work, phi, half)
        update(r, v, c, biases, p, pixels[k], landmarks, focal, variance, rows, small)
        states[k, :3], states[k, 3:] = r, v
        covariances[k] = p


def memory():
    """What ``propagate`` and ``update`` write into."""
    return np.zeros((7, 3, 3)), np.zeros((N, N)), np.zeros((N, N)), np.zeros((5, N)), np.zeros((3, 3))

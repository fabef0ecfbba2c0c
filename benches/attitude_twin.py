"""The same QUEST and polish as ``losnav.solve_attitude`` in numba: plain loops over one problem.

It leaves out what a public function has beside that: no checks, no normalisation, one weight for all, no
proof of the minimum, ``out`` given by the caller.

``out``: quaternion xyzw (0-3), packed information (4-9), loss (10).
"""

from __future__ import annotations

import math

import numba
import numpy as np

OPTIONS = {"fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", "boundscheck": False}


@numba.njit(**OPTIONS)
def _det(m):
    a, d, e, b, f, c = m
    return a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - e * b)


@numba.njit(**OPTIONS)
def _start(b):
    """QUEST of a normalised profile matrix."""
    b00, b01, b02, b10, b11, b12, b20, b21, b22 = b
    root, trace = 1.0, b00 + b11 + b22
    sa, sb, sc = 2 * b00, 2 * b11, 2 * b22
    sd, se, sf = b01 + b10, b02 + b20, b12 + b21
    z0, z1, z2 = b12 - b21, b20 - b02, b01 - b10
    kappa = sb * sc - sf * sf + sa * sc - se * se + sa * sb - sd * sd
    delta = _det((sa, sd, se, sb, sf, sc))
    v0, v1, v2 = sa * z0 + sd * z1 + se * z2, sd * z0 + sb * z1 + sf * z2, se * z0 + sf * z1 + sc * z2
    alpha0, b0 = trace * trace - kappa, trace * trace + z0 * z0 + z1 * z1 + z2 * z2
    c1 = delta + z0 * v0 + z1 * v1 + z2 * v2
    c2, c0 = alpha0 + b0, alpha0 * b0 + c1 * trace - (v0 * v0 + v1 * v1 + v2 * v2)
    for _ in range(40):
        square = root * root
        down = ((square - c2) * square + c0 - c1 * root) / ((4 * square - 2 * c2) * root - c1)
        if not down > 4.4e-16:
            break
        root -= down
    # The column of adj(root I - K) with the largest diagonal: the sequential rotation, without the rotation.
    t, last = root + trace, root - trace
    a, d, e, b, f, c = t - sa, -sd, -se, t - sb, -sf, t - sc
    m0 = _det((b, f, -z1, c, -z2, last))
    m1 = _det((a, e, -z0, c, -z2, last))
    m2 = _det((a, d, -z0, b, -z1, last))
    m3 = _det((a, d, e, b, f, c))
    if m3 >= m0 and m3 >= m1 and m3 >= m2:
        # (a d e; d b f; e f c) x = z m3.
        x0 = z0 * (b * c - f * f) + z1 * (e * f - d * c) + z2 * (d * f - e * b)
        x1 = z0 * (e * f - d * c) + z1 * (a * c - e * e) + z2 * (d * e - a * f)
        x2 = z0 * (d * f - e * b) + z1 * (d * e - a * f) + z2 * (a * b - d * d)
        return x0, x1, x2, m3
    if m0 >= m1 and m0 >= m2:
        y = _cofactors((b, f, -z1, c, -z2, last), (d, e, -z0))
        return m0, y[0], y[1], y[2]
    if m1 >= m2:
        y = _cofactors((a, e, -z0, c, -z2, last), (d, f, -z1))
        return y[0], m1, y[1], y[2]
    y = _cofactors((a, d, -z0, b, -z1, last), (e, f, -z2))
    return y[0], y[1], m2, y[2]


@numba.njit(**OPTIONS)
def _cofactors(symmetric, vector):
    """Minus adj(symmetric) vector: the rest of a column of the adjugate."""
    (a, d, e, b, f, c), (p, q, r) = symmetric, vector
    aa, dd, ee = b * c - f * f, e * f - d * c, d * f - e * b
    bb, ff, cc = a * c - e * e, d * e - a * f, a * b - d * d
    return -(aa * p + dd * q + ee * r), -(dd * p + bb * q + ff * r), -(ee * p + ff * q + cc * r)


@numba.njit(**OPTIONS)
def _solve(body, reference, weight, out):
    n = body.shape[0]
    b00 = b01 = b02 = b10 = b11 = b12 = b20 = b21 = b22 = 0.0
    c00 = c01 = c02 = c11 = c12 = c22 = 0.0
    for k in range(n):
        x, y, z = reference[k, 0], reference[k, 1], reference[k, 2]
        u, v, w = body[k, 0], body[k, 1], body[k, 2]
        b00, b01, b02 = b00 + u * x, b01 + u * y, b02 + u * z
        b10, b11, b12 = b10 + v * x, b11 + v * y, b12 + v * z
        b20, b21, b22 = b20 + w * x, b21 + w * y, b22 + w * z
        c00, c01, c02 = c00 + x * x, c01 + x * y, c02 + x * z
        c11, c12, c22 = c11 + y * y, c12 + y * z, c22 + z * z
    s = 1.0 / n
    q = _start((b00 * s, b01 * s, b02 * s, b10 * s, b11 * s, b12 * s, b20 * s, b21 * s, b22 * s))
    for _ in range(4):
        norm = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        x, y, z, w = q[0] * norm, q[1] * norm, q[2] * norm, q[3] * norm
        a00, a01, a02 = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)
        a10, a11, a12 = 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)
        a20, a21, a22 = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
        g0 = g1 = g2 = loss = 0.0
        for k in range(n):
            rx, ry, rz = reference[k, 0], reference[k, 1], reference[k, 2]
            h0 = a00 * rx + a01 * ry + a02 * rz
            h1 = a10 * rx + a11 * ry + a12 * rz
            h2 = a20 * rx + a21 * ry + a22 * rz
            e0, e1, e2 = body[k, 0] - h0, body[k, 1] - h1, body[k, 2] - h2
            g0, g1, g2 = g0 + e1 * h2 - e2 * h1, g1 + e2 * h0 - e0 * h2, g2 + e0 * h1 - e1 * h0
            loss += e0 * e0 + e1 * e1 + e2 * e2
        m00, m11, m22 = (
            b00 * a00 + b01 * a01 + b02 * a02,
            b10 * a10 + b11 * a11 + b12 * a12,
            b20 * a20 + b21 * a21 + b22 * a22,
        )
        d = -0.5 * (b00 * a10 + b01 * a11 + b02 * a12 + b10 * a00 + b11 * a01 + b12 * a02)
        e = -0.5 * (b00 * a20 + b01 * a21 + b02 * a22 + b20 * a00 + b21 * a01 + b22 * a02)
        f = -0.5 * (b10 * a20 + b11 * a21 + b12 * a22 + b20 * a10 + b21 * a11 + b22 * a12)
        a, b, c = m11 + m22, m00 + m22, m00 + m11
        aa, dd, ee = b * c - f * f, e * f - d * c, d * f - e * b
        bb, ff, cc = a * c - e * e, d * e - a * f, a * b - d * d
        k = 1.0 / (a * aa + d * dd + e * ee)
        d0 = k * (aa * g0 + dd * g1 + ee * g2)
        d1 = k * (dd * g0 + bb * g1 + ff * g2)
        d2 = k * (ee * g0 + ff * g1 + cc * g2)
        h0, h1, h2 = 0.5 * d0, 0.5 * d1, 0.5 * d2
        q = (
            x + w * h0 + y * h2 - z * h1,
            y + w * h1 + z * h0 - x * h2,
            z + w * h2 + x * h1 - y * h0,
            w - x * h0 - y * h1 - z * h2,
        )
        if d0 * d0 + d1 * d1 + d2 * d2 <= 1e-20:
            break
    norm = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    norm = -norm if q[3] < 0 else norm
    for k in range(4):
        out[k] = norm * q[k]
    t00, t01, t02 = (
        a00 * c00 + a01 * c01 + a02 * c02,
        a00 * c01 + a01 * c11 + a02 * c12,
        a00 * c02 + a01 * c12 + a02 * c22,
    )
    t10, t11, t12 = (
        a10 * c00 + a11 * c01 + a12 * c02,
        a10 * c01 + a11 * c11 + a12 * c12,
        a10 * c02 + a11 * c12 + a12 * c22,
    )
    t20, t21, t22 = (
        a20 * c00 + a21 * c01 + a22 * c02,
        a20 * c01 + a21 * c11 + a22 * c12,
        a20 * c02 + a21 * c12 + a22 * c22,
    )
    out[4] = weight * (n - (t00 * a00 + t01 * a01 + t02 * a02))
    out[5] = -weight * (t00 * a10 + t01 * a11 + t02 * a12)
    out[6] = -weight * (t00 * a20 + t01 * a21 + t02 * a22)
    out[7] = weight * (n - (t10 * a10 + t11 * a11 + t12 * a12))
    out[8] = -weight * (t10 * a20 + t11 * a21 + t12 * a22)
    out[9] = weight * (n - (t20 * a20 + t21 * a21 + t22 * a22))
    out[10] = 0.5 * weight * (loss - (g0 * d0 + g1 * d1 + g2 * d2))


@numba.njit(**OPTIONS)
def solve(body, reference, sigma):
    """One problem; a new ``out``."""
    out = np.empty(11)
    _solve(body, reference, 1.0 / (sigma * sigma), out)
    return out


@numba.njit(parallel=True, **OPTIONS)
def solve_batch(body, reference, sigma, out):
    """A batch over the threads."""
    for k in numba.prange(body.shape[0]):
        _solve(body[k], reference[k], 1.0 / (sigma * sigma), out[k])

"""The same Levenberg-Marquardt as ``losnav.solve_pose`` in numba: structured sums, unrolled 6x6, no arrays.

Same step, damping schedule, tolerances and final test with the exact Hessian. It leaves out what a public
function has beside that: no checks, no normalisation, one weight for all, ``out`` given by the caller.

``out``: position (0-2), quaternion xyzw (3-6), packed information (7-27), cost, iterations, converged.
"""

from __future__ import annotations

import math

import numba
import numpy as np

OPTIONS = {"fastmath": {"contract", "reassoc", "nsz", "arcp"}, "error_model": "numpy", "boundscheck": False}
# The machine code of the exec'd functions cannot be cached on disk; they compile in seconds.


def _unrolled():
    """Source of ``ldl(a)`` and ``solve(l, d, g)`` for a packed upper triangle, entry by entry."""
    at = {}
    for i in range(6):
        for j in range(i, 6):
            at[i, j] = at[j, i] = len({tuple(sorted(k)) for k in at})
    lines = ["def ldl(a):"]
    for j in range(6):
        for i in range(j, 6):
            terms = "".join(f" - m{i}{k} * l{j}{k}" for k in range(j))
            target = f"d{j}" if i == j else f"m{i}{j}"
            lines.append(f"    {target} = a[{at[i, j]}]{terms}")
        lines.append(f"    r{j} = 1.0 / d{j}")
        lines += [f"    l{i}{j} = m{i}{j} * r{j}" for i in range(j + 1, 6)]
    lower = ", ".join(f"l{i}{j}" for i in range(6) for j in range(i))
    pivots = ", ".join(f"d{j}" for j in range(6))
    inverse = ", ".join(f"r{j}" for j in range(6))
    lines.append(f"    return ({lower}), ({pivots}), ({inverse})")
    lines += ["def solve(lower, inverse, g):", f"    {lower} = lower"]
    for i in range(6):
        lines.append(f"    y{i} = g[{i}]" + "".join(f" - l{i}{j} * y{j}" for j in range(i)))
    for i in reversed(range(6)):
        lines.append(
            f"    x{i} = y{i} * inverse[{i}]" + "".join(f" - l{j}{i} * x{j}" for j in range(i + 1, 6))
        )
    lines.append("    return (x0, x1, x2, x3, x4, x5)")
    return "\n".join(lines)


_namespace: dict = {}
exec(_unrolled(), _namespace)
_ldl = numba.njit(**OPTIONS)(_namespace["ldl"])
_solve = numba.njit(**OPTIONS)(_namespace["solve"])


@numba.njit(**OPTIONS)
def _dcm(x, y, z, w):
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


@numba.njit(**OPTIONS)
def _linearize(landmarks, los, weight, p, q):
    """(2 cost, gradient, packed information) of [dp', dalpha], body axes, of scalar weight."""
    c = _dcm(*q)
    s = gp0 = gp1 = gp2 = ga0 = ga1 = ga2 = k0 = k1 = k2 = 0.0
    p00 = p01 = p02 = p11 = p12 = p22 = a00 = a01 = a02 = a11 = a12 = a22 = 0.0
    for i in range(landmarks.shape[0]):
        x, y, z = landmarks[i, 0] - p[0], landmarks[i, 1] - p[1], landmarks[i, 2] - p[2]
        k = 1.0 / math.sqrt(x * x + y * y + z * z)
        h0 = (c[0][0] * x + c[0][1] * y + c[0][2] * z) * k
        h1 = (c[1][0] * x + c[1][1] * y + c[1][2] * z) * k
        h2 = (c[2][0] * x + c[2][1] * y + c[2][2] * z) * k
        e0, e1, e2 = los[i, 0] - h0, los[i, 1] - h1, los[i, 2] - h2
        s += e0 * e0 + e1 * e1 + e2 * e2
        t00, t01, t02 = 1 - h0 * h0, -h0 * h1, -h0 * h2
        t11, t12, t22 = 1 - h1 * h1, -h1 * h2, 1 - h2 * h2
        kk = k * k
        a00, a01, a02, a11, a12, a22 = a00 + t00, a01 + t01, a02 + t02, a11 + t11, a12 + t12, a22 + t22
        p00, p01, p02 = p00 + kk * t00, p01 + kk * t01, p02 + kk * t02
        p11, p12, p22 = p11 + kk * t11, p12 + kk * t12, p22 + kk * t22
        k0, k1, k2 = k0 + k * h0, k1 + k * h1, k2 + k * h2
        he = h0 * e0 + h1 * e1 + h2 * e2
        gp0, gp1, gp2 = gp0 - k * (e0 - h0 * he), gp1 - k * (e1 - h1 * he), gp2 - k * (e2 - h2 * he)
        ga0 += e1 * h2 - e2 * h1
        ga1 += e2 * h0 - e0 * h2
        ga2 += e0 * h1 - e1 * h0
    w = weight
    return (
        w * s,
        (w * gp0, w * gp1, w * gp2, w * ga0, w * ga1, w * ga2),
        (
            w * p00, w * p01, w * p02, 0.0, w * k2, -w * k1, w * p11, w * p12, -w * k2, 0.0, w * k0,
            w * p22, w * k1, -w * k0, 0.0, w * a00, w * a01, w * a02, w * a11, w * a12, w * a22,
        ),
    )  # fmt: skip


@numba.njit(**OPTIONS)
def _second_order(landmarks, los, weight, p, q):
    """What the true Hessian has beyond Gauss-Newton's matrix, packed."""
    c = _dcm(*q)
    p00 = p01 = p02 = p11 = p12 = p22 = a00 = a01 = a02 = a11 = a12 = a22 = 0.0
    m00 = m01 = m02 = m10 = m11 = m12 = m20 = m21 = m22 = 0.0
    for i in range(landmarks.shape[0]):
        x, y, z = landmarks[i, 0] - p[0], landmarks[i, 1] - p[1], landmarks[i, 2] - p[2]
        k = 1.0 / math.sqrt(x * x + y * y + z * z)
        h0 = (c[0][0] * x + c[0][1] * y + c[0][2] * z) * k
        h1 = (c[1][0] * x + c[1][1] * y + c[1][2] * z) * k
        h2 = (c[2][0] * x + c[2][1] * y + c[2][2] * z) * k
        v0, v1, v2 = weight * (los[i, 0] - h0), weight * (los[i, 1] - h1), weight * (los[i, 2] - h2)
        d = v0 * h0 + v1 * h1 + v2 * h2
        kk, d3 = k * k, 3 * d
        s00, s11, s22 = 2 * v0 * h0, 2 * v1 * h1, 2 * v2 * h2
        s01, s02, s12 = v0 * h1 + h0 * v1, v0 * h2 + h0 * v2, v1 * h2 + h1 * v2
        a00, a11, a22 = a00 + d - 0.5 * s00, a11 + d - 0.5 * s11, a22 + d - 0.5 * s22
        a01, a02, a12 = a01 - 0.5 * s01, a02 - 0.5 * s02, a12 - 0.5 * s12
        p00, p11, p22 = (
            p00 + kk * (d + s00 - d3 * h0 * h0),
            p11 + kk * (d + s11 - d3 * h1 * h1),
            p22 + kk * (d + s22 - d3 * h2 * h2),
        )
        p01, p02, p12 = (
            p01 + kk * (s01 - d3 * h0 * h1),
            p02 + kk * (s02 - d3 * h0 * h2),
            p12 + kk * (s12 - d3 * h1 * h2),
        )
        n0, n1, n2 = h1 * v2 - h2 * v1, h2 * v0 - h0 * v2, h0 * v1 - h1 * v0
        m00, m01, m02 = m00 + k * h0 * n0, m01 + k * (h0 * n1 + v2), m02 + k * (h0 * n2 - v1)
        m10, m11, m12 = m10 + k * (h1 * n0 - v2), m11 + k * h1 * n1, m12 + k * (h1 * n2 + v0)
        m20, m21, m22 = m20 + k * (h2 * n0 + v1), m21 + k * (h2 * n1 - v0), m22 + k * h2 * n2
    return (
        p00, p01, p02, m00, m01, m02, p11, p12, m10, m11, m12, p22, m20, m21, m22,
        a00, a01, a02, a11, a12, a22,
    )  # fmt: skip


@numba.njit(**OPTIONS)
def _damped(h, damping):
    f = 1.0 + damping
    return (
        h[0] * f, h[1], h[2], h[3], h[4], h[5], h[6] * f, h[7], h[8], h[9], h[10], h[11] * f, h[12], h[13],
        h[14], h[15] * f, h[16], h[17], h[18] * f, h[19], h[20] * f,
    )  # fmt: skip


@numba.njit(**OPTIONS)
def _move(p, q, anchor, d):
    """The step along the orbit about the anchor."""
    c = _dcm(*q)
    x, y, z = anchor[0] - p[0], anchor[1] - p[1], anchor[2] - p[2]
    t0 = c[0][0] * x + c[0][1] * y + c[0][2] * z
    t1 = c[1][0] * x + c[1][1] * y + c[1][2] * z
    t2 = c[2][0] * x + c[2][1] * y + c[2][2] * z
    m0 = t0 - d[0] - (d[4] * t2 - d[5] * t1)
    m1 = t1 - d[1] - (d[5] * t0 - d[3] * t2)
    m2 = t2 - d[2] - (d[3] * t1 - d[4] * t0)
    a, b, g = 0.5 * d[3], 0.5 * d[4], 0.5 * d[5]
    qx = q[3] * a + q[0] + q[1] * g - q[2] * b
    qy = q[3] * b + q[1] + q[2] * a - q[0] * g
    qz = q[3] * g + q[2] + q[0] * b - q[1] * a
    qw = q[3] - q[0] * a - q[1] * b - q[2] * g
    n = 1.0 / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    new = (qx * n, qy * n, qz * n, qw * n)
    c = _dcm(*new)
    return (
        anchor[0] - (c[0][0] * m0 + c[1][0] * m1 + c[2][0] * m2),
        anchor[1] - (c[0][1] * m0 + c[1][1] * m1 + c[2][1] * m2),
        anchor[2] - (c[0][2] * m0 + c[1][2] * m1 + c[2][2] * m2),
    ), new


@numba.njit(**OPTIONS)
def _start(landmarks, guess):
    ax = ay = az = 0.0
    n = landmarks.shape[0]
    for i in range(n):
        ax, ay, az = ax + landmarks[i, 0], ay + landmarks[i, 1], az + landmarks[i, 2]
    s2 = guess[3] * guess[3] + guess[4] * guess[4] + guess[5] * guess[5]
    k = 1.0 / (1.0 + s2)
    q = (2 * k * guess[3], 2 * k * guess[4], 2 * k * guess[5], (1 - s2) * k)
    return (ax / n, ay / n, az / n), (guess[0], guess[1], guess[2]), q


@numba.njit(**OPTIONS)
def _is_minimum(landmarks, los, weight, pose, equations):
    (p, q), (cost, g, h) = pose, equations
    floor = 64 * 2.220446049250313e-16**2 * weight * landmarks.shape[0]
    second = _second_order(landmarks, los, weight, p, q)
    exact = (
        h[0] + second[0], h[1] + second[1], h[2] + second[2], h[3] + second[3], h[4] + second[4],
        h[5] + second[5], h[6] + second[6], h[7] + second[7], h[8] + second[8], h[9] + second[9],
        h[10] + second[10], h[11] + second[11], h[12] + second[12], h[13] + second[13], h[14] + second[14],
        h[15] + second[15], h[16] + second[16], h[17] + second[17], h[18] + second[18], h[19] + second[19],
        h[20] + second[20],
    )  # fmt: skip
    lower, pivots, inverse = _ldl(exact)
    x = _solve(lower, inverse, g)
    decrement = 0.5 * (x[0] * g[0] + x[1] * g[1] + x[2] * g[2] + x[3] * g[3] + x[4] * g[4] + x[5] * g[5])
    rank = _ldl(h)[1]
    lp, la = 1e-14 * (h[0] + h[6] + h[11]), 1e-14 * (h[15] + h[18] + h[20])
    full = rank[0] > lp and rank[1] > lp and rank[2] > lp and rank[3] > la and rank[4] > la and rank[5] > la
    least = min(pivots[0], pivots[1], pivots[2], pivots[3], pivots[4], pivots[5])
    return full and least > 0 and decrement <= 1e-6 * cost + 1e3 * floor


@numba.njit(**OPTIONS)
def _levenberg_marquardt(landmarks, los, weight, guess, out):
    anchor, p, q = _start(landmarks, guess)
    floor = 64 * 2.220446049250313e-16**2 * weight * landmarks.shape[0]
    twice, g, h = _linearize(landmarks, los, weight, p, q)
    cost, damping, iterations = 0.5 * twice, 1e-3, 0
    while iterations < 50 and damping < 1e12:
        iterations += 1
        lower, pivots, inverse = _ldl(_damped(h, damping))
        d = _solve(lower, inverse, g)
        predicted = 0.5 * (
            d[0] * (damping * h[0] * d[0] + g[0])
            + d[1] * (damping * h[6] * d[1] + g[1])
            + d[2] * (damping * h[11] * d[2] + g[2])
            + d[3] * (damping * h[15] * d[3] + g[3])
            + d[4] * (damping * h[18] * d[4] + g[4])
            + d[5] * (damping * h[20] * d[5] + g[5])
        )
        solvable = min(pivots[0], pivots[1], pivots[2], pivots[3], pivots[4], pivots[5]) > 0
        trial_p, trial_q = _move(p, q, anchor, d)
        shift = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) * (h[0] + h[6] + h[11]) / (h[15] + h[18] + h[20])
        size2 = shift + d[3] * d[3] + d[4] * d[4] + d[5] * d[5]
        if solvable and (predicted <= floor or predicted <= 1e-12 * cost or size2 <= 1e-24):
            p, q = trial_p, trial_q
            break
        twice, trial_g, trial_h = _linearize(landmarks, los, weight, trial_p, trial_q)
        decrease = cost - 0.5 * twice
        gain = decrease / predicted
        if solvable and gain > 1e-4:
            p, q, g, h, cost = trial_p, trial_q, trial_g, trial_h, 0.5 * twice
            if gain > 0.75:
                damping = max(min(max(4 * (1 - gain) ** 2, 1e-4), 0.1) * damping, 1e-15)
            elif gain <= 0.25:
                damping *= 10
            if abs(decrease) <= 1e-12 * cost:
                break
        else:
            damping = max((10.0 if solvable else 100.0) * damping, 1e-5)
    twice, g, h = _linearize(landmarks, los, weight, p, q)
    cost = 0.5 * twice
    out[0], out[1], out[2] = p
    out[3], out[4], out[5], out[6] = q
    for i, value in enumerate(h):
        out[7 + i] = value
    out[28], out[29] = cost, iterations
    out[30] = _is_minimum(landmarks, los, weight, (p, q), (cost, g, h))


@numba.njit(**OPTIONS)
def solve(landmarks, los, sigma, guess, out):
    """One problem: ``(N, 3)``, ``(N, 3)``, rad, ``[position, mrp]``, ``(31,)``."""
    _levenberg_marquardt(landmarks, los, 1.0 / (sigma * sigma), guess, out)


@numba.njit(parallel=True, **OPTIONS)
def solve_batch(landmarks, los, sigma, guess, out):
    """Shared landmarks, ``(B, N, 3)`` directions, ``(B, 6)`` guesses, ``(B, 31)``."""
    for k in numba.prange(los.shape[0]):
        _levenberg_marquardt(landmarks, los[k], 1.0 / (sigma * sigma), guess[k], out[k])


def pose(out):
    """Position and dcm of a result."""
    return out[:3].copy(), np.array(_dcm(*out[3:7]))

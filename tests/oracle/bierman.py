"""Covariance in factors ``P = U D U'`` (Bierman 1977, Thornton 1976), for numbers of any kind.

Only ``+ - * /`` are used, so the same lines run in doubles, in single precision, in fractions and in the
sixty digits of :data:`DIGITS`. Matrices are lists of rows.
"""

from __future__ import annotations

import mpmath
import numpy as np

DIGITS = 60
mpmath.mp.dps = DIGITS


def long(a):
    """Vector or matrix of doubles in sixty digits."""
    if np.ndim(a) == 1:
        return [mpmath.mpf(float(v)) for v in a]
    return [[mpmath.mpf(float(v)) for v in row] for row in a]


def short(a):
    """Back to doubles."""
    return np.array([[float(v) for v in row] for row in a])


def factor(p):
    """(U, d) of a symmetric positive definite matrix; U unit upper triangular."""
    n = len(p)
    a = [list(row) for row in p]
    zero = a[0][0] * 0
    u = [[zero] * n for _ in range(n)]
    d = [zero] * n
    for j in reversed(range(n)):
        d[j] = a[j][j]
        u[j][j] = zero + 1
        for i in range(j):
            u[i][j] = a[i][j] / d[j]
        for i in range(j):
            for k in range(i + 1):
                a[k][i] = a[k][i] - u[k][j] * u[i][j] * d[j]
    return u, d


def compose(u, d):
    """U D U'."""
    n = len(d)
    return [[sum(u[i][k] * d[k] * u[j][k] for k in range(max(i, j), n)) for j in range(n)] for i in range(n)]


def bierman(u, d, h, r):
    """(U, d, K) after one scalar measurement ``h`` with variance ``r``."""
    n = len(d)
    u, d = [list(row) for row in u], list(d)
    f = [sum(h[k] * u[k][j] for k in range(j + 1)) for j in range(n)]
    v = [d[j] * f[j] for j in range(n)]
    alpha = r
    k = [r * 0] * n
    for j in range(n):
        before, alpha = alpha, alpha + f[j] * v[j]
        d[j] = d[j] * before / alpha
        step = -f[j] / before
        for i in range(j):
            old = u[i][j]
            u[i][j] = old + step * k[i]
            k[i] = k[i] + v[j] * old
        k[j] = k[j] + v[j]
    return u, d, [kj / alpha for kj in k]


def thornton(u, d, phi, g, q):
    """(U, d) of ``Phi P Phi' + G diag(q) G'`` by weighted Gram-Schmidt over ``[Phi U, G]``."""
    n, extra = len(d), len(q)
    moved = [[sum(phi[i][k] * u[k][j] for k in range(j + 1)) for j in range(n)] for i in range(n)]
    w = [moved[i] + [g[i][j] for j in range(extra)] for i in range(n)]
    weight = list(d) + list(q)
    zero = d[0] * 0
    out_u = [[zero] * n for _ in range(n)]
    out_d = [zero] * n
    for j in reversed(range(n)):
        weighted = [weight[k] * w[j][k] for k in range(n + extra)]
        out_d[j] = sum(w[j][k] * weighted[k] for k in range(n + extra))
        out_u[j][j] = zero + 1
        for i in range(j):
            out_u[i][j] = sum(w[i][k] * weighted[k] for k in range(n + extra)) / out_d[j]
            w[i] = [w[i][k] - out_u[i][j] * w[j][k] for k in range(n + extra)]
    return out_u, out_d


def filter_covariance(p, steps):
    """Covariance after ``steps``: each ``(Phi, Q, [(h, r), ...])``, ``Q`` positive definite or ``None``."""
    u, d = factor(p)
    for phi, q, measurements in steps:
        if phi is not None:
            g, weights = factor(q) if q is not None else ([[] for _ in d], [])
            u, d = thornton(u, d, phi, g, weights)
        for h, r in measurements:
            u, d, _ = bierman(u, d, h, r)
    return compose(u, d)


def joseph_scalar(p, h, r):
    """Joseph's form for one scalar measurement, for numbers of any kind."""
    n = len(p)
    ph = [sum(p[i][k] * h[k] for k in range(n)) for i in range(n)]
    s = sum(h[k] * ph[k] for k in range(n)) + r
    gain = [v / s for v in ph]
    rest = [[(1 if i == j else 0) - gain[i] * h[j] for j in range(n)] for i in range(n)]
    half = [[sum(rest[i][k] * p[k][j] for k in range(n)) for j in range(n)] for i in range(n)]
    return [
        [sum(half[i][k] * rest[j][k] for k in range(n)) + gain[i] * r * gain[j] for j in range(n)]
        for i in range(n)
    ]

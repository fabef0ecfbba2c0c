"""Lie derivatives twice: by nested differences in many digits, and exactly over the rational numbers.

Equation (V1): ``L_f^0 h = h``, ``L_f^k h = d(L_f^{k-1} h)/dx f``.
"""

from fractions import Fraction

import mpmath as mp
import numpy as np

# Central differences, one inside the other: each leaves the square of the step, and the rounding of all of
# them together is 1e-150 over the step to the seventh power, in units in which the motion is of order one.
DIGITS = 150
STEP = "1e-14"


def gradients(f, h, x, *, order, units, pace):
    """``pace^k d(L_f^k h)/dx`` times ``units``, ``((order + 1) M, N)``, by nested central differences.

    ``f`` and ``h`` take and return lists of mpf, in SI.
    """
    with mp.workdps(DIGITS):
        sizes, time, step = [mp.mpf(float(u)) for u in units], mp.mpf(float(pace)), mp.mpf(STEP)

        def derivative(k, state):
            if k == 0:
                return h(state)
            ahead, behind = (
                [a + s * step * time * b for a, b in zip(state, f(state), strict=True)] for s in (1, -1)
            )
            pairs = zip(derivative(k - 1, ahead), derivative(k - 1, behind), strict=True)
            return [(a - b) / (2 * step) for a, b in pairs]

        start = [mp.mpf(float(value)) for value in x]
        rows = []
        for k in range(order + 1):
            columns = []
            for j, size in enumerate(sizes):
                moved = [[v + s * step * size * (i == j) for i, v in enumerate(start)] for s in (1, -1)]
                ends = zip(derivative(k, moved[0]), derivative(k, moved[1]), strict=True)
                columns.append([float((a - b) / (2 * step)) for a, b in ends])
            rows.append(np.array(columns).T)
        return np.concatenate(rows)


# --- equations, written from the specification ----------------------------------------------------------


def two_body(mu, j2=0.0, radius=0.0):
    def f(x):
        r2 = x[0] ** 2 + x[1] ** 2 + x[2] ** 2
        pull = -mp.mpf(mu) / (r2 * mp.sqrt(r2))
        lift, tilt = mp.mpf(3) / 2 * mp.mpf(j2) * mp.mpf(radius) ** 2 / r2, 5 * x[2] ** 2 / r2
        return [*x[3:], *(pull * x[i] * (1 + lift * ((3 if i == 2 else 1) - tilt)) for i in range(3))]

    return f


def clohessy_wiltshire(rate, control=(0.0, 0.0, 0.0)):
    w, u = mp.mpf(rate), [mp.mpf(c) for c in control]

    def f(x):
        return [*x[3:], 2 * w * x[5] + u[0], -(w**2) * x[1] + u[1], 3 * w**2 * x[2] - 2 * w * x[3] + u[2]]

    return f


def seen(dcm, target):
    """The target in body axes."""
    a, t = [[mp.mpf(float(v)) for v in row] for row in dcm], [mp.mpf(float(v)) for v in target]
    return lambda x: [sum(row[i] * (t[i] - x[i]) for i in range(3)) for row in a]


def length(v):
    return mp.sqrt(sum(c**2 for c in v))


def direction(dcm, target=(0, 0, 0)):
    look = seen(dcm, target)
    return lambda x: [c / length(look(x)) for c in look(x)]


def range_bearing(dcm, target=(0, 0, 0)):
    look = seen(dcm, target)

    def h(x):
        a, b, c = look(x)
        return [length([a, b, c]), mp.atan2(b, a), mp.asin(c / length([a, b, c]))]

    return h


def range_rate(target=(0, 0, 0)):
    t = [mp.mpf(float(v)) for v in target]

    def h(x):
        away = [a - b for a, b in zip(x[:3], t, strict=True)]
        return [sum(a * v for a, v in zip(away, x[3:], strict=True)) / length(away)]

    return h


# --- the direction to the Sun as polynomials in r, v and s = 1/|r|, mu = 1 -------------------------------

# A polynomial is {exponents of (x, y, z, u, v, w, s): coefficient}.


def _times(p, monomial, factor):
    return {tuple(a + b for a, b in zip(e, monomial, strict=True)): factor * c for e, c in p.items()}


def _sum(*terms):
    total = {}
    for term in terms:
        for e, c in term.items():
            total[e] = total.get(e, 0) + c
    return {e: c for e, c in total.items() if c}


def _by(p, i):
    out = {}
    for e, c in p.items():
        if e[i]:
            out[tuple(n - (k == i) for k, n in enumerate(e))] = c * e[i]
    return out


def _unit(*powers):
    e = [0] * 7
    for i, n in powers:
        e[i] += n
    return tuple(e)


def along_the_orbit(p):
    """``L_f p = p_r . v - s^3 r . p_v - s^3 (r . v) p_s``."""
    terms = []
    for i in range(3):
        terms.append(_times(_by(p, i), _unit((3 + i, 1)), 1))
        terms.append(_times(_by(p, 3 + i), _unit((i, 1), (6, 3)), -1))
        terms.append(_times(_by(p, 6), _unit((i, 1), (3 + i, 1), (6, 3)), -1))
    return _sum(*terms)


def exact_gradients(state, inverse_distance, order):
    """Rows of ``d(L_f^k h)/dx`` for the Sun's direction; the state, ``1/|r|`` and the rows are fractions."""
    point = [*state, inverse_distance]

    def value(p):
        total = Fraction(0)
        for e, c in p.items():
            term = Fraction(c)
            for base, n in zip(point, e, strict=True):
                term *= base**n
            total += term
        return total

    rows = []
    derivatives = [{_unit((i, 1), (6, 1)): -1} for i in range(3)]
    for _ in range(order + 1):
        for p in derivatives:
            by_s = value(_by(p, 6))
            places = [value(_by(p, i)) - inverse_distance**3 * state[i] * by_s for i in range(3)]
            rows.append([*places, *(value(_by(p, 3 + i)) for i in range(3))])
        derivatives = [along_the_orbit(p) for p in derivatives]
    return rows


def exact_rank(rows):
    """By elimination, without rounding."""
    rows, rank = [list(row) for row in rows], 0
    for column in range(len(rows[0])):
        pivot = next((i for i in range(rank, len(rows)) if rows[i][column]), None)
        if pivot is None:
            continue
        rows[rank], rows[pivot] = rows[pivot], rows[rank]
        for i in range(rank + 1, len(rows)):
            factor = rows[i][column] / rows[rank][column]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[rank], strict=True)]
        rank += 1
    return rank

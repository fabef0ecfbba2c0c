"""Inertial navigation in a turning frame, in plain NumPy: motion, the step, and how errors move.

Here quaternions are scalar first, ``q = [w, x, y, z]``, body to site, and everything accepts complex numbers.
"""

import numpy as np


def product(p, q):
    """Hamilton product."""
    a, u, b, v = p[0], p[1:], q[0], q[1:]
    return np.concatenate([[a * b - u @ v], a * v + b * u + np.cross(u, v)])


def exp(turn):
    """``[cos, e sin]`` of half a rotation vector."""
    square = turn @ turn
    if abs(square) < 1e-24:
        return np.concatenate([[1 - square / 8], turn / 2])
    angle = np.sqrt(square)
    return np.concatenate([[np.cos(angle / 2)], turn / angle * np.sin(angle / 2)])


def log(q):
    """Rotation vector of a small rotation."""
    size = np.sqrt(q[1:] @ q[1:])
    if abs(size) < 1e-15:
        return 2 * q[1:] / q[0]
    return 2 * np.arctan(size / q[0]) * q[1:] / size


def rotation(q):
    """``v_site = C v_body``."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def cross_matrix(v):
    """``[v x]``."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


class Landing:
    """The frame and the field: ``field(x) -> g`` in body-fixed axes."""

    def __init__(self, site_from_fixed, center, rate, field):
        self.turn, self.center, self.rate, self.field = site_from_fixed, center, rate, field

    def acceleration(self, r, v, push):
        """``v'`` of a push in site axes."""
        w, arm = self.rate, self.center + r
        pull = self.turn @ self.field(self.turn.T @ arm)
        return push + pull - 2 * np.cross(w, v) - np.cross(w, np.cross(w, arm))

    def step(self, state, dt, force, rate, tau=np.inf):
        """``(r, v, q, b_a, b_g, d)`` after ``dt`` by the classical rule of order 4, the attitude exactly."""
        r, v, q, ba, bg, d = state
        f, body = force - ba, rate - bg

        def at(share):
            h = share * dt
            turned = product(product(exp(-self.rate * h), q), exp(body * h))
            return rotation(turned) @ f + d * np.exp(-h / tau)

        a1 = self.acceleration(r, v, at(0.0))
        v2 = v + dt / 2 * a1
        a2 = self.acceleration(r + dt / 2 * v, v2, at(0.5))
        v3 = v + dt / 2 * a2
        a3 = self.acceleration(r + dt / 2 * v2, v3, at(0.5))
        v4 = v + dt * a3
        a4 = self.acceleration(r + dt * v3, v4, at(1.0))
        end = product(product(exp(-self.rate * dt), q), exp(body * dt))
        return (
            r + dt / 6 * (v + 2 * v2 + 2 * v3 + v4),
            v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4),
            end,
            ba,
            bg,
            d * np.exp(-dt / tau),
        )

    def errors(self, state, force, rate, gradient, tau=np.inf):
        """``F`` of ``[dr dv da db_a db_g dd]``; ``gradient`` in body-fixed axes at the place."""
        _, _, q, ba, bg, _ = state
        c, w, one = rotation(q), cross_matrix(self.rate), np.eye(3)
        f = np.zeros((18, 18))
        f[0:3, 3:6] = one
        f[3:6, 0:3] = self.turn @ gradient @ self.turn.T - w @ w
        f[3:6, 3:6] = -2 * w
        f[3:6, 6:9] = -c @ cross_matrix(force - ba)
        f[3:6, 9:12] = -c
        f[3:6, 15:18] = one
        f[6:9, 6:9] = -cross_matrix(rate - bg)
        f[6:9, 12:15] = -one
        f[15:18, 15:18] = -one / tau
        return f


def noise_inputs(q):
    """How ``[n_a n_g n_ba n_bg n_d]`` enter the errors, ``(18, 15)``."""
    g = np.zeros((18, 15))
    g[3:6, 0:3] = -rotation(q)
    g[6:9, 3:6] = -np.eye(3)
    g[9:12, 6:9] = g[12:15, 9:12] = g[15:18, 12:15] = np.eye(3)
    return g


def added(state, delta):
    """State with an error put in, true minus estimate; works on complex errors."""
    r, v, q, ba, bg, d = state
    return (
        r + delta[0:3],
        v + delta[3:6],
        product(q, exp(delta[6:9])),
        ba + delta[9:12],
        bg + delta[12:15],
        d + delta[15:18],
    )


def difference(state, other):
    """Error that leads from ``other`` to ``state``."""
    turn = product(other[2] * np.array([1, -1, -1, -1]), state[2])
    parts = [state[k] - other[k] for k in (0, 1, 3, 4, 5)]
    return np.concatenate([*parts[:2], log(turn), *parts[2:]])

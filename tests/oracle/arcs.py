"""The whole arc at once: maximum a posteriori least squares with process noise, and errors by their sources.

Unknowns are the states at all epochs. The cost is ``|x_0 - m_0|^2`` in the prior, ``|x_k - f(x_{k-1})|^2``
in ``Q`` for every step and ``|z_k [-] h(x_k)|^2`` in ``R``; every term is whitened by a Cholesky factor and
the linear problems are solved by QR. No covariance is ever propagated here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.oracle.kalman import linearise


def whiten(covariance, *rows):
    """L^-1 of each, ``L L'`` the covariance."""
    root = np.linalg.cholesky(covariance)
    return [np.linalg.solve(root, r) for r in rows]


@dataclass(frozen=True)
class Arc:
    """What a batch is told: the prior is (mean, covariance) at ``start``, the first step leads from there to
    ``times[0]``; the noise of every step must be positive definite."""

    model: object
    prior: tuple
    times: np.ndarray
    measurements: list
    start: float = 0.0
    controls: np.ndarray | None = None

    def steps(self):
        """(dt, control) of each step."""
        epochs = [self.start, *self.times]
        for k in range(len(self.times)):
            yield epochs[k + 1] - epochs[k], None if self.controls is None else self.controls[k]


def normal_rows(arc, leaving, reached):
    """(A, b) of the linear problem ``|A X - b|^2``: steps linearised at the states they leave from,
    measurements at those reached."""
    mean, covariance = arc.prior
    n, count = len(mean), len(arc.times)
    blocks, right = [], []

    def add(noise, columns, target):
        row = np.zeros((len(target), n * (count + 1)))
        for index, matrix in columns:
            row[:, n * index : n * (index + 1)] = matrix
        white, goal = whiten(noise, row, target)
        blocks.append(white)
        right.append(goal)

    add(covariance, [(0, np.eye(n))], mean)
    for k, (dt, u) in enumerate(arc.steps()):
        x = leaving[k]
        phi = arc.model.transition(x, dt, u)
        offset = arc.model.propagate(x, dt, u) - phi @ x
        add(arc.model.process_noise(x, dt), [(k + 1, np.eye(n)), (k, -phi)], offset)
        for sensor, z in arc.measurements:
            if np.isnan(z[k]).any():
                continue
            rows = linearise(sensor[k] if isinstance(sensor, list) else sensor, reached[k], z[k])
            add(rows.noise, [(k + 1, rows.jacobian)], rows.innovation + rows.jacobian @ reached[k])
    return np.vstack(blocks), np.concatenate(right)


def solve(a, b, n):
    """(states, covariances) of the epochs, the prior's left out."""
    q, r = np.linalg.qr(a)
    x = np.linalg.solve(r, q.T @ b)
    root = np.linalg.inv(r)
    whole = root @ root.T
    count = len(x) // n
    covariances = [whole[n * k : n * (k + 1), n * k : n * (k + 1)] for k in range(1, count)]
    return x.reshape(count, n)[1:], np.array(covariances), x[:n]


def linear_batch(arc, log):
    """(states, covariances) with every term linearised where the filter that wrote ``log`` linearised it."""
    a, b = normal_rows(arc, [arc.prior[0], *log.state[:-1]], log.predicted)
    return solve(a, b, len(arc.prior[0]))[:2]


def batch(arc, iterations=30):
    """Gauss-Newton to the maximum a posteriori of the nonlinear arc; starts from the propagated mean."""
    states = [arc.prior[0]]
    for dt, u in arc.steps():
        states.append(arc.model.propagate(states[-1], dt, u))
    for _ in range(iterations):
        x, p, first = solve(*normal_rows(arc, states[:-1], states[1:]), len(states[0]))
        step = np.abs((x - states[1:]) / np.sqrt(np.einsum("kii->ki", p))).max()
        states = [first, *x]
        if step < 1e-11:
            break
    return x, p


def errors_by_source(prior, steps):
    """Covariance of the true error of an estimator with given gains, by brute force.

    ``steps``: each ``(Phi, Q, H, K, R)``. The error is kept as a matrix that multiplies independent unit
    sources (prior, every process noise, every measurement noise): one set of columns is added for each.
    """
    spread = np.linalg.cholesky(prior)
    for phi, q, h, k, r in steps:
        values, vectors = np.linalg.eigh(q)
        spread = np.hstack([phi @ spread, vectors * np.sqrt(np.maximum(values, 0.0))])
        spread = np.hstack([spread - k @ (h @ spread), -k @ np.linalg.cholesky(r)])
    return spread @ spread.T

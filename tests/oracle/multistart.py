"""Brute-force search for every minimum of a pose problem, many starts or many problems at once.

Vectorised over a leading axis because it is meant to be run by the ten thousand: the arithmetic is that
of `pose.minimise` with isotropic weights, and a test holds the two together.
"""

from __future__ import annotations

import numpy as np

from tests.oracle.attitude import dcm_from_quaternion


def attitude_grid(count, seed=0):
    """(count, 3, 3) uniformly distributed attitudes."""
    q = np.random.default_rng(seed).standard_normal((count, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    return np.array([dcm_from_quaternion(row) for row in q])


def cross_matrices(a):
    """[a x] over leading axes."""
    x = np.zeros((*a.shape, 3))
    x[..., 0, 1], x[..., 0, 2], x[..., 1, 2] = -a[..., 2], a[..., 1], -a[..., 0]
    return x - np.swapaxes(x, -1, -2)


def exponentials(phi):
    """exp(-[phi x]) over leading axes."""
    theta = np.linalg.norm(phi, axis=-1)[..., None, None]
    x = cross_matrices(phi)
    return np.eye(3) - np.sinc(theta / np.pi) * x + 0.5 * np.sinc(theta / (2 * np.pi)) ** 2 * x @ x


def nearest_points(landmarks, los, dcms):
    """For each attitude, the point nearest to the lines through the landmarks along the measured LOS."""
    r = np.einsum("...ji,...nj->...ni", dcms, los)
    across = np.eye(3) - r[..., :, None] * r[..., None, :]
    right = np.einsum("...nij,...nj->...i", across, np.broadcast_to(landmarks, r.shape))
    normal = across.sum(axis=-3) + 1e-12 * np.eye(3)
    return np.linalg.solve(normal, right[..., None])[..., 0]


def residuals(landmarks, los, positions, dcms):
    """Measured minus predicted LOS, and the geometry they came from: e, r, rho."""
    d = landmarks - positions[..., None, :]
    rho = np.linalg.norm(d, axis=-1)
    r = d / rho[..., None]
    return los - np.einsum("...ij,...nj->...ni", dcms, r), r, rho


def costs(landmarks, los, sigma, positions, dcms):
    """Half the weighted sum of squares of each pose."""
    e, _, _ = residuals(landmarks, los, positions, dcms)
    return 0.5 * np.sum((e / sigma) ** 2, axis=(-1, -2))


def minimise(landmarks, los, sigma, positions, dcms, *, iterations=100):
    """Levenberg-Marquardt of S problems: shapes (S or 1, N, 3), (S or 1, N, 3), (S, 3), (S, 3, 3).

    ``sigma`` is a scalar or (S, 1, 1). Returns positions, dcms, costs and the norm of the gradient in
    columns of unit length relative to the residual's, small at a stationary point.
    """
    count = len(positions)
    landmarks = np.broadcast_to(landmarks, (count, *landmarks.shape[-2:]))
    los = np.broadcast_to(los, landmarks.shape)
    sigma = np.broadcast_to(sigma, (count, 1, 1))
    damping = np.full(count, 1e-3)
    best = costs(landmarks, los, sigma, positions, dcms)
    active = np.arange(count)
    slope = np.full(count, np.inf)
    positions, dcms = positions.copy(), dcms.copy()
    for _ in range(iterations):
        lm, b, s = landmarks[active], los[active], sigma[active]
        e, r, rho = residuals(lm, b, positions[active], dcms[active])
        along = r[..., :, None] * r[..., None, :] - np.eye(3)
        by_position = np.einsum("sij,snjk->snik", dcms[active], along) / rho[..., None, None]
        by_attitude = cross_matrices(np.einsum("sij,snj->sni", dcms[active], r))
        rows = np.concatenate([by_position, by_attitude], axis=-1).reshape(len(active), -1, 6) / s
        e = e.reshape(len(active), -1) / s[..., 0]
        scale = np.linalg.norm(rows, axis=1)
        rows /= scale[:, None, :]
        normal = np.einsum("sri,srj->sij", rows, rows) + damping[active, None, None] * np.eye(6)
        down = np.einsum("sri,sr->si", rows, e)
        step = np.linalg.solve(normal, down[..., None])[..., 0]
        slope[active] = np.linalg.norm(down, axis=1) / np.maximum(np.linalg.norm(e, axis=1), 1e-300)
        step_scaled = step / scale
        new_positions = positions[active] + step_scaled[:, :3]
        new_dcms = exponentials(step_scaled[:, 3:]) @ dcms[active]
        new = costs(lm, b, s, new_positions, new_dcms)
        better = new <= best[active]
        taken = active[better]
        positions[taken], dcms[taken], best[taken] = new_positions[better], new_dcms[better], new[better]
        damping[active] = np.where(better, np.maximum(damping[active] / 10, 1e-15), damping[active] * 10)
        small = np.linalg.norm(step, axis=1) <= 1e-12 * (1e-3 + np.linalg.norm(e, axis=1))
        active = active[~(small | (damping[active] > 1e10))]
        if not len(active):
            break
    return positions, dcms, best, slope


def distinct(positions, dcms, best, position_scale, tolerance=1e-5):
    """Indices of the different poses, lowest cost first."""
    kept = []
    for i in np.argsort(best):
        if not np.isfinite(best[i]):
            continue
        if all(
            np.linalg.norm(positions[i] - positions[j]) > tolerance * position_scale
            or np.linalg.norm(dcms[i] - dcms[j]) > tolerance
            for j in kept
        ):
            kept.append(i)
    return kept


def all_minima(landmarks, los, sigma, starts=200, seed=0):
    """Every minimum reached from ``starts`` uniform attitudes: list of (cost, position, dcm), best first."""
    dcms = attitude_grid(starts, seed)
    positions = nearest_points(landmarks[None], los[None], dcms)
    positions, dcms, best, _ = minimise(landmarks[None], los[None], sigma, positions, dcms)
    size = np.linalg.norm(landmarks - landmarks.mean(axis=0), axis=1).max()
    return [(best[i], positions[i], dcms[i]) for i in distinct(positions, dcms, best, size)]

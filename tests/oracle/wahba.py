"""Attitude from directions: Wahba's loss, its minimum by SVD, its covariance, written from the formulas.

Another factorisation than the library's: LAPACK's SVD of the profile matrix, then Gauss-Newton by QR on the
stacked, whitened rows, which forms no normal equations.
"""

from __future__ import annotations

import numpy as np

from tests.oracle.attitude import cross_matrix, dcm_from_rotation_vector


def profile_matrix(body, reference, weights):
    """B = sum w b r' (A2)."""
    b = np.zeros((3, 3))
    for direction, star, weight in zip(body, reference, weights, strict=True):
        b += weight * np.outer(direction, star)
    return b


def loss(dcm, body, reference, sigma):
    """J = 1/2 sum |b - A r|^2 / sigma^2 (A1)."""
    residuals = (body - reference @ dcm.T) / np.asarray(sigma)[..., None]
    return 0.5 * np.sum(residuals**2)


def solve_svd(body, reference, sigma):
    """Markley 1988: A = U diag(1, 1, det U det V) V'; normalised weights."""
    weights = 1 / np.asarray(sigma, dtype=float) ** 2
    u, _, vt = np.linalg.svd(profile_matrix(body, reference, weights / weights.sum()))
    return u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(vt)]) @ vt


def refine(dcm, body, reference, sigma, steps=8):
    """Gauss-Newton on the residuals by QR: digits that B has lost come back."""
    sigma = np.asarray(sigma, dtype=float)
    for _ in range(steps):
        predicted = reference @ dcm.T
        rows = np.vstack([cross_matrix(h) / s for h, s in zip(predicted, sigma, strict=True)])
        residuals = np.concatenate([(b - h) / s for b, h, s in zip(body, predicted, sigma, strict=True)])
        delta = np.linalg.lstsq(rows, residuals, rcond=None)[0]
        dcm = dcm_from_rotation_vector(delta) @ dcm
    return dcm


def information(directions, sigma):
    """F = sum (I - b b') / sigma^2 (A4)."""
    f = np.zeros((3, 3))
    for b, s in zip(directions, sigma, strict=True):
        f += (np.eye(3) - np.outer(b, b)) / s**2
    return f


def measure(reference, dcm, sigma, rng):
    """Unit vectors with the noise model of QUEST: isotropic in the tangent plane."""
    true = reference @ dcm.T
    noise = np.asarray(sigma)[..., None] * rng.standard_normal(true.shape)
    noisy = true + noise - true * np.sum(noise * true, axis=-1, keepdims=True)
    return noisy / np.linalg.norm(noisy, axis=-1, keepdims=True)


def directions(count, rng, width=None):
    """Uniform unit vectors: over the sphere, or within ``width`` rad of a random axis."""
    v = rng.standard_normal((count, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    if width is None:
        return v
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    near = axis + width * (v - axis * (v @ axis)[:, None])
    return near / np.linalg.norm(near, axis=1, keepdims=True)

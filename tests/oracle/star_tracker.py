"""Multi-head star trackers from the equations: rotated stars, stacked rows, numerical derivatives, loops.

Frames: ``b`` head axes, ``S`` fusion from head, ``A`` fusion from reference. Errors are ``dalpha`` with
``A_true = exp(-[dalpha x]) A``.
"""

from __future__ import annotations

import itertools

import numpy as np

from tests.oracle.attitude import cross_matrix, dcm_from_rotation_vector

ARCSEC = np.pi / 180 / 3600
SPEED_OF_LIGHT = 299_792_458.0


def loss(mountings, stars, catalogue, sigmas, dcm):
    """Equation (1): half the weighted squared distances, all heads together."""
    total = 0.0
    for mounting, body, reference, sigma in zip(mountings, stars, catalogue, sigmas, strict=True):
        for b, r in zip(body, reference, strict=True):
            total += 0.5 / sigma**2 * np.sum((mounting @ b - dcm @ r) ** 2)
    return total


def stacked_rows(mountings, stars, sigmas):
    """Whitened rows of the linearised problem: three for every star, in fusion axes."""
    rows = [
        cross_matrix(mounting @ b) / sigma
        for mounting, body, sigma in zip(mountings, stars, sigmas, strict=True)
        for b in body
    ]
    return np.concatenate(rows)


def covariance_from_stars(mountings, stars, sigmas):
    """Equation (14) by a QR factorisation of the stacked rows."""
    triangle = np.linalg.qr(stacked_rows(mountings, stars, sigmas), mode="r")
    root = np.linalg.solve(triangle, np.eye(3))
    return root @ root.T


def fused_covariance(covariances, mountings):
    """Equation (17) as a weighted least-squares problem: each head is one measurement of the attitude."""
    rows = [np.linalg.inv(np.linalg.cholesky(p)) @ s.T for p, s in zip(covariances, mountings, strict=True)]
    triangle = np.linalg.qr(np.concatenate(rows), mode="r")
    root = np.linalg.solve(triangle, np.eye(3))
    return root @ root.T


def hessian(function, step):
    """Central second differences at zero of a function of three numbers."""
    result = np.empty((3, 3))
    for i, j in itertools.product(range(3), repeat=2):
        total = 0.0
        for si, sj in itertools.product((1, -1), repeat=2):
            total += si * sj * function(step * (si * np.eye(3)[i] + sj * np.eye(3)[j]))
        result[i, j] = total / (4 * step**2)
    return result


def loss_hessian(mountings, stars, catalogue, sigmas, dcm, *, step=1e-3):
    """Numerical second derivative of the loss by the attitude error."""
    return hessian(
        lambda xi: loss(mountings, stars, catalogue, sigmas, dcm_from_rotation_vector(xi) @ dcm), step
    )


def svd_attitude(mountings, stars, catalogue, sigmas):
    """Markley's SVD solution of the fused Wahba problem."""
    profile = np.zeros((3, 3))
    for mounting, body, reference, sigma in zip(mountings, stars, catalogue, sigmas, strict=True):
        for b, r in zip(body, reference, strict=True):
            profile += np.outer(mounting @ b, r) / sigma**2
    u, _, vt = np.linalg.svd(profile)
    return u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(vt)]) @ vt


def sigma_z(s, k, t):
    """Three identical axisymmetric heads, pairwise angle t: rotation about head 1's boresight (section 3)."""
    c = 1 - 1 / k**2
    one, two = 1 + 2 * np.cos(t), 1 - np.cos(t)
    return s * np.sqrt(one / 3 / (3 - c * one) + 2 * two / 3 / (3 - c * two))


def turned(boresight, roll=0.0):
    """Some mounting with that boresight: x from a Gram-Schmidt of the least parallel axis."""
    z = np.asarray(boresight, float) / np.linalg.norm(boresight)
    x = np.eye(3)[np.argmin(np.abs(z))]
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    c, s = np.cos(roll), np.sin(roll)
    return np.column_stack([c * x + s * y, c * y - s * x, z])


def square_field(rng, count, fov):
    """Stars uniform on a square detector."""
    plane = np.tan(fov / 2) * rng.uniform(-1, 1, (count, 2))
    v = np.column_stack([plane, np.ones(count)])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def quest_noise(rng, b, sigma):
    """Disturbed across the direction: a tangent basis by cross products."""
    out = []
    for v in b:
        basis = turned(v)
        w = v + sigma * (rng.standard_normal() * basis[:, 0] + rng.standard_normal() * basis[:, 1])
        out.append(w / np.linalg.norm(w))
    return np.reshape(out, (-1, 3))


def pixel_noise(rng, b, sigma_over_focal):
    """Noise on the focal plane of a pinhole camera looking along +z."""
    plane = b[..., :2] / b[..., 2:] + sigma_over_focal * rng.standard_normal((*b.shape[:-1], 2))
    v = np.concatenate([plane, np.ones((*b.shape[:-1], 1))], axis=-1)
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def aberrated(direction, velocity):
    """A photon's momentum boosted into the observer's frame by a 4 x 4 Lorentz matrix."""
    beta = np.asarray(velocity) / SPEED_OF_LIGHT
    square = beta @ beta
    gamma = 1 / np.sqrt(1 - square)
    boost = np.eye(4)
    boost[0, 0] = gamma
    boost[0, 1:] = boost[1:, 0] = -gamma * beta
    if square > 0:
        boost[1:, 1:] += (gamma - 1) * np.outer(beta, beta) / square
    momentum = boost @ np.concatenate([[1.0], -np.asarray(direction)])
    return -momentum[1:] / np.linalg.norm(momentum[1:])


def best_subset(body, sigmas, count, measure):
    """Exhaustive search: the subset with the least measure of its covariance."""
    best, chosen = np.inf, None
    for subset in itertools.combinations(range(len(body)), count):
        information = sum((np.eye(3) - np.outer(body[i], body[i])) / sigmas[i] ** 2 for i in subset)
        if np.linalg.eigvalsh(information)[0] > 1e-9 * np.trace(information):
            value = measure(np.linalg.inv(information))
            if value < best:
                best, chosen = value, subset
    return chosen, best

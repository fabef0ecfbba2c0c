"""Lines of sight to known landmarks: prediction, Jacobians, noise models, Fisher information.

b_i = A r_i with r_i = (L_i - p)/|L_i - p|: the unit vector from the observer to the landmark, in body
components. Tangent order is [dp, dalpha], error sense true minus estimate, attitude error
``dcm_true = exp(-[dalpha x]) dcm_estimate``.
"""

from __future__ import annotations

import numpy as np

from tests.oracle.attitude import cross_matrix, dcm_from_mrp


def los_from_dcm(landmarks, position, dcm):
    """Equation (1), one landmark at a time; complex-safe."""
    rows = []
    for landmark in landmarks:
        d = landmark - position
        rows.append(dcm @ d / np.sqrt(d @ d))
    return np.array(rows)


def predict_los(landmarks, position, mrp):
    """Equation (1) with the attitude as MRP."""
    return los_from_dcm(landmarks, position, dcm_from_mrp(mrp))


def los_jacobian(landmarks, position, mrp):
    """Equations (6), (11), (12): (N, 3, 6), columns [p, mrp]."""
    dcm = dcm_from_mrp(mrp)
    s2 = mrp @ mrp
    bracket = (1 - s2) * np.eye(3) - 2 * cross_matrix(mrp) + 2 * np.outer(mrp, mrp)
    blocks = []
    for landmark in landmarks:
        d = landmark - position
        rho = np.sqrt(d @ d)
        r = d / rho
        by_position = -dcm @ (np.eye(3) - np.outer(r, r)) / rho
        by_mrp = 4 / (1 + s2) ** 2 * cross_matrix(dcm @ r) @ bracket
        blocks.append(np.hstack([by_position, by_mrp]))
    return np.array(blocks)


def los_tangent_jacobian(landmarks, position, dcm):
    """G_i = [A [r x]^2 / rho, [b x]]: (N, 3, 6), columns [dp, dalpha]."""
    blocks = []
    for landmark in landmarks:
        d = landmark - position
        rho = np.sqrt(d @ d)
        r = d / rho
        blocks.append(np.hstack([dcm @ cross_matrix(r) @ cross_matrix(r) / rho, cross_matrix(dcm @ r)]))
    return np.array(blocks)


# --- the three noise models, as covariances of one LOS b ---------------------------------------------


def isotropic_covariance(b, sigma):
    """Model 1: the three components are independently disturbed, the measurement is not unit."""
    del b
    return sigma**2 * np.eye(3)


def tangent_covariance(b, sigma):
    """Model 2 (QUEST): noise in the tangent plane, then renormalised; rank 2."""
    return sigma**2 * (np.eye(3) - np.outer(b, b))


def focal_plane_covariance(b, sigma_metres, focal_length):
    """Model 3: white noise of std ``sigma_metres`` on the focal plane; rank 2.

    A displacement in the focal plane moves b by (I - bb') E / (f/|b3|), E = [e1 e2] up to sign.
    """
    slope = (np.eye(3) - np.outer(b, b))[:, :2] * abs(b[2]) / focal_length
    return sigma_metres**2 * slope @ slope.T


def weight_from_covariance(covariance, b):
    """(R + c bb')^-1 with c = tr R / 2: the inverse on the tangent plane of b.

    For model 1 or any full-rank R the term along b makes no difference to an estimate or to its covariance
    to first order, because b'H = 0; for rank-2 R it makes the matrix invertible.
    """
    return np.linalg.inv(covariance + np.trace(covariance) / 2 * np.outer(b, b))


def isotropic_weights(sigma, count):
    """(N, 3, 3) weights I/sigma_i^2 for scalar or per-landmark sigma: models 1 and 2."""
    return np.array([np.eye(3) / s**2 for s in np.broadcast_to(sigma, (count,))])


def fisher_information(landmarks, position, mrp, weights):
    """Sum of G_i' W_i G_i, order [dp, dalpha]."""
    jacobian = los_tangent_jacobian(landmarks, position, dcm_from_mrp(mrp))
    return sum(g.T @ w @ g for g, w in zip(jacobian, weights, strict=True))


def fisher_information_paper(landmarks, position, mrp, sigmas):
    """Equation (38) as printed: order [dalpha, p], isotropic sigma_i."""
    dcm = dcm_from_mrp(mrp)
    f = np.zeros((6, 6))
    for landmark, s in zip(landmarks, sigmas, strict=True):
        d = landmark - position
        rho = np.sqrt(d @ d)
        r_cross = cross_matrix(d / rho)
        ar_cross = cross_matrix(dcm @ d / rho)
        f[:3, :3] -= ar_cross @ ar_cross / s**2
        f[:3, 3:] += dcm @ r_cross / rho / s**2
        f[3:, :3] += r_cross.T @ dcm.T / rho / s**2
        f[3:, 3:] -= r_cross @ r_cross / rho**2 / s**2
    return f


# --- simulation -------------------------------------------------------------------------------------


def measure_isotropic(los, sigma, rng):
    """Model 1: additive white noise, left unnormalised."""
    return los + sigma * rng.standard_normal(los.shape)


def measure_tangent(los, sigma, rng):
    """Model 2: noise in the tangent plane of each LOS, then renormalised. ``los`` may be batched."""
    noise = sigma * rng.standard_normal(los.shape)
    noise -= np.sum(noise * los, axis=-1, keepdims=True) * los
    measured = los + noise
    return measured / np.linalg.norm(measured, axis=-1, keepdims=True)


def measure_focal_plane(los, sigma_metres, focal_length, rng):
    """Model 3: pixel noise on the plane at distance f, on whichever side of the camera the LOS lies."""
    plane = los / np.abs(los[..., 2:]) * focal_length
    plane[..., :2] += sigma_metres * rng.standard_normal(plane[..., :2].shape)
    return plane / np.linalg.norm(plane, axis=-1, keepdims=True)

"""Pose from lines of sight: the paper's two estimators, an on-manifold minimiser, and guesses.

Whitened residuals and Jacobians are stacked and every step is an orthogonal least-squares solve of the
stacked rows; normal equations are never formed.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tests.oracle.attitude import (
    dcm_from_mrp,
    dcm_from_rotation_vector,
    mrp_from_dcm,
    mrp_inside,
)
from tests.oracle.los import los_from_dcm, los_jacobian, los_tangent_jacobian, predict_los


@dataclass
class Fit:
    """A pose and how it was reached; ``iterations`` counts solved steps, rejected ones included."""

    position: np.ndarray
    mrp: np.ndarray
    cost: float
    iterations: int
    converged: bool
    costs: list = field(default_factory=list)

    @property
    def dcm(self):
        return dcm_from_mrp(self.mrp)


def square_roots(weights):
    """S_i with S_i' S_i = W_i."""
    return np.array([np.linalg.cholesky(w).T for w in weights])


def whitened(roots, rows):
    """S_i rows_i, stacked over the landmarks."""
    return np.concatenate([s @ row for s, row in zip(roots, rows, strict=True)])


def cost(landmarks, los, weights, position, dcm):
    """Equation (13), half the weighted sum of squares."""
    residual = los - los_from_dcm(landmarks, position, dcm)
    return 0.5 * sum(e @ w @ e for e, w in zip(residual, weights, strict=True))


def stop_test(new, old, stop):
    """Equation (24), multiplied out: defined at zero cost."""
    return abs(new - old) <= stop * new


def gauss_newton(landmarks, los, weights, position, mrp, *, stop=0.1, max_iterations=10):
    """GLSDC, equations (21)-(24) with eta = 0: additive step in [p, mrp], shadow switch, stop test."""
    roots = square_roots(weights)
    old = cost(landmarks, los, weights, position, dcm_from_mrp(mrp))
    costs = [old]
    for iteration in range(1, max_iterations + 1):
        rows = whitened(roots, los_jacobian(landmarks, position, mrp))
        residual = whitened(roots, los - predict_los(landmarks, position, mrp))
        step = np.linalg.lstsq(rows, residual, rcond=None)[0]
        position, mrp = position + step[:3], mrp_inside(mrp + step[3:])
        new = cost(landmarks, los, weights, position, dcm_from_mrp(mrp))
        costs.append(new)
        if stop_test(new, old, stop):
            return Fit(position, mrp, new, iteration, True, costs)
        old = new
    return Fit(position, mrp, old, max_iterations, False, costs)


def levenberg_marquardt(landmarks, los, weights, position, mrp, *, stop=0.1, max_iterations=10, eta=1e-3):
    """Accept/reject reading of (21)-(24): Gamma = diag(H'WH), eta times or over 10, rejects counted."""
    roots = square_roots(weights)
    old = cost(landmarks, los, weights, position, dcm_from_mrp(mrp))
    costs = [old]
    for iteration in range(1, max_iterations + 1):
        rows = whitened(roots, los_jacobian(landmarks, position, mrp))
        residual = whitened(roots, los - predict_los(landmarks, position, mrp))
        damped = np.vstack([rows, np.sqrt(eta) * np.diag(np.linalg.norm(rows, axis=0))])
        step = np.linalg.lstsq(damped, np.append(residual, np.zeros(6)), rcond=None)[0]
        trial_position, trial_mrp = position + step[:3], mrp_inside(mrp + step[3:])
        new = cost(landmarks, los, weights, trial_position, dcm_from_mrp(trial_mrp))
        if new > old:
            eta *= 10
            continue
        eta /= 10
        position, mrp = trial_position, trial_mrp
        costs.append(new)
        if stop_test(new, old, stop):
            return Fit(position, mrp, new, iteration, True, costs)
        old = new
    return Fit(position, mrp, old, max_iterations, False, costs)


def minimise(landmarks, los, weights, position, dcm, *, max_iterations=200):
    """Damped Gauss-Newton on the manifold, run until the step no longer matters to double precision.

    1. whiten and scale the columns to unit length; 2. least squares with the damping rows appended;
    3. p + dp, exp(-[dalpha x]) A; 4. keep the step if the cost does not rise, else damp ten times more.
    """
    roots = square_roots(weights)
    damping = 1e-3
    best = cost(landmarks, los, weights, position, dcm)
    iterations = 0
    while iterations < max_iterations:
        iterations += 1
        rows = whitened(roots, los_tangent_jacobian(landmarks, position, dcm))
        residual = whitened(roots, los - los_from_dcm(landmarks, position, dcm))
        scale = np.linalg.norm(rows, axis=0)
        damped = np.vstack([rows / scale, np.sqrt(damping) * np.eye(6)])
        step = np.linalg.lstsq(damped, np.append(residual, np.zeros(6)), rcond=None)[0]
        trial = position + step[:3] / scale[:3], dcm_from_rotation_vector(step[3:] / scale[3:]) @ dcm
        new = cost(landmarks, los, weights, *trial)
        if new <= best:
            (position, dcm), best = trial, new
            damping = damping / 10 if damping > 1e-14 else 0.0
        else:
            damping = max(10 * damping, 1e-14)
        if np.linalg.norm(step) <= 1e-13 * np.linalg.norm(residual) + 1e-15 or damping > 1e12:
            break
    gradient = np.linalg.norm(rows.T @ residual / scale)
    converged = gradient <= 1e-7 * max(np.linalg.norm(residual), 1.0)
    return Fit(position, mrp_from_dcm(dcm), best, iterations, bool(converged))


def gradient(landmarks, los, weights, position, dcm):
    """Derivative of the cost along [dp, dalpha]."""
    residual = los - los_from_dcm(landmarks, position, dcm)
    jacobian = los_tangent_jacobian(landmarks, position, dcm)
    return -sum(g.T @ w @ e for g, w, e in zip(jacobian, weights, residual, strict=True))


def covariance(landmarks, weights, position, dcm):
    """(G'WG)^-1 through the QR factor of the whitened rows, order [dp, dalpha]."""
    rows = whitened(square_roots(weights), los_tangent_jacobian(landmarks, position, dcm))
    inverse = np.linalg.inv(np.linalg.qr(rows, mode="r"))
    return inverse @ inverse.T


# --- losses: rho of the squared whitened residual s, with the scale c in standard deviations ---------

LOSSES = {
    "squared": lambda s, c: s,
    "huber": lambda s, c: s if s <= c * c else 2 * c * np.sqrt(s) - c * c,
    "cauchy": lambda s, c: c * c * np.log1p(s / (c * c)),
    "tukey": lambda s, c: c * c / 3 * (1 - max(1 - s / (c * c), 0.0) ** 3),
    "geman-mcclure": lambda s, c: s / (1 + s / (c * c)),
}


def robust_cost(landmarks, los, weights, position, dcm, *, loss, scale):
    """Half the sum of rho over the landmarks."""
    residual = los - los_from_dcm(landmarks, position, dcm)
    return 0.5 * sum(LOSSES[loss](e @ w @ e, scale) for e, w in zip(residual, weights, strict=True))


# --- guesses ----------------------------------------------------------------------------------------


def position_given_attitude(landmarks, los, dcm):
    """Point nearest to all the lines through the landmarks along the measured directions."""
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for landmark, b in zip(landmarks, los, strict=True):
        r = dcm.T @ b / np.linalg.norm(b)
        across = np.eye(3) - np.outer(r, r)
        normal += across
        right += across @ landmark
    return np.linalg.lstsq(normal, right, rcond=None)[0]


def planar_guess(landmarks, los):
    """Homography (DLT) of N >= 4 coplanar landmarks in any plane: position and dcm.

    1. plane axes by SVD, coordinates (X, Y) scaled to order one; 2. b x (M [X Y 1]') = 0 for the 3x3
    M = [a1 a2 t]; 3. scale by (|a1| + |a2|)/2, sign by sum b.M[X Y 1]' > 0; 4. nearest rotation.
    """
    centre = landmarks.mean(axis=0)
    axes = np.linalg.svd(landmarks - centre)[2]
    axes[2] = np.cross(axes[0], axes[1])
    plane = (landmarks - centre) @ axes.T
    size = np.abs(plane[:, :2]).max()
    rows = []
    for b, (x, y, _) in zip(los, plane / size, strict=True):
        b1, b2, b3 = b
        b_cross = np.array([[0, -b3, b2], [b3, 0, -b1], [-b2, b1, 0]])
        rows.append(np.hstack([x * b_cross, y * b_cross, b_cross]))
    a1, a2, t = np.linalg.svd(np.vstack(rows))[2][-1].reshape(3, 3)
    a1, a2 = a1 / size, a2 / size
    scale = (np.linalg.norm(a1) + np.linalg.norm(a2)) / 2
    if sum(b @ (a1 * x + a2 * y + t) for b, (x, y, _) in zip(los, plane, strict=True)) < 0:
        scale = -scale
    a1, a2, t = a1 / scale, a2 / scale, t / scale
    u, _, vt = np.linalg.svd(np.column_stack([a1, a2, np.cross(a1, a2)]))
    body_from_plane = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    dcm = body_from_plane @ axes
    return centre - dcm.T @ t, dcm


def twin_pose_landmarks(first, second, ratios):
    """Landmarks seen identically from two poses (position, dcm): A1 (L - p1) = mu A2 (L - p2), mu > 0.

    The points ``(A1 - mu A2)^-1 (A1 p1 - mu A2 p2)`` lie on a twisted cubic through both cameras; any four
    of them, not coplanar, disprove that four landmarks with full rank make a pose unique.
    """
    (p1, a1), (p2, a2) = first, second
    return np.array([np.linalg.solve(a1 - mu * a2, a1 @ p1 - mu * a2 @ p2) for mu in ratios])

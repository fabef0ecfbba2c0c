"""What a set of landmarks can tell about a pose, and where it cannot (section 7 of the model).

Rank is decided on the singular values of the Jacobian whose position columns are multiplied by the mean
range, so that both halves are in radians per radian.
"""

from __future__ import annotations

import numpy as np

from tests.oracle.attitude import cross_matrix, dcm_from_mrp
from tests.oracle.los import los_tangent_jacobian


def scaled_jacobian(landmarks, position, mrp):
    """(3N, 6) stacked [dp * mean range, dalpha] Jacobian."""
    mean_range = np.mean(np.linalg.norm(landmarks - position, axis=1))
    rows = np.vstack(los_tangent_jacobian(landmarks, position, dcm_from_mrp(mrp)))
    return rows * np.repeat([mean_range, 1.0], 3)


def singular_values(landmarks, position, mrp):
    """Six singular values, largest first."""
    values = np.linalg.svd(scaled_jacobian(landmarks, position, mrp), compute_uv=False)
    return np.append(values, np.zeros(6 - len(values)))


def rank(landmarks, position, mrp, threshold=1e-10):
    """Number of singular values above ``threshold`` times the largest."""
    values = singular_values(landmarks, position, mrp)
    return int(np.sum(values > threshold * values[0]))


def null_direction(landmarks, position, mrp):
    """Unit direction in [dp / mean range, dalpha] that the measurements see least."""
    return np.linalg.svd(scaled_jacobian(landmarks, position, mrp))[2][-1]


def circumscribed_circle(a, b, c):
    """Centre, radius and unit normal of the circle through three points."""
    ab, ac = b - a, c - a
    normal = np.cross(ab, ac)
    to_centre = (ac @ ac * np.cross(normal, ab) + ab @ ab * np.cross(ac, normal)) / (2 * normal @ normal)
    return a + to_centre, np.linalg.norm(to_centre), normal / np.linalg.norm(normal)


def danger_cylinder_distance(landmarks, position):
    """|distance of the camera to the axis of the circumscribed circle - its radius|, three landmarks."""
    centre, radius, normal = circumscribed_circle(*landmarks)
    d = position - centre
    return abs(np.linalg.norm(d - normal * (normal @ d)) - radius)


def singular_cubic(position, rate, velocity, parameters):
    """Landmarks seen from ``position`` whose LOS all stand still under the twist (rate, velocity).

    The information is singular iff ``w x L + v = mu (L - p)`` for every landmark and one twist, so
    ``L(mu) = (mu I - [w x])^-1 (mu p + v)``: a twisted cubic that reaches the camera as mu grows. It is
    not any twisted cubic through the camera but the kind that lies on a circular cylinder.
    """
    landmarks = []
    for mu in parameters:
        landmarks.append(np.linalg.solve(mu * np.eye(3) - cross_matrix(rate), mu * position + velocity))
    return np.array(landmarks)


def danger_cylinder_crossings(path, landmarks, times):
    """Times at which a path crosses the danger cylinder of three landmarks, by sign change."""
    centre, radius, normal = circumscribed_circle(*landmarks)
    side = []
    for t in times:
        d = path(t) - centre
        side.append(np.linalg.norm(d - normal * (normal @ d)) - radius)
    return [t for t, a, b in zip(times[1:], side[:-1], side[1:], strict=True) if a * b < 0]

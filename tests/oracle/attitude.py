"""Attitude representations and the maps between them (Schaub & Junkins; Shuster).

``dcm`` takes reference components to body components, ``v_body = dcm @ v_ref``. Quaternions are scalar
last. Every map takes and returns one attitude. Maps that a complex step goes through use no ``abs``.
"""

from __future__ import annotations

import numpy as np


def cross_matrix(a):
    """[a x], so that ``cross_matrix(a) @ b`` is the cross product of a and b."""
    a1, a2, a3 = a
    return np.array([[0 * a1, -a3, a2], [a3, 0 * a1, -a1], [-a2, a1, 0 * a1]])


def dcm_from_mrp(mrp):
    """Equation (2): I + (8 [s x]^2 - 4 (1 - s's) [s x]) / (1 + s's)^2, valid inside and outside the ball."""
    s2 = mrp @ mrp
    x = cross_matrix(mrp)
    return np.eye(3) + (8 * x @ x - 4 * (1 - s2) * x) / (1 + s2) ** 2


def dcm_from_quaternion(q):
    """(w^2 - v'v) I + 2 v v' - 2 w [v x] for a unit quaternion [v, w]."""
    v, w = q[:3], q[3]
    return (w * w - v @ v) * np.eye(3) + 2 * np.outer(v, v) - 2 * w * cross_matrix(v)


def quaternion_from_dcm(dcm):
    """Eigenvector of Davenport's matrix of the dcm for its eigenvalue 3; w >= 0.

    The other eigenvalues are all -1, so the eigenvector is perfectly conditioned at every angle,
    180 degrees included. There w = 0 and the sign of the vector part is free.
    """
    z = np.array([dcm[1, 2] - dcm[2, 1], dcm[2, 0] - dcm[0, 2], dcm[0, 1] - dcm[1, 0]])
    davenport = np.empty((4, 4))
    davenport[:3, :3] = dcm + dcm.T - np.trace(dcm) * np.eye(3)
    davenport[:3, 3] = davenport[3, :3] = z
    davenport[3, 3] = np.trace(dcm)
    q = np.linalg.eigh(davenport)[1][:, -1]
    return -q if q[3] < 0 else q


def mrp_from_quaternion(q):
    """v / (1 + w) of the representative with w >= 0: inside the unit ball."""
    q = -q if q[3] < 0 else q
    return q[:3] / (1 + q[3])


def quaternion_from_mrp(mrp):
    """[2 s, 1 - s's] / (1 + s's), w >= 0."""
    s2 = mrp @ mrp
    q = np.append(2 * mrp, 1 - s2) / (1 + s2)
    return -q if q[3] < 0 else q


def mrp_from_dcm(dcm):
    """Short-way MRP of a dcm."""
    return mrp_from_quaternion(quaternion_from_dcm(dcm))


def mrp_shadow(mrp):
    """The other MRP of the same attitude, -s / s's; undefined at s = 0 (a turn by 360 degrees)."""
    return -mrp / (mrp @ mrp)


def mrp_inside(mrp):
    """The MRP itself, or its shadow where the MRP lies outside the unit ball."""
    return mrp_shadow(mrp) if mrp @ mrp > 1 else mrp


def mrp_kinematics(mrp):
    """B(s) = (1 - s's) I + 2 [s x] + 2 s s', so that sdot = B w / 4 and dsigma = B dalpha / 4."""
    s2 = mrp @ mrp
    return (1 - s2) * np.eye(3) + 2 * cross_matrix(mrp) + 2 * np.outer(mrp, mrp)


def dcm_from_rotation_vector(phi):
    """exp(-[phi x]): the dcm of a body turned by the rotation vector phi.

    Below theta^2 = 1e-8 the Taylor coefficients are exact to theta^4/5040 < 1e-19.
    """
    theta2 = phi @ phi
    if abs(theta2) < 1e-8:
        sine, cosine = 1 - theta2 / 6, 0.5 - theta2 / 24
    else:
        theta = np.sqrt(theta2)
        sine, cosine = np.sin(theta) / theta, 2 * np.sin(theta / 2) ** 2 / theta2
    x = cross_matrix(phi)
    return np.eye(3) - sine * x + cosine * x @ x


def rotation_vector_from_dcm(dcm):
    """phi with ``dcm = exp(-[phi x])`` and length in [0, pi]."""
    q = quaternion_from_dcm(dcm)
    length = np.linalg.norm(q[:3])
    if length == 0:
        return np.zeros(3)
    return q[:3] * (2 * np.arctan2(length, q[3]) / length)


def rotation_error(dcm_true, dcm_estimate):
    """dalpha in body axes with ``dcm_true = exp(-[dalpha x]) dcm_estimate`` (equation 37)."""
    return rotation_vector_from_dcm(dcm_true @ dcm_estimate.T)

"""The attitude half of the oracle against SciPy and its own definitions."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from tests.conftest import HALF_TURN, JACOBIAN, ROUND_TRIP, SAME_FORMULA
from tests.oracle import attitude

AXES = [np.array(a) / np.linalg.norm(a) for a in ([1, 0, 0], [0, 0, -1.0], [1, -2, 3], [0.1, 5, 0.0])]
ANGLES = [0.0, 1e-9, 1e-4, 0.3, 1.5, 3.0, np.pi - 1e-7, np.pi - 1e-12, np.pi]
ROTATIONS = [Rotation.from_rotvec(a * t) for a in AXES for t in ANGLES]


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_every_map_agrees_with_scipy(rotation):
    dcm, q, mrp = rotation.as_matrix().T, rotation.as_quat(canonical=True), rotation.as_mrp()
    assert np.allclose(attitude.dcm_from_mrp(mrp), dcm, rtol=0, atol=ROUND_TRIP)
    assert np.allclose(attitude.dcm_from_quaternion(q), dcm, rtol=0, atol=ROUND_TRIP)
    for found in (attitude.quaternion_from_dcm(dcm), attitude.quaternion_from_mrp(mrp)):
        assert min(np.abs(found - q).max(), np.abs(found + q).max()) < HALF_TURN
        assert found[3] >= 0
    for found in (attitude.mrp_from_dcm(dcm), attitude.mrp_from_quaternion(q)):
        assert found @ found <= 1 + ROUND_TRIP
        assert np.allclose(attitude.dcm_from_mrp(found), dcm, rtol=0, atol=HALF_TURN)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_rotation_vector_is_the_matrix_exponential(rotation):
    phi = rotation.as_rotvec()
    dcm = attitude.dcm_from_rotation_vector(phi)
    assert np.allclose(dcm, expm(-attitude.cross_matrix(phi)), rtol=0, atol=1e-13)
    assert np.allclose(dcm, rotation.as_matrix().T, rtol=0, atol=ROUND_TRIP)
    back = attitude.rotation_vector_from_dcm(dcm)
    if np.linalg.norm(phi) < np.pi - 1e-6:
        assert np.allclose(back, phi, rtol=0, atol=HALF_TURN)
    else:
        again = attitude.dcm_from_rotation_vector(back)
        assert np.allclose(again, dcm, rtol=0, atol=HALF_TURN)


def test_shadow_is_the_same_attitude(rng):
    for mrp in rng.standard_normal((50, 3)) * 2:
        shadow = attitude.mrp_shadow(mrp)
        assert np.allclose(attitude.dcm_from_mrp(shadow), attitude.dcm_from_mrp(mrp), atol=SAME_FORMULA)
        assert np.linalg.norm(attitude.mrp_inside(mrp)) <= 1


def test_full_turn_is_the_identity():
    far = np.array([1e9, 0, 0])
    assert np.allclose(attitude.dcm_from_mrp(far), np.eye(3), rtol=0, atol=1e-8)
    assert np.linalg.norm(attitude.mrp_inside(far)) < 1e-8


def test_rotation_error_sense(rng):
    """dcm_true = (I - [dalpha x]) dcm_estimate to first order."""
    estimate = attitude.dcm_from_mrp(rng.standard_normal(3))
    error = 1e-6 * rng.standard_normal(3)
    true = (np.eye(3) - attitude.cross_matrix(error)) @ estimate
    assert np.allclose(attitude.rotation_error(true, estimate), error, rtol=0, atol=1e-11)


def test_mrp_kinematics_is_the_chain_factor(rng):
    """d dcm / d mrp . (B dalpha / 4) = -[dalpha x] dcm, by complex step."""
    for mrp in rng.standard_normal((20, 3)):
        b = attitude.mrp_kinematics(mrp)
        s2 = mrp @ mrp
        assert np.allclose(b @ b.T, (1 + s2) ** 2 * np.eye(3), rtol=SAME_FORMULA, atol=SAME_FORMULA)
        for axis in np.eye(3):
            moved = attitude.dcm_from_mrp(mrp + 1e-30j * b @ axis / 4)
            expected = -attitude.cross_matrix(axis) @ attitude.dcm_from_mrp(mrp)
            assert np.allclose(moved.imag / 1e-30, expected, rtol=0, atol=JACOBIAN)

"""The measurement half of the oracle: derivatives by complex step, Hessians, noise, foreign reference."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.conftest import JACOBIAN, SAME_FORMULA
from tests.oracle import attitude, los, pose, scenario

STEP = 1e-30


def random_scene(rng, count=5):
    landmarks = rng.uniform(-30, 30, (count, 3))
    position = rng.uniform(-80, 80, 3) + np.array([0, 0, 150])
    return landmarks, position, rng.standard_normal(3) * 0.4


def test_prediction_against_scipy(rng):
    landmarks, position, mrp = random_scene(rng)
    body = Rotation.from_mrp(mrp).inv().apply(landmarks - position)
    expected = body / np.linalg.norm(body, axis=1, keepdims=True)
    assert np.allclose(los.predict_los(landmarks, position, mrp), expected, rtol=0, atol=SAME_FORMULA)


@pytest.mark.parametrize("scale", [1e-6, 0.3, 1.0, 5.0])
def test_paper_jacobian_by_complex_step(rng, scale):
    for _ in range(20):
        landmarks, position, mrp = random_scene(rng)
        mrp = scale * mrp
        jacobian = los.los_jacobian(landmarks, position, mrp)
        for k in range(6):
            step = 1j * STEP * np.eye(6)[k]
            numeric = los.predict_los(landmarks, position + step[:3], mrp + step[3:]).imag / STEP
            assert np.abs(jacobian[..., k] - numeric).max() < JACOBIAN * max(1, np.abs(numeric).max())


def test_tangent_jacobian_by_complex_step(rng):
    for _ in range(20):
        landmarks, position, mrp = random_scene(rng)
        dcm = attitude.dcm_from_mrp(mrp)
        jacobian = los.los_tangent_jacobian(landmarks, position, dcm)
        for k in range(6):
            step = 1j * STEP * np.eye(6)[k]
            turned = attitude.dcm_from_rotation_vector(step[3:]) @ dcm
            numeric = los.los_from_dcm(landmarks, position + step[:3], turned).imag / STEP
            assert np.abs(jacobian[..., k] - numeric).max() < JACOBIAN


def test_fisher_information_is_the_paper_s_and_the_hessian(rng):
    landmarks, position, mrp = random_scene(rng)
    dcm = attitude.dcm_from_mrp(mrp)
    sigmas = rng.uniform(1e-3, 3e-3, len(landmarks))
    weights = los.isotropic_weights(sigmas, len(landmarks))
    information = los.fisher_information(landmarks, position, mrp, weights)
    paper = los.fisher_information_paper(landmarks, position, mrp, sigmas)
    swapped = np.block([[paper[3:, 3:], paper[3:, :3]], [paper[:3, 3:], paper[:3, :3]]])
    scale = np.sqrt(np.outer(np.diag(information), np.diag(information)))
    assert np.abs((information - swapped) / scale).max() < SAME_FORMULA

    measured = los.predict_los(landmarks, position, mrp)

    def gradient(step):
        """Complex-step gradient of the cost at exact data, away from the truth by ``step``."""
        out = []
        for k in range(6):
            z = step + 1j * STEP * np.eye(6)[k]
            turned = attitude.dcm_from_rotation_vector(z[3:]) @ dcm
            out.append(pose.cost(landmarks, measured, weights, position + z[:3], turned).imag / STEP)
        return np.array(out)

    h = 1e-5 * np.array([100, 100, 100, 1, 1, 1])
    hessian = np.array([(gradient(h * e) - gradient(-h * e)) / (2 * h @ e) for e in np.eye(6)])
    assert np.abs((information - hessian) / scale).max() < 1e-8  # central difference of order h^2


def test_map_between_the_two_tangents(rng):
    """(H'WH)^-1 = T F^-1 T' with dsigma = B dalpha / 4."""
    landmarks, position, mrp = random_scene(rng)
    weights = los.isotropic_weights(1e-3, len(landmarks))
    t = np.block(
        [[np.eye(3), np.zeros((3, 3))], [np.zeros((3, 3)), attitude.mrp_kinematics(mrp) / 4]],
    )
    h = np.vstack(los.los_jacobian(landmarks, position, mrp))
    g = np.vstack(los.los_tangent_jacobian(landmarks, position, attitude.dcm_from_mrp(mrp)))
    assert np.allclose(h @ t, g, rtol=0, atol=SAME_FORMULA)
    p = pose.covariance(landmarks, weights, position, attitude.dcm_from_mrp(mrp))
    f = los.fisher_information(landmarks, position, mrp, weights)
    assert np.allclose(p @ f, np.eye(6), rtol=0, atol=1e-8)


def test_focal_plane_covariance_is_first_order_propagation(rng):
    """Against the sample covariance of simulated focal-plane noise, and as rank 2 about b."""
    b = np.array([0.4, -0.3, -0.7])
    b /= np.linalg.norm(b)
    covariance = los.focal_plane_covariance(b, 1e-5, 0.05)
    assert np.abs(covariance @ b).max() < SAME_FORMULA * np.trace(covariance)
    count = 200_000
    measured = los.measure_focal_plane(np.broadcast_to(b, (count, 3)).copy(), 1e-5, 0.05, rng)
    sample = (measured - b).T @ (measured - b) / count
    assert np.abs(sample - covariance).max() < 6 * np.sqrt(2 / count) * np.trace(covariance)
    weight = los.weight_from_covariance(covariance, b)
    tangent = np.linalg.svd(b[None])[2][1:]
    inner = tangent @ weight @ tangent.T
    assert np.allclose(inner @ (tangent @ covariance @ tangent.T), np.eye(2), atol=1e-10)


def test_tangent_noise_has_the_stated_covariance(rng):
    b = np.array([0.0, 0.6, 0.8])
    count = 200_000
    measured = los.measure_tangent(np.broadcast_to(b, (count, 3)).copy(), 1e-3, rng)
    sample = (measured - b).T @ (measured - b) / count
    expected = los.tangent_covariance(b, 1e-3)
    assert np.abs(sample - expected).max() < 6 * np.sqrt(2 / count) * 1e-6
    assert np.allclose(np.linalg.norm(measured, axis=1), 1, atol=1e-15)


def test_mirror_pose_of_the_printed_sign():
    """The printed LOS [-x, -y, f]/norm of the reference scene fit the mirror camera exactly (E1)."""
    position, mrp = scenario.true_pose(0.0)
    true = los.predict_los(scenario.LANDMARKS, position, mrp)
    assert (true[:, 2] < 0).all()
    mirrored = attitude.dcm_from_mrp(mrp) @ np.diag([-1, -1, 1])
    found = los.los_from_dcm(scenario.LANDMARKS, position * [1, 1, -1], mirrored)
    assert np.allclose(found, -true, rtol=0, atol=SAME_FORMULA)

"""solve_pose against OpenCV and PoseLib on the same noise-free and noisy views.

| losnav                           | OpenCV                      | PoseLib                       |
|----------------------------------|-----------------------------|-------------------------------|
| dcm (reference -> body)          | R = Rodrigues(rvec)         | pose.R                        |
| position p                       | tvec = -R p                 | pose.t = -R p                 |
| los, unit vectors                | pixels f x/z + c, z > 0     | pixels f x/z + c, z > 0       |
| cost: angles                     | cost: pixels                | cost: pixels                  |

The costs differ, so noisy optima are compared in standard deviations, exact ones exactly.
"""

import numpy as np
import pytest

import losnav as ln
from tests.oracle import attitude, los

FOCAL_PX = 1000.0
SIGMA_PX = 0.5


def view(rng, noisy):
    """Landmarks in front of a camera, LOS and pixels."""
    landmarks = rng.uniform(-1, 1, (30, 3))
    dcm = attitude.dcm_from_mrp(attitude.mrp_inside(rng.standard_normal(3)))
    position = dcm.T @ (-np.array([0.2, -0.1, 6.0]))
    directions = los.los_from_dcm(landmarks, position, dcm)
    pixels = FOCAL_PX * directions[:, :2] / directions[:, 2:]
    if noisy:
        pixels = pixels + SIGMA_PX * rng.standard_normal(pixels.shape)
    directions = np.column_stack([pixels / FOCAL_PX, np.ones(len(pixels))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return landmarks, directions, pixels, position, dcm


def by_opencv(landmarks, pixels):
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
    matrix = np.diag([FOCAL_PX, FOCAL_PX, 1.0])
    ok, rvec, tvec = cv2.solvePnP(landmarks, pixels, matrix, None, flags=cv2.SOLVEPNP_SQPNP)
    assert ok
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-15)
    rvec, tvec = cv2.solvePnPRefineLM(landmarks, pixels, matrix, None, rvec, tvec, criteria)
    dcm = cv2.Rodrigues(rvec)[0]
    return -dcm.T @ tvec[:, 0], dcm


def by_poselib(landmarks, pixels):
    poselib = pytest.importorskip("poselib", reason="PoseLib is not installed")
    camera = {"model": "SIMPLE_PINHOLE", "width": 2000, "height": 2000, "params": [FOCAL_PX, 0.0, 0.0]}
    pose, _ = poselib.estimate_absolute_pose(pixels, landmarks, camera, {"max_reproj_error": 12.0}, {})
    dcm = np.asarray(pose.R)
    return -dcm.T @ np.asarray(pose.t), dcm


@pytest.mark.parametrize("peer", [by_opencv, by_poselib])
def test_noise_free_views(rng, peer):
    for _ in range(10):
        landmarks, directions, pixels, position, dcm = view(rng, noisy=False)
        solution = ln.solve_pose(landmarks, directions, sigma=1e-6)
        theirs = peer(landmarks, pixels)
        # Their iterations stop at about 1e-7 of the pose; ours is compared with the truth.
        assert np.allclose(theirs[0], position, rtol=0, atol=1e-5)
        assert np.allclose(solution.position, theirs[0], rtol=0, atol=1e-5)
        assert np.allclose(solution.dcm, theirs[1], rtol=0, atol=1e-5)
        assert np.allclose(solution.position, position, rtol=0, atol=1e-10)
        assert np.allclose(solution.dcm, dcm, rtol=0, atol=1e-10)


@pytest.mark.parametrize("peer", [by_opencv, by_poselib])
def test_noisy_views_with_pixel_covariance(rng, peer):
    """With the covariance of pixel noise our optimum is theirs up to second order in the noise."""
    for _ in range(10):
        landmarks, directions, pixels, *_ = view(rng, noisy=True)
        covariance = np.array([los.focal_plane_covariance(b, SIGMA_PX, FOCAL_PX) for b in directions])
        solution = ln.solve_pose(landmarks, directions, covariance=covariance)
        position, dcm = peer(landmarks, pixels)
        error = np.append(
            position - solution.position, attitude.rotation_error(dcm, np.asarray(solution.dcm))
        )
        assert np.abs(error / np.sqrt(np.diag(solution.covariance))).max() < 0.1

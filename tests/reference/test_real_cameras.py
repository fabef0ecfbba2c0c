"""Real cameras with known optimum and covariance, found by Ceres and confirmed by GTSAM and PoseLib.

The reference's covariance is of [dtheta, dp] with ``R_true = Exp(dtheta) R``; ours is of [dp, dalpha]
with ``R_true = (I - [dalpha x]) R``. Exp(dtheta) = I + [dtheta x] to first order, hence
dalpha = -dtheta: the blocks change places and the cross blocks change sign, cov_ours = M cov M'.
"""

import json

import numpy as np
import pytest

import losnav as ln
from tests.conftest import REAL_CAMERA_COVARIANCE, REAL_CAMERA_RAD, SAME_OPTIMUM_IN_SIGMA
from tests.oracle import attitude, pose
from tests.oracle import los as model

OURS_FROM_THEIRS = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
WITH_REFERENCE = [0, 1, 2]
ALL = [0, 1, 2, 3, 4]


@pytest.fixture(scope="module")
def cameras(data_folder):
    """Per camera the arrays without their prefix, and sigma in rad."""
    path = data_folder / "bal_pose.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    facts = json.loads((data_folder / "bal_pose.json").read_text())
    with np.load(path) as arrays:
        loaded = {key: arrays[key] for key in arrays.files}
    cameras = []
    for n in ALL:
        camera = {key.split("_", 1)[1]: a for key, a in loaded.items() if key.startswith(f"c{n}_")}
        camera["sigma"] = facts[n]["sigma_rad"]
        cameras.append(camera)
    return cameras


def first_guess(camera):
    return np.append(camera["p0"], attitude.mrp_from_dcm(camera["R0"]))


@pytest.mark.parametrize("guess_free", [False, True], ids=["poor guess", "guess-free"])
@pytest.mark.parametrize("n", WITH_REFERENCE)
def test_optimum_and_covariance(cameras, n, guess_free):
    camera = cameras[n]
    guess = None if guess_free else first_guess(camera)
    solution = ln.solve_pose(camera["X"], camera["b"], sigma=camera["sigma"], guess=guess)
    assert solution.converged
    assert np.linalg.norm(attitude.rotation_error(solution.dcm, camera["R"])) < REAL_CAMERA_RAD
    distance = np.linalg.norm(camera["X"] - camera["p"], axis=1).min()
    assert np.linalg.norm(solution.position - camera["p"]) / distance < REAL_CAMERA_RAD
    expected = OURS_FROM_THEIRS @ camera["cov"] @ OURS_FROM_THEIRS.T
    deviations = np.sqrt(np.diag(expected))
    error = (solution.covariance - expected) / np.outer(deviations, deviations)
    assert np.abs(error).max() < REAL_CAMERA_COVARIANCE


@pytest.mark.parametrize("n", ALL)
def test_poor_guess_and_no_guess_meet(cameras, n):
    camera = cameras[n]
    found = [
        ln.solve_pose(camera["X"], camera["b"], sigma=camera["sigma"], guess=guess)
        for guess in (first_guess(camera), None)
    ]
    assert all(s.converged for s in found)
    assert np.linalg.norm(attitude.rotation_error(found[0].dcm, found[1].dcm)) < REAL_CAMERA_RAD
    # The noise level of these files was estimated from the residuals themselves.
    assert found[0].chi2 == pytest.approx(found[0].dof, rel=0.01)


@pytest.mark.parametrize("n", ALL)
def test_real_mismatches_are_rejected(cameras, n):
    """All real mismatches out, at least nine of ten real matches in, and the pose as without mismatches."""
    camera = cameras[n]
    landmarks = np.vstack([camera["X"], camera["Xout"]])
    los = np.vstack([camera["b"], camera["bout"]])
    order = np.random.default_rng(n).permutation(len(landmarks))
    good = (np.arange(len(landmarks)) < len(camera["X"]))[order]
    solution = ln.solve_pose_robust(landmarks[order], los[order], sigma=camera["sigma"])
    assert solution.converged
    inliers = np.asarray(solution.inliers)
    assert not inliers[~good].any()
    assert inliers[good].mean() > 0.9
    assert solution.dof == 2 * inliers.sum() - 6
    # The pose is the optimum of the directions it kept, to the digit.
    x, b = landmarks[order][inliers], los[order][inliers]
    weights = model.isotropic_weights(camera["sigma"], len(x))
    kept = pose.minimise(x, b, weights, solution.position, np.asarray(solution.dcm))
    assert deviation(solution, kept.position, kept.dcm) < SAME_OPTIMUM_IN_SIGMA
    # These residuals have heavier tails than a normal distribution: a handful of real matches 4-7 sigma off
    # is outvoted too, which moves the pose by a few of its standard deviations from the fit of all 200.
    clean = ln.solve_pose(camera["X"], camera["b"], sigma=camera["sigma"])
    assert deviation(solution, clean.position, np.asarray(clean.dcm)) < 5


def deviation(solution, position, dcm):
    """Largest difference of a pose from the solution in the solution's standard deviations."""
    error = np.append(solution.position - position, attitude.rotation_error(np.asarray(solution.dcm), dcm))
    return np.abs(error / np.sqrt(np.diag(solution.covariance))).max()

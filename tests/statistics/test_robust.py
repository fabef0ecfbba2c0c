"""solve_pose_robust with half of the directions wrong."""

import numpy as np
import pytest

import losnav as ln
from tests.oracle import attitude, los
from tests.statistics.bands import nees, nees_band

SIGMA = 1e-3


def scene_with_mismatches(rng, count, ratio):
    """Landmarks, LOS of which the first ``ratio`` are replaced by directions to elsewhere, and the truth."""
    landmarks = rng.uniform(-10, 10, (count, 3))
    mrp = attitude.mrp_inside(rng.standard_normal(3))
    away = rng.standard_normal(3)
    position = away / np.linalg.norm(away) * rng.uniform(20, 60)
    measured = los.measure_tangent(los.predict_los(landmarks, position, mrp), SIGMA, rng)
    wrong = round(ratio * count)
    # Mismatches look like matches: directions to other points of the same scene.
    elsewhere = rng.uniform(-10, 10, (wrong, 3))
    if wrong:
        measured[:wrong] = los.predict_los(elsewhere, position, mrp)
    order = rng.permutation(count)
    return landmarks[order], measured[order], position, mrp, order >= wrong


@pytest.mark.slow
@pytest.mark.parametrize(
    ("count", "ratio"), [(20, 0.5), (50, 0.5), (100, 0.5), (50, 0.6), (20, 0.0), (12, 0.25)]
)
def test_success_and_consistency(count, ratio):
    """At least 99 % within 5 sigma of the best possible pose, and NEES of the inliers' solution in band."""
    runs = 300
    rng = np.random.default_rng(count + int(100 * ratio))
    successes, normalised = 0, []
    for _ in range(runs):
        landmarks, measured, position, mrp, good = scene_with_mismatches(rng, count, ratio)
        solution = ln.solve_pose_robust(landmarks, measured, sigma=SIGMA)
        weights = los.isotropic_weights(SIGMA, int(good.sum()))
        bound = los.fisher_information(landmarks[good], position, mrp, weights)
        error = np.append(
            position - solution.position, attitude.rotation_error(attitude.dcm_from_mrp(mrp), solution.dcm)
        )
        if solution.converged and error @ bound @ error < 60:
            successes += 1
            normalised.append(nees(error[None], np.linalg.inv(solution.covariance))[0])
    assert successes / runs >= 0.99
    low, high = nees_band(6, len(normalised))
    assert low < np.mean(normalised) < high


def test_the_seed_decides():
    rng = np.random.default_rng(4)
    landmarks, measured, *_ = scene_with_mismatches(rng, 40, 0.5)
    first = ln.solve_pose_robust(landmarks, measured, sigma=SIGMA, seed=3)
    again = ln.solve_pose_robust(landmarks, measured, sigma=SIGMA, seed=3)
    other = ln.solve_pose_robust(landmarks, measured, sigma=SIGMA, seed=4)
    assert np.array_equal(first.position, again.position)
    assert np.array_equal(first.inliers, again.inliers)
    assert np.array_equal(first.inliers, other.inliers)
    assert np.allclose(first.position, other.position, rtol=0, atol=1e-6)


def test_a_batch_is_many_single_solves():
    rng = np.random.default_rng(5)
    scenes = [scene_with_mismatches(rng, 30, 0.4) for _ in range(7)]
    landmarks, measured = (np.array([s[k] for s in scenes]) for k in (0, 1))
    batch = ln.solve_pose_robust(landmarks, measured, sigma=SIGMA)
    for i in range(7):
        one = ln.solve_pose_robust(landmarks[i], measured[i], sigma=SIGMA)
        assert np.allclose(batch.position[i], one.position, rtol=0, atol=1e-8)
        assert np.array_equal(batch.inliers[i], one.inliers)


def test_nothing_to_find_is_not_a_success():
    """Directions without any pose behind them: not converged, or too few inliers to mistake for one."""
    rng = np.random.default_rng(6)
    for _ in range(50):
        landmarks = rng.uniform(-10, 10, (20, 3))
        directions = rng.standard_normal((20, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        solution = ln.solve_pose_robust(landmarks, directions, sigma=SIGMA)
        assert not solution.converged

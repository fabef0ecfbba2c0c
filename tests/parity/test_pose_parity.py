"""solve_pose against the oracle's minimiser and SciPy: both methods, both parametrizations, every loss."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

import losnav as ln
from tests import strategies as sts
from tests.conftest import NOISE_FREE_METRES, SAME_COST, SAME_OPTIMUM_IN_SIGMA, SCIPY_OPTIMUM_METRES
from tests.oracle import attitude, los, multistart, observability, pose, scenario

METHODS = st.sampled_from(["lm", "gauss-newton"])
PARAMETRIZATIONS = st.sampled_from(["rotation", "mrp"])
# How many cost units a rounding of the residuals makes: the cost of exact data is not compared below it.
COST_FLOOR = 1e-10


def near_guess(scene, metres=0.02, degrees=1.0):
    """A guess off by a fraction of the range and a degree."""
    rng = np.random.default_rng(scene.seed + 1)
    distance = np.linalg.norm(scene.position - scene.landmarks.mean(axis=0))
    turn = attitude.dcm_from_rotation_vector(np.radians(degrees) * rng.standard_normal(3))
    position = scene.position + metres * distance * rng.standard_normal(3) / np.sqrt(3)
    return position, turn @ scene.dcm


def as_vector(position, dcm):
    return np.concatenate([position, attitude.mrp_from_dcm(dcm)])


def deviation_in_sigma(solution, position, dcm, covariance):
    """Largest component of the difference of two poses, in standard deviations."""
    error = np.append(solution.position - position, attitude.rotation_error(solution.dcm, dcm))
    return np.abs(error / np.sqrt(np.diag(covariance))).max()


@given(sts.scenes(), METHODS, PARAMETRIZATIONS)
def test_optimum_cost_and_covariance(scene, method, parametrization):
    measured = scene.measured()
    guess = near_guess(scene)
    expected = pose.minimise(scene.landmarks, measured, scene.weights, *guess)
    assume(expected.converged)
    solution = ln.solve_pose(
        scene.landmarks,
        measured,
        sigma=scene.sigma,
        guess=as_vector(*guess),
        method=method,
        parametrization=parametrization,
        max_iterations=100,
    )
    assert solution.converged
    covariance = pose.covariance(scene.landmarks, scene.weights, expected.position, expected.dcm)
    far = deviation_in_sigma(solution, expected.position, expected.dcm, covariance)
    assert far < SAME_OPTIMUM_IN_SIGMA
    assert solution.cost == pytest.approx(expected.cost, rel=SAME_COST, abs=COST_FLOOR)
    assert solution.chi2 == pytest.approx(2 * expected.cost, rel=SAME_COST, abs=COST_FLOOR)
    assert solution.dof == 2 * scene.count - 6
    d = np.sqrt(np.diag(covariance))
    assert np.abs((solution.covariance - covariance) / np.outer(d, d)).max() < 1e-6
    assert np.allclose(solution.dcm, attitude.dcm_from_mrp(solution.mrp), rtol=0, atol=1e-13)
    assert np.allclose(solution.dcm, attitude.dcm_from_quaternion(solution.quaternion), rtol=0, atol=1e-13)


@given(sts.scenes(sigmas=(1e-6, 1e-5), max_depth=5))
def test_guess_free_finds_what_the_guess_from_the_truth_finds(scene):
    measured = scene.measured()
    expected = pose.minimise(scene.landmarks, measured, scene.weights, scene.position, scene.dcm)
    # The oracle compares costs, which are rounding at 1e-6 rad: where it gives up it is no reference.
    assume(expected.converged)
    solution = ln.solve_pose(scene.landmarks, measured, sigma=scene.sigma)
    assert solution.converged
    assert solution.cost <= expected.cost * (1 + SAME_COST) + COST_FLOOR
    covariance = pose.covariance(scene.landmarks, scene.weights, expected.position, expected.dcm)
    far = deviation_in_sigma(solution, expected.position, expected.dcm, covariance)
    # A four-point scene can have a second pose that fits better than the noise allows the truth to.
    assert far < SAME_OPTIMUM_IN_SIGMA or solution.cost < expected.cost


@settings(max_examples=20)
@given(sts.scenes(maximum=6, sigmas=(1e-4, 1e-3), max_depth=5))
def test_guess_free_is_the_global_minimum(scene):
    """Against brute force: local searches from two hundred attitudes."""
    measured = scene.measured()
    solution = ln.solve_pose(scene.landmarks, measured, sigma=scene.sigma)
    best = multistart.all_minima(scene.landmarks, measured, scene.sigma)[0][0]
    assert solution.cost <= best * (1 + 1e-6) + COST_FLOOR


@given(sts.scenes(), st.booleans())
def test_per_landmark_sigma_and_full_covariance(scene, rank_two):
    """sigma per landmark equals the covariance it stands for; a general covariance its own weight."""
    rng = np.random.default_rng(scene.seed + 2)
    measured = scene.measured()
    guess = near_guess(scene)
    if rank_two:
        sigmas = scene.sigma * rng.uniform(0.5, 2, scene.count)
        covariances = np.array([los.tangent_covariance(b, s) for b, s in zip(measured, sigmas, strict=True)])
        weights = los.isotropic_weights(sigmas, scene.count)
        by_sigma = ln.solve_pose(scene.landmarks, measured, sigma=sigmas, guess=as_vector(*guess))
    else:
        roots = rng.standard_normal((scene.count, 3, 3))
        covariances = scene.sigma**2 * (roots @ roots.swapaxes(1, 2) + 0.2 * np.eye(3))
        weights = np.linalg.inv(covariances)
        by_sigma = None
    solution = ln.solve_pose(scene.landmarks, measured, covariance=covariances, guess=as_vector(*guess))
    expected = pose.minimise(scene.landmarks, measured, weights, *guess)
    assume(expected.converged)
    covariance = pose.covariance(scene.landmarks, weights, expected.position, expected.dcm)
    for found in filter(None, (solution, by_sigma)):
        assert found.converged
        # A residual along b (second order in the noise) is weighted differently by equivalent weights.
        assert deviation_in_sigma(found, expected.position, expected.dcm, covariance) < 0.01
        d = np.sqrt(np.diag(covariance))
        assert np.abs((found.covariance - covariance) / np.outer(d, d)).max() < 0.01


@given(sts.scenes(minimum=8, maximum=20), st.sampled_from(["huber", "cauchy", "tukey", "geman-mcclure"]))
def test_robust_losses_stop_where_their_own_gradient_vanishes(scene, loss):
    """No derivative formula is shared: the slope of the oracle's cost is taken by central differences."""
    measured = scene.measured()
    # One direction off by 20 sigma, so that the loss has something to do.
    turned = measured[0] + 20 * scene.sigma * np.cross(measured[0], [0.6, 0.8, 0.0])
    measured[0] = turned / np.linalg.norm(turned)
    scale = 3.0
    solution = ln.solve_pose(
        scene.landmarks,
        measured,
        sigma=scene.sigma,
        guess=as_vector(scene.position, scene.dcm),
        loss=loss,
        loss_scale=scale,
        max_iterations=200,
    )
    assert solution.converged

    def cost(step):
        turned = attitude.dcm_from_rotation_vector(step[3:]) @ solution.dcm
        moved = solution.position + step[:3]
        return pose.robust_cost(
            scene.landmarks, measured, scene.weights, moved, turned, loss=loss, scale=scale
        )

    # Steps of equal cost: the columns of a root of the covariance, not the single coordinates, which are
    # correlated to 0.996 and better.
    covariance = pose.covariance(scene.landmarks, scene.weights, solution.position, solution.dcm)
    deviations = np.sqrt(np.diag(covariance))
    root = deviations[:, None] * np.linalg.cholesky(covariance / np.outer(deviations, deviations))
    for direction in root.T:
        step = 0.01 * direction
        assert abs(cost(step) - cost(-step)) / 0.02 < 1e-3
        assert cost(100 * step) >= cost(0 * step) - 1e-9
    assert solution.cost == pytest.approx(cost(np.zeros(6)), rel=1e-9)


@pytest.mark.parametrize("parametrization", ["rotation", "mrp"])
@pytest.mark.parametrize("method", ["lm", "gauss-newton"])
@pytest.mark.parametrize("t", [0.0, 200.0, 400.0])
def test_scipy_finds_the_same_optimum_on_the_descent(rng, method, parametrization, t):
    position, mrp = scenario.true_pose(t)
    exact = los.predict_los(scenario.LANDMARKS, position, mrp)
    measured = los.measure_tangent(exact, scenario.SIGMA, rng)
    guess = np.append(position + 0.01 * position[2] * rng.standard_normal(3), mrp + 0.005)

    def residual(x):
        return (measured - los.predict_los(scenario.LANDMARKS, x[:3], x[3:])).ravel() / scenario.SIGMA

    scipy = least_squares(residual, guess, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    solution = ln.solve_pose(
        scenario.LANDMARKS,
        measured,
        sigma=scenario.SIGMA,
        guess=guess,
        method=method,
        parametrization=parametrization,
    )
    assert solution.converged
    assert np.linalg.norm(solution.position - scipy.x[:3]) < SCIPY_OPTIMUM_METRES
    assert solution.cost == pytest.approx(scipy.cost, rel=SAME_COST)


@pytest.mark.parametrize("t", [0.0, 200.0, 400.0])
@pytest.mark.parametrize("guess_free", [True, False])
def test_noise_free_recovery(rng, t, guess_free):
    position, mrp = scenario.true_pose(t)
    measured = los.predict_los(scenario.LANDMARKS, position, mrp)
    guess = None if guess_free else np.append(position * 1.02, mrp + 0.01 * rng.standard_normal(3))
    solution = ln.solve_pose(scenario.LANDMARKS, measured, sigma=scenario.SIGMA, guess=guess)
    assert solution.converged
    assert np.linalg.norm(solution.position - position) < NOISE_FREE_METRES


def test_mirror_pose_of_a_flipped_sign():
    """LOS of the wrong sign fit the mirror camera exactly: the sign convention is not a detail (E1)."""
    position, mrp = scenario.true_pose(0.0)
    flipped = -los.predict_los(scenario.LANDMARKS, position, mrp)
    solution = ln.solve_pose(scenario.LANDMARKS, flipped, sigma=scenario.SIGMA)
    assert np.allclose(solution.position, position * [1, 1, -1], rtol=0, atol=1e-6)
    mirrored = attitude.dcm_from_mrp(mrp) @ np.diag([-1, -1, 1])
    assert np.allclose(solution.dcm, mirrored, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(60))
def test_both_of_two_exact_poses_are_listed(seed):
    """Four landmarks in general position, two poses that fit exactly, both of full rank (E8)."""
    rng = np.random.default_rng(seed)
    truth = []
    for _ in range(2):
        away = rng.standard_normal(3)
        position = rng.uniform(3, 8) * away / np.linalg.norm(away)
        truth.append((position, attitude.dcm_from_mrp(attitude.mrp_inside(rng.standard_normal(3)))))
    landmarks = pose.twin_pose_landmarks(*truth, ratios=rng.uniform(0.3, 3, 4))
    measured = los.los_from_dcm(landmarks, *truth[0])
    assert np.allclose(measured, los.los_from_dcm(landmarks, *truth[1]), rtol=0, atol=1e-9)
    solution = ln.solve_pose(landmarks, measured, sigma=1e-4)
    found = [solution, *solution.alternatives]
    for position, dcm in truth:
        if observability.rank(landmarks, position, attitude.mrp_from_dcm(dcm), threshold=1e-4) < 6:
            continue
        distances = [
            np.linalg.norm(s.position - position) / np.linalg.norm(position) + np.abs(s.dcm - dcm).max()
            for s in found
        ]
        assert min(distances) < 1e-6


@settings(max_examples=20)
@given(st.lists(st.integers(0, 2**32 - 1), min_size=1, max_size=70), st.booleans())
def test_a_batch_is_many_single_solves(seeds, guess_free):
    """Every member as if alone, for sizes that fill the vector lanes and sizes that do not."""
    rng = np.random.default_rng(seeds)
    position, mrp = scenario.true_pose(100.0)
    exact = los.predict_los(scenario.LANDMARKS, position, mrp)
    measured = np.array([los.measure_tangent(exact, scenario.SIGMA, rng) for _ in seeds])
    guess = None if guess_free else np.append(position, mrp) + rng.standard_normal((len(seeds), 6)) * 0.01
    batch = ln.solve_pose(scenario.LANDMARKS, measured, sigma=scenario.SIGMA, guess=guess)
    assert batch.position.shape == (len(seeds), 3)
    for i in range(len(seeds)):
        one = ln.solve_pose(
            scenario.LANDMARKS,
            measured[i],
            sigma=scenario.SIGMA,
            guess=None if guess is None else guess[i],
        )
        assert bool(batch.converged[i]) == bool(one.converged)
        covariance = np.asarray(one.covariance)
        error = np.append(
            batch.position[i] - one.position, attitude.rotation_error(batch.dcm[i], np.asarray(one.dcm))
        )
        assert np.abs(error / np.sqrt(np.diag(covariance))).max() < SAME_OPTIMUM_IN_SIGMA
        assert batch.cost[i] == pytest.approx(one.cost, rel=SAME_COST)

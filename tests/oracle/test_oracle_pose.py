"""The estimators of the oracle: agreement among themselves and with SciPy, exact data, guesses."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from tests.conftest import NOISE_FREE_METRES, SAME_COST, SCIPY_OPTIMUM_METRES
from tests.oracle import attitude, los, multistart, pose, scenario

WEIGHTS = los.isotropic_weights(scenario.SIGMA, 4)


def disturbed(rng, position, mrp, metres, degrees):
    turn = attitude.dcm_from_rotation_vector(np.radians(degrees) * rng.standard_normal(3))
    return (
        position + metres * rng.standard_normal(3),
        attitude.mrp_from_dcm(turn @ attitude.dcm_from_mrp(mrp)),
    )


@pytest.mark.parametrize("t", [0.0, 200.0, 400.0])
def test_noise_free_recovery(rng, t):
    position, mrp = scenario.true_pose(t)
    measured = los.predict_los(scenario.LANDMARKS, position, mrp)
    guess = disturbed(rng, position, mrp, 0.02 * position[2], 3)
    tight = {"stop": 1e-12, "max_iterations": 60}
    fits = [
        pose.gauss_newton(scenario.LANDMARKS, measured, WEIGHTS, *guess, **tight),
        pose.levenberg_marquardt(scenario.LANDMARKS, measured, WEIGHTS, *guess, **tight),
        pose.minimise(scenario.LANDMARKS, measured, WEIGHTS, guess[0], attitude.dcm_from_mrp(guess[1])),
    ]
    for fit in fits:
        assert np.linalg.norm(fit.position - position) < NOISE_FREE_METRES
        assert np.linalg.norm(attitude.rotation_error(attitude.dcm_from_mrp(mrp), fit.dcm)) < 1e-8


def test_four_minimisers_meet(rng):
    """GLSDC = LM = on-manifold = SciPy at t = 0 with noise."""
    position, mrp = scenario.true_pose(0.0)
    exact = los.predict_los(scenario.LANDMARKS, position, mrp)
    measured = los.measure_tangent(exact, scenario.SIGMA, rng)
    guess = disturbed(rng, position, mrp, 10, 2)
    tight = {"stop": 1e-13, "max_iterations": 60}
    fits = [
        pose.gauss_newton(scenario.LANDMARKS, measured, WEIGHTS, *guess, **tight).position,
        pose.levenberg_marquardt(scenario.LANDMARKS, measured, WEIGHTS, *guess, **tight).position,
        pose.minimise(
            scenario.LANDMARKS, measured, WEIGHTS, guess[0], attitude.dcm_from_mrp(guess[1])
        ).position,
    ]

    def residual(x):
        return (measured - los.predict_los(scenario.LANDMARKS, x[:3], x[3:])).ravel() / scenario.SIGMA

    scipy = least_squares(residual, np.concatenate(guess), x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    for found in fits:
        assert np.linalg.norm(found - scipy.x[:3]) < SCIPY_OPTIMUM_METRES


def test_minimum_has_no_gradient_and_the_batched_search_agrees(rng):
    landmarks = rng.uniform(-1, 1, (6, 3))
    position, mrp = np.array([0.3, -0.2, 4.0]), 0.3 * rng.standard_normal(3)
    measured = los.measure_tangent(los.predict_los(landmarks, position, mrp), 1e-3, rng)
    weights = los.isotropic_weights(1e-3, 6)
    fit = pose.minimise(landmarks, measured, weights, position, attitude.dcm_from_mrp(mrp))
    slope = pose.gradient(landmarks, measured, weights, fit.position, fit.dcm)
    deviations = np.sqrt(np.diag(pose.covariance(landmarks, weights, fit.position, fit.dcm)))
    assert fit.converged
    assert np.abs(slope * deviations).max() < 1e-6
    minima = multistart.all_minima(landmarks, measured, 1e-3)
    assert minima[0][0] == pytest.approx(fit.cost, rel=SAME_COST)
    assert np.allclose(minima[0][1], fit.position, rtol=0, atol=1e-8)


def test_stop_test_at_zero_cost():
    assert pose.stop_test(0.0, 0.0, 0.1)
    assert not pose.stop_test(1.0, 2.0, 0.1)


@pytest.mark.parametrize("t", [0.0, 80.0, 160.0, 240.0, 320.0, 400.0])
def test_homography_guess_leads_to_the_optimum_in_three_updates(rng, t):
    position, mrp = scenario.true_pose(t)
    exact = los.predict_los(scenario.LANDMARKS, position, mrp)
    for _ in range(20):
        measured = los.measure_tangent(exact, scenario.SIGMA, rng)
        guess, dcm = pose.planar_guess(scenario.LANDMARKS, measured)
        start = attitude.mrp_from_dcm(dcm)
        fit = pose.gauss_newton(scenario.LANDMARKS, measured, WEIGHTS, guess, start)
        assert fit.converged
        assert fit.iterations <= 3
        # 2 N - 6 = 2 degrees of freedom: 2 J > 35 has probability 3e-8.
        assert 2 * fit.cost < 35


def test_homography_guess_in_a_tilted_plane(rng):
    axes = attitude.dcm_from_mrp(0.5 * rng.standard_normal(3))
    landmarks = np.column_stack([rng.uniform(-2, 2, (6, 2)), np.zeros(6)]) @ axes + [3, 1, -2]
    position, mrp = np.array([1.0, 2.0, 6.0]), 0.4 * rng.standard_normal(3)
    found, dcm = pose.planar_guess(landmarks, los.predict_los(landmarks, position, mrp))
    assert np.allclose(found, position, rtol=0, atol=1e-9)
    assert np.allclose(dcm, attitude.dcm_from_mrp(mrp), rtol=0, atol=1e-9)


def test_loss_functions_are_squares_near_zero_and_continuous():
    for loss in pose.LOSSES.values():
        assert loss(0.0, 2.0) == 0
        assert loss(1e-6, 2.0) == pytest.approx(1e-6, rel=1e-5)
        assert loss(4.0 - 1e-9, 2.0) == pytest.approx(loss(4.0 + 1e-9, 2.0), rel=1e-6)

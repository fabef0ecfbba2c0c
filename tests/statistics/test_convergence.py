"""Where the estimators arrive from far away, and that they never claim to have arrived when they have not."""

import itertools

import numpy as np
import pytest
from scipy.stats import chi2

import losnav as ln
from tests.oracle import attitude, los, scenario
from tests.statistics.bands import nees, pose_errors

# NEES of a right pose exceeds this once in 1e9 solves.
RIGHT = chi2.isf(1e-9, 6)


def cold_starts(rng, position, mrp, *, metres, degrees, runs):
    """Exactly ``metres`` and ``degrees`` off, in uniform directions."""
    directions = rng.standard_normal((2, runs, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    turns = [attitude.dcm_from_rotation_vector(np.radians(degrees) * v) for v in directions[1]]
    mrps = [attitude.mrp_from_dcm(turn @ attitude.dcm_from_mrp(mrp)) for turn in turns]
    return np.hstack([position + metres * directions[0], mrps])


@pytest.mark.slow
@pytest.mark.parametrize("t", [0.0, 100.0, 200.0, 300.0])
def test_cold_start_grid(t):
    """Offsets 20-200 m (scaled with the range) x 5-40 degrees: LM >= 99.5 %, and never a false success."""
    runs = 250
    position, mrp = scenario.true_pose(t)
    scale = np.linalg.norm(position) / np.linalg.norm(scenario.POSITION_0)
    exact = los.predict_los(scenario.LANDMARKS, position, mrp)
    rng = np.random.default_rng(int(t) + 11)
    weights = los.isotropic_weights(scenario.SIGMA, 4)
    bound = los.fisher_information(scenario.LANDMARKS, position, mrp, weights)
    succeeded = total = 0
    for metres, degrees in itertools.product([20, 79, 150, 200], [5, 20, 30, 40]):
        measured = los.measure_tangent(np.broadcast_to(exact, (runs, 4, 3)).copy(), scenario.SIGMA, rng)
        guess = cold_starts(rng, position, mrp, metres=metres * scale, degrees=degrees, runs=runs)
        for method in ("lm", "gauss-newton"):
            solution = ln.solve_pose(
                scenario.LANDMARKS,
                measured,
                sigma=scenario.SIGMA,
                guess=guess,
                method=method,
                max_iterations=100,
            )
            errors = pose_errors(solution, position, attitude.dcm_from_mrp(mrp))
            right = nees(errors, bound) < RIGHT
            false = solution.converged & ~right
            assert not false.any(), (method, metres, degrees, int(false.sum()))
            if method == "lm":
                succeeded += int((solution.converged & right).sum())
                total += runs
    assert succeeded / total >= 0.995

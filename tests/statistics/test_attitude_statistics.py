"""Monte Carlo of ``solve_attitude`` in exact chi-square bands at fixed seeds."""

import numpy as np
import pytest
from scipy.stats import chi2, kstest

import losnav as ln
from tests.conftest import BAND
from tests.oracle import attitude, wahba
from tests.statistics.bands import nees_band

RUNS = 4000
SIGMA = 3.4e-5  # 7 seconds of arc
FIELD = 0.17  # half of 20 degrees


def tracker(count, width, seed, spread=0.0, runs=RUNS):
    """Truth, reference stars, sigma of each, and ``runs`` noisy measurements of them."""
    rng = np.random.default_rng(seed)
    reference = wahba.directions(count, rng, width)
    dcm = attitude.dcm_from_rotation_vector(rng.uniform(-2, 2, 3))
    sigma = SIGMA * 10 ** rng.uniform(0, spread, count)
    body = wahba.measure(np.broadcast_to(reference, (runs, count, 3)), dcm, sigma, rng)
    return dcm, reference, sigma, body


def normalised(errors, covariance):
    return np.einsum("ri,rij,rj->r", errors, np.linalg.inv(covariance), errors)


@pytest.mark.parametrize("method", ["quest", "q-method", "svd", "foam", "esoq2"])
@pytest.mark.parametrize("count", [2, 3, 5, 8, 20, 50])
@pytest.mark.parametrize("width", [None, FIELD], ids=["sphere", "field"])
def test_errors_have_the_reported_covariance(method, count, width):
    runs = RUNS if method == "quest" else RUNS // 4
    dcm, reference, sigma, body = tracker(count, width, count, spread=0.5, runs=runs)
    solution = ln.solve_attitude(body, reference, sigma=sigma, method=method)
    assert solution.converged.all()
    errors = ln.attitude.rotation_error(dcm, solution.dcm)
    values = normalised(errors, solution.covariance)
    low, high = nees_band(3, runs)
    assert low < values.mean() < high
    assert kstest(values, chi2(3).cdf).pvalue > BAND / 24


@pytest.mark.parametrize("count", [2, 3, 8, 50])
def test_chi2_has_two_degrees_of_freedom_for_each_star_less_three(count):
    _, reference, sigma, body = tracker(count, FIELD, 100 + count)
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    dof = 2 * count - 3
    assert (solution.dof == dof).all()
    low, high = nees_band(dof, RUNS)
    assert low < solution.chi2.mean() < high
    assert kstest(solution.chi2, chi2(dof).cdf).pvalue > BAND


@pytest.mark.parametrize("width", [None, FIELD], ids=["sphere", "field"])
def test_sample_covariance_is_the_inverse_information(width):
    """Whitened by (A4) at the truth, the errors are standard normal: variances in band, correlations nil."""
    dcm, reference, sigma, body = tracker(8, width, 7, spread=0.5)
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    errors = ln.attitude.rotation_error(dcm, solution.dcm)
    white = errors @ np.linalg.cholesky(wahba.information(reference @ dcm.T, sigma))
    sample = white.T @ white / RUNS
    low, high = nees_band(1, RUNS, outside=BAND / 3)
    assert (np.diag(sample) > low).all()
    assert (np.diag(sample) < high).all()
    assert np.abs(sample[np.triu_indices(3, 1)]).max() < 3.7 / np.sqrt(RUNS)


def test_one_star_says_what_it_knows():
    """Across the line of sight the error is sigma; about it nothing is claimed."""
    dcm, reference, sigma, body = tracker(1, None, 3)
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    assert not solution.converged.any()
    assert (solution.rank == 2).all()
    assert np.isnan(solution.covariance).all()
    # The direction itself is all that is known of the attitude: its error, as the information measures it.
    star = dcm @ reference[0]
    predicted = solution.dcm @ reference[0]
    across = np.cross(predicted, star)
    values = np.einsum("ri,rij,rj->r", across, solution.information, across)
    low, high = nees_band(2, RUNS)
    assert low < values.mean() < high


def test_an_exact_direction_leaves_one_angle():
    dcm, reference, sigma, body = tracker(5, None, 4)
    body[:, 2] = dcm @ reference[2]
    sigma[2] = 0.0
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    assert solution.converged.all()
    errors = ln.attitude.rotation_error(dcm, solution.dcm)
    about = errors @ body[0, 2]
    variance = np.einsum("i,rij,j->r", body[0, 2], solution.covariance, body[0, 2])
    low, high = nees_band(1, RUNS)
    assert low < (about**2 / variance).mean() < high
    assert np.abs(errors - about[:, None] * body[0, 2]).max() < 1e-14


def test_focal_plane_noise_needs_its_own_covariance():
    """Stars 30 degrees off axis: consistent with their covariance, not with the mean sigma."""
    rng = np.random.default_rng(6)
    count, focal = 8, 2e-4
    reference = np.column_stack([rng.uniform(-0.7, 0.7, (count, 2)), np.ones(count)])
    reference /= np.linalg.norm(reference, axis=1, keepdims=True)
    dcm = attitude.dcm_from_rotation_vector(np.array([0.0, 0.0, 0.4]))
    true = reference @ dcm.T
    plane = true[:, :2] / true[:, 2:] + focal * rng.standard_normal((RUNS, count, 2))
    body = np.concatenate([plane, np.ones((RUNS, count, 1))], axis=-1)
    body /= np.linalg.norm(body, axis=-1, keepdims=True)
    covariance = ln.noise.focal_plane(true, focal)
    solution = ln.solve_attitude(body, reference, covariance=covariance)
    assert solution.converged.all()
    values = normalised(ln.attitude.rotation_error(dcm, solution.dcm), solution.covariance)
    low, high = nees_band(3, RUNS)
    assert low < values.mean() < high
    low, high = nees_band(2 * count - 3, RUNS)
    assert low < solution.chi2.mean() < high
    isotropic = ln.solve_attitude(body, reference, sigma=focal)
    values = normalised(ln.attitude.rotation_error(dcm, isotropic.dcm), isotropic.covariance)
    assert values.mean() < nees_band(3, RUNS)[0]


# --- wrong stars among the right ones -----------------------------------------------------------------


def with_false_stars(rng, count, ratio):
    """A field in which part of the stars are taken for others of it, and which ones are right."""
    reference = wahba.directions(count, rng, FIELD)
    dcm = attitude.dcm_from_rotation_vector(rng.uniform(-2, 2, 3))
    body = wahba.measure(reference, dcm, np.full(count, SIGMA), rng)
    wrong = rng.choice(count, round(ratio * count), replace=False)
    taken = reference.copy()
    taken[wrong] = reference[np.roll(wrong, 1)]
    right = np.ones(count, dtype=bool)
    right[wrong] = False
    return dcm, body, taken, right


@pytest.mark.parametrize(("count", "ratio"), [(10, 0.2), (20, 0.5), (20, 0.0), (50, 0.5), (100, 0.6)])
def test_false_stars_are_found_and_the_rest_is_consistent(count, ratio):
    runs = 300
    rng = np.random.default_rng(count + int(100 * ratio))
    successes, values = 0, []
    for _ in range(runs):
        dcm, body, taken, right = with_false_stars(rng, count, ratio)
        solution = ln.solve_attitude_robust(body, taken, sigma=SIGMA)
        error = ln.attitude.rotation_error(dcm, solution.dcm)
        value = error @ np.linalg.solve(solution.covariance, error) if solution.converged else np.inf
        if value < 40 and not solution.inliers[~right].any():
            successes += 1
            values.append(value)
    assert successes / runs >= 0.99
    low, high = nees_band(3, len(values))
    assert low < np.mean(values) < high


def test_nothing_but_false_stars_is_no_success():
    rng = np.random.default_rng(12)
    for _ in range(200):
        count = 12
        body, reference = wahba.directions(count, rng), wahba.directions(count, rng)
        solution = ln.solve_attitude_robust(body, reference, sigma=SIGMA)
        assert not solution.converged


def test_the_seed_decides():
    rng = np.random.default_rng(5)
    _, body, taken, _ = with_false_stars(rng, 40, 0.5)
    first, second = (ln.solve_attitude_robust(body, taken, sigma=SIGMA, seed=9) for _ in range(2))
    assert np.array_equal(first.quaternion, second.quaternion)
    assert np.array_equal(first.inliers, second.inliers)
    batch = ln.solve_attitude_robust(np.stack([body] * 3), taken, sigma=SIGMA, seed=9)
    assert np.array_equal(batch.quaternion[0], first.quaternion)
    assert batch.inliers.shape == (3, 40)

"""``solve_attitude`` against ``scipy.spatial.transform.Rotation.align_vectors``.

| losnav                              | SciPy                                                     |
|-------------------------------------|-----------------------------------------------------------|
| ``solve_attitude(body, reference)`` | ``align_vectors(body, reference)``, same order            |
| ``dcm`` (reference -> body)         | ``as_matrix()``: it takes the second argument to the first |
| ``sigma``                           | ``weights = 1 / sigma**2``; ``sigma = 0``: weight infinity |
| ``chi2``                            | ``rssd**2``                                               |
| ``covariance``                      | ``sensitivity / mean(weights)``, see below                |
| rank below 3: ``converged`` False   | a warning, or nothing                                     |

SciPy's sensitivity is the inverse of the exact Hessian, our covariance that of the information at the
estimate: the two differ by the residuals, which is the first order of the noise.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import losnav as ln
from tests.oracle import wahba

METHODS = ["quest", "q-method", "svd", "foam", "esoq2"]
# Both solve a problem of condition below 100 by backward stable means.
SAME_RAD = 1e-12


def distance(dcm, rotation):
    return np.linalg.norm(ln.attitude.rotation_error(dcm, rotation.as_matrix()))


def problem(seed, count, sigma, rotation=None):
    rng = np.random.default_rng(seed)
    rotation = Rotation.random(rng=rng) if rotation is None else rotation
    reference = wahba.directions(count, rng)
    reference[1] = np.cross(reference[0], reference[1])
    reference[1] /= np.linalg.norm(reference[1])
    sigmas = sigma * rng.uniform(1, 3, count)
    return wahba.measure(reference, rotation.as_matrix(), sigmas, rng), reference, sigmas


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [2, 3, 8, 100])
@pytest.mark.parametrize("sigma", [1e-7, 1e-4, 1e-2, 0.3])
def test_attitude_and_loss(method, count, sigma):
    for seed in range(20):
        body, reference, sigmas = problem(seed, count, sigma)
        solution = ln.solve_attitude(body, reference, sigma=sigmas, method=method)
        expected, rssd = Rotation.align_vectors(body, reference, weights=sigmas**-2)
        assert solution.converged
        assert distance(solution.dcm, expected) < SAME_RAD
        # SciPy forms the loss as a difference of sums of weights.
        assert solution.chi2 == pytest.approx(rssd**2, rel=1e-6, abs=1e-14 * np.sum(sigmas**-2))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("angle", [np.pi, np.pi - 1e-9, np.pi + 1e-9, np.pi - 1e-4, 0.0, 1e-9])
def test_half_turns_about_any_axis(method, angle):
    rng = np.random.default_rng(1)
    axes = [*np.eye(3), *-np.eye(3), [0, 1, 1], [1, 0, -1], [1, 1, 1], *rng.standard_normal((10, 3))]
    for axis in axes:
        rotation = Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis))
        for count in (2, 5):
            body, reference, sigmas = problem(2, count, 1e-6, rotation)
            solution = ln.solve_attitude(body, reference, sigma=sigmas, method=method)
            expected, _ = Rotation.align_vectors(body, reference, weights=sigmas**-2)
            assert solution.converged
            assert distance(solution.dcm, expected) < SAME_RAD


@pytest.mark.parametrize("sigma", [1e-6, 1e-4, 1e-2])
def test_sensitivity_is_the_covariance(sigma):
    body, reference, sigmas = problem(3, 12, sigma)
    weights = sigmas**-2
    _, _, sensitivity = Rotation.align_vectors(body, reference, weights=weights, return_sensitivity=True)
    covariance = ln.solve_attitude(body, reference, sigma=sigmas).covariance
    off = np.abs(sensitivity / weights.mean() - covariance).max() / np.abs(covariance).max()
    assert off < 3 * sigma


@pytest.mark.parametrize("exact", [0, 2])
@pytest.mark.parametrize("count", [2, 3, 8])
def test_one_infinite_weight(exact, count):
    exact = min(exact, count - 1)
    for seed in range(20):
        body, reference, sigmas = problem(seed, count, 1e-2)
        sigmas[exact] = 0.0
        with np.errstate(divide="ignore"):
            weights = sigmas**-2
        expected, rssd = Rotation.align_vectors(body, reference, weights=weights)
        solution = ln.solve_attitude(body, reference, sigma=sigmas)
        assert solution.converged
        assert distance(solution.dcm, expected) < SAME_RAD
        assert solution.chi2 == pytest.approx(rssd**2, rel=1e-9)
        # Only the turn about the exact direction is uncertain.
        assert np.abs(solution.covariance @ np.cross(body[exact], [0.6, 0, 0.8])).max() < 1e-12


def test_more_than_one_infinite_weight():
    body, reference, sigmas = problem(4, 4, 1e-2)
    sigmas[:2] = 0.0
    with np.errstate(divide="ignore"), pytest.raises(ValueError, match="Only one infinite weight"):
        Rotation.align_vectors(body, reference, weights=sigmas**-2)
    with pytest.raises(ln.InvalidInputError, match="only one direction can be exact"):
        ln.solve_attitude(body, reference, sigma=sigmas)


SINGLE = [
    ([0, 0, 1.0], [0, 1.0, 0]),
    ([0, 0, 1.0], [0, 0, 1.0]),
    ([0, 0, 1.0], [0, 0, -1.0]),
    ([1.0, 0, 0], [-1.0, 0, 0]),
    ([0, 0.6, 0.8], [0, -0.6, -0.8]),
    ([0.48, 0.6, 0.64], [-0.48, -0.6, -0.64]),
    ([0.48, 0.6, 0.64], [-0.48 + 0.75e-7, -0.6 - 0.6e-7, -0.64]),
]


@pytest.mark.parametrize(("body", "reference"), SINGLE)
@pytest.mark.parametrize("sigma", [0.0, 1.0])
def test_one_direction(body, reference, sigma):
    """The shortest rotation, and of the half turns that align opposite directions SciPy's own."""
    expected, _ = Rotation.align_vectors([body], [reference])
    solution = ln.solve_attitude([body], [reference], sigma=sigma)
    assert not solution.converged
    assert solution.rank == 2
    assert distance(solution.dcm, expected) < 1e-8
    # The last reference is of unit length to 1e-14.
    assert np.allclose(solution.dcm @ reference, body, rtol=0, atol=1e-14)
    assert np.array_equal(solution.free_axis, body)


@pytest.mark.parametrize("opposite", [1e-3, 1e-6, 1e-9])
def test_an_exact_direction_near_its_opposite(opposite):
    body = np.array([[0, 0, 1.0], [0, 1.0, 0]])
    reference = Rotation.from_rotvec([np.pi - opposite, 0, 0]).apply(body)
    expected, _ = Rotation.align_vectors(body, reference, weights=[np.inf, 1])
    solution = ln.solve_attitude(body, reference, sigma=[0.0, 1.0])
    assert distance(solution.dcm, expected) < 1e-8
    assert np.allclose(solution.dcm @ reference[0], body[0], rtol=0, atol=1e-15)

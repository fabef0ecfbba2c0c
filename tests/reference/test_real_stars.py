"""Eight real photographs of the night sky, solved by a plate solver: attitude, covariance, false stars.

The reference's attitude takes catalogue (ICRS) to camera components, its covariance is of a small rotation in
camera axes, rad^2: our ``dcm`` and ``covariance``.
"""

import json

import numpy as np
import pytest

import losnav as ln
from tests.statistics.bands import nees_band

ARCSEC = np.pi / 648000
# A reference rounded to the printed digits of its inputs would be off by this much.
REFERENCE_ARCSEC = 0.05
REFERENCE_COVARIANCE = 0.02
PHOTOGRAPHS = ["i08", "i09", "i10", "i11", "i12", "i13", "i14", "i15"]
METHODS = ["quest", "q-method", "svd", "foam", "esoq2"]


@pytest.fixture(scope="module")
def photographs(data_folder):
    """Per photograph the stars that the solver kept, sigma in rad, and its answer."""
    path = data_folder / "stars.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    sigma = {
        e["key"]: e["sigma_arcsec"] * ARCSEC for e in json.loads((data_folder / "stars.json").read_text())
    }
    found = {}
    with np.load(path) as arrays:
        for key in PHOTOGRAPHS:
            keep = arrays[f"{key}_keep"]
            found[key] = {
                "body": arrays[f"{key}_body"][keep],
                "reference": arrays[f"{key}_icrs"][keep],
                "sigma": sigma[key],
                "dcm": arrays[f"{key}_R"],
                "covariance": arrays[f"{key}_cov"],
            }
    return found


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("key", PHOTOGRAPHS)
def test_attitude_and_covariance(photographs, key, method):
    photograph = photographs[key]
    solution = ln.solve_attitude(
        photograph["body"], photograph["reference"], sigma=photograph["sigma"], method=method
    )
    assert solution.converged
    error = ln.attitude.rotation_error(photograph["dcm"], solution.dcm)
    assert np.linalg.norm(error) < REFERENCE_ARCSEC * ARCSEC
    deviations = np.sqrt(np.diag(photograph["covariance"]))
    off = (solution.covariance - photograph["covariance"]) / np.outer(deviations, deviations)
    assert np.abs(off).max() < REFERENCE_COVARIANCE


def test_halves_of_a_photograph_agree(photographs):
    """Two random halves give two independent attitudes: their difference has the sum of the covariances."""
    rng = np.random.default_rng(8)
    normalised = []
    for photograph in photographs.values():
        body, reference = photograph["body"], photograph["reference"]
        order = rng.permutation(len(body))
        one, other = (
            ln.solve_attitude(body[half], reference[half], sigma=photograph["sigma"])
            for half in np.array_split(order, 2)
        )
        difference = ln.attitude.rotation_error(one.dcm, other.dcm)
        normalised.append(difference @ np.linalg.solve(one.covariance + other.covariance, difference))
    # One split of each photograph: the others would not be independent of it.
    low, high = nees_band(3, len(normalised))
    assert low < np.mean(normalised) < high


@pytest.mark.parametrize("ratio", [0.2, 0.35, 0.5])
@pytest.mark.parametrize("key", PHOTOGRAPHS)
def test_false_stars(photographs, key, ratio):
    """Part of the catalogue shuffled: the wrong ones are named, the attitude is that of the right ones."""
    photograph = photographs[key]
    body, reference, sigma = photograph["body"], photograph["reference"], photograph["sigma"]
    clean = ln.solve_attitude_robust(body, reference, sigma=sigma)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        wrong = rng.choice(len(body), max(2, round(ratio * len(body))), replace=False)
        shuffled = reference.copy()
        # Each gets the next one's star: none keeps its own.
        shuffled[wrong] = reference[np.roll(wrong, 1)]
        solution = ln.solve_attitude_robust(body, shuffled, sigma=sigma, seed=seed)
        assert solution.converged
        right = np.ones(len(body), dtype=bool)
        right[wrong] = False
        assert not solution.inliers[~right].any()
        # The right ones that the whole photograph's solution keeps, but for one on the edge of the gate.
        assert (solution.inliers != (right & clean.inliers)).sum() <= 1
        error = ln.attitude.rotation_error(photograph["dcm"], solution.dcm)
        assert error @ np.linalg.solve(solution.covariance, error) < 25

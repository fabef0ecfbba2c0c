"""The covariance of fused heads on campaigns the documentation does not show: other seeds, exact bands."""

import numpy as np
import pytest

from losnav import scenarios
from losnav.scenarios.star_tracker.judging import ARCSEC
from tests.statistics.bands import nees_band

RUNS = 500


@pytest.fixture(scope="module", params=[11, 12, 13])
def result(request):
    tracker = scenarios.load("star-tracker", pixel_images=40, search_cases=200, star_fields=20, alignments=10)
    return tracker.run(RUNS, request.param)


def test_nees_of_every_configuration(result):
    """1 to 4 heads, 1 to 8 stars each, unequal noise, and white pixel noise with its own covariance."""
    outside = 1e-3 / len(result.titles)
    for key in result.titles:
        nees = result.arrays[f"{key}_nees"]
        low, high = nees_band(3, nees.size, outside)
        assert low < nees.mean() < high, key


def test_attitude_level_fusion_is_consistent_too(result):
    for key in ("orthogonal attitudes", "few 2+2+2 attitudes", "few 2+1+0 attitudes"):
        low, high = nees_band(3, RUNS, 1e-3 / 3)
        assert low < result.arrays[f"{key}_nees"].mean() < high, key


def test_errors_have_no_bias(result):
    for key in result.consistent:
        scaled = result.arrays[f"{key}_error"] / result.arrays[f"{key}_sigma"]
        mean = scaled.reshape(-1, 3).mean(axis=0) * np.sqrt(scaled.size / 3)
        assert abs(mean).max() < 5.0, key


def test_one_sigma_for_all_pixels_is_pessimistic(result):
    nees = result.arrays["pixel alike_nees"]
    low, _ = nees_band(3, nees.size)
    assert nees.mean() < low
    assert nees.mean() == pytest.approx(2.91, abs=0.05)


def test_weights_decide(result):
    right, alike = result.rms("weighted"), result.rms("weighted alike")
    assert np.linalg.norm(alike) > 2 * np.linalg.norm(right)


def test_a_mounting_error_is_a_bias_of_its_share(result):
    shift = result.arrays["mismounted across_error"] - result.arrays["orthogonal_error"]
    np.testing.assert_allclose(shift.mean(axis=(0, 1)) / ARCSEC, [0, 2.475, 0], atol=0.02)


def test_verdicts_do_not_depend_on_the_seed(result):
    wrong = [claim.number for claim in result.claims() if not claim.as_established]
    assert not wrong

"""The published rendezvous: figures of an independent Monte Carlo, inside the error of this one."""

import numpy as np
import pytest

from losnav import scenarios
from losnav.consistency import nees, nees_bounds
from losnav.scenarios.relative_navigation.sensing import Draws
from losnav.scenarios.relative_navigation.study import estimate
from losnav.scenarios.relative_navigation.truth import linear
from tests.conftest import BAND

RUNS, SEED = 200, 11
# Two Monte Carlo studies of a few hundred runs each, rounded to two digits.
AGREE = 0.03


@pytest.fixture(scope="module")
def result():
    return scenarios.load("relative-navigation").run(RUNS, SEED)


def rss(result, name, part=slice(0, 3)):
    return 3 * np.sqrt(result.case(name)["square"][:, part].mean(axis=0).sum())


def test_three_sigma_over_one_orbit(result):
    assert rss(result, "as published") == pytest.approx(0.863, rel=AGREE)
    assert rss(result, "as published", slice(3, 6)) == pytest.approx(3.24e-3, rel=AGREE)
    assert rss(result, "true target frame") == pytest.approx(0.812, rel=AGREE)
    assert rss(result, "argument of latitude 90 deg", slice(3, 6)) == pytest.approx(5.0e-3, rel=AGREE)
    assert rss(result, "two-body truth", slice(3, 6)) == pytest.approx(1.7e-3, rel=0.05)


def test_three_sigma_over_half_an_orbit(result):
    square = result.squares(result.arrays["printed_error"], 3000.0).mean(axis=0)
    assert 3 * np.sqrt(square[:3].sum()) == pytest.approx(0.64, rel=AGREE)
    assert 3 * np.sqrt(square[3:].sum()) == pytest.approx(2.4e-3, rel=AGREE)
    assert 0.29 < 3 * np.sqrt(square[:3].min()) < 3 * np.sqrt(square[:3].max()) < 0.47


def test_nees_is_six_with_the_default_process_noise(result):
    """On the J2 truth, averaged over one orbit; epoch by epoch it is not (the model error is no noise)."""
    assert result.arrays["printed_nees"].mean() == pytest.approx(6.0, abs=0.25)


def test_without_process_noise_the_filter_is_inconsistent(result):
    grid = result.arrays["printed_grid_nees"][:, result.scenario.psd_grid.index(0.0)]
    assert grid[:, :50].mean() == pytest.approx(2e3, rel=0.25)
    assert grid.mean() == pytest.approx(8e4, rel=0.25)


def test_on_its_own_model_the_filter_is_consistent():
    """A linear truth in the true frame, no process noise: NEES in its exact band."""
    s = scenarios.load("relative-navigation", frame="target", acceleration_psd=0.0)
    arc = linear(s, s.far_position, s.far_velocity, s.duration)
    draws = Draws.of([np.random.default_rng(k) for k in np.random.SeedSequence(SEED).spawn(RUNS)], 100)
    # The first guess is the same in all runs, no sample of the prior; a hundred measurements have replaced it
    # at the last epoch. (At 10 km, because nearer by the first updates of a 10 m prior are not linear.)
    late = nees(estimate(s, arc, draws, far=True), arc.relative).value[:, -1]
    low, high = nees_bounds(6, RUNS, 1 - BAND)
    assert low < late.mean() < high


def test_the_printed_sign_of_the_transition(result):
    assert rss(result, "printed sign of Φ(1,6)") == pytest.approx(4.9, rel=AGREE)
    assert rss(result, "printed sign of Φ(1,6)", slice(3, 6)) == pytest.approx(37e-3, rel=AGREE)
    assert result.case("printed sign of Φ(1,6)")["nees"].mean() == pytest.approx(1.1e3, rel=0.1)


def test_lag_of_the_manoeuvre(result):
    lags = [result.burn_lags(k, 0).mean() for k in range(3)]
    assert lags == pytest.approx([232, 62, 31], abs=1.0)
    speed = 3 * np.sqrt(result.burn_squares(0, 0).mean(axis=0).sum())
    assert speed == pytest.approx(1.24, abs=0.01)
    assert [result.burn_nis(k, 0).mean() for k in range(3)] == pytest.approx([9e4, 2e3, 220], rel=0.05)
    told = 3 * np.sqrt(result.burn_squares(0, 1).mean(axis=0).sum())
    assert told == pytest.approx(2e-3, rel=0.1)
    assert result.burn_nis(0, 1).mean() == pytest.approx(2.8, abs=0.1)


def test_attitude(result):
    base = rss(result, "as published")
    for name in result.case_names:
        if name.startswith("pointing"):
            assert rss(result, name) == pytest.approx(base, rel=2e-3), name
    assert rss(result, "star tracker 6' (3-sigma)") == pytest.approx(1.03, rel=AGREE)
    assert rss(result, "star tracker 30' (3-sigma)") == pytest.approx(2.14, rel=AGREE)


def test_frames_at_ten_kilometres(result):
    near, repaired = (result.case(f"far linear, {frame}, q = 1e-06") for frame in ("C_BO", "C_OT"))
    assert near["bias"][:, 2].mean() == pytest.approx(15.2, abs=0.5)  # true minus estimate
    assert near["nees"].mean() == pytest.approx(38, rel=0.1)
    assert abs(repaired["bias"][:, 2].mean()) < 0.3
    assert repaired["nees"].mean() == pytest.approx(3.2, rel=0.05)

"""Simulated instruments are as noisy as they are said to be; runs are independent and repeatable."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import SeedSequence
from scipy.stats import chi2

import losnav as ln
from losnav import landing
from losnav.errors import InvalidInputError
from tests.conftest import BAND

RUNS, SEED = 40, 5
IMU = ln.dynamics.Imu(1e-4, 2e-6, 3e-6, 4e-8, accelerometer_bias=5e-4, gyroscope_bias=5e-7)


class Still:
    """No gravity."""

    def acceleration(self, r):
        """Nothing."""
        return np.zeros_like(r)


@pytest.fixture(scope="module")
def descent():
    site = ln.dynamics.Site.inertial()
    return landing.simulate_descent(site, Still(), [0.0, 0.0, 300.0], [0.0, 0.0, -1.0], duration=100.0)


@pytest.fixture(scope="module")
def seeds():
    return SeedSequence(SEED).spawn(RUNS)


def assert_white(values, sigma):
    """Sum of squares in the exact band, mean and lag-one correlation within theirs."""
    low, high = chi2.ppf([BAND / 2, 1 - BAND / 2], values.size)
    assert low < np.sum((values / sigma) ** 2) < high
    assert abs(values.mean()) < 3.3 * sigma / np.sqrt(values.size)


def test_inertial_noise(descent, seeds):
    measured = landing.measure_inertial(descent, IMU, landing.streams(seeds, 0))
    parts = (
        (measured.specific_force, descent.specific_force, measured.accelerometer_bias, 1e-4, 3e-6, 5e-4),
        (measured.angular_rate, descent.angular_rate, measured.gyroscope_bias, 2e-6, 4e-8, 5e-7),
    )
    for sample, truth, bias, density, walk, turn_on in parts:
        white = sample - truth - bias[:, :-1]
        assert_white(white, density / np.sqrt(descent.step))
        assert_white(np.diff(bias, axis=1), walk * np.sqrt(descent.step))
        assert_white(bias[:, 0], turn_on)
        lag = np.mean(white[:, 1:] * white[:, :-1]) / np.mean(white**2)
        assert abs(lag) < 3.3 / np.sqrt(white.size)


def test_a_perfect_unit_measures_the_truth(descent, seeds):
    perfect = ln.dynamics.Imu(0.0, 0.0)
    measured = landing.measure_inertial(descent, perfect, landing.streams(seeds, 0))
    np.testing.assert_array_equal(measured.specific_force[3], descent.specific_force)
    np.testing.assert_array_equal(measured.angular_rate[3], descent.angular_rate)


def test_pixel_noise_and_wrong_matches(descent, seeds):
    camera = ln.sensors.LandmarkCamera(landing.ring_landmarks(8), 500.0, 0.7, image_size=(1024, 1024))
    state = descent.state[descent.every(1.0)]
    chosen = landing.choose_landmarks(camera, state)
    exact = np.nan_to_num(camera.predict(state)).reshape(len(state), -1, 2)
    clean = landing.measure_images(camera, state, chosen, landing.streams(seeds, 1))
    error = clean.pixels.reshape(RUNS, len(state), -1, 2) - exact
    assert_white(error[~np.isnan(error)], 0.7)
    share = 0.1
    wrong = landing.measure_images(camera, state, chosen, landing.streams(seeds, 1), mismatches=share)
    used = ~np.isnan(wrong.pixels.reshape(RUNS, len(state), -1, 2)[..., 0])
    count = wrong.wrong.sum()
    assert not wrong.wrong[~used].any()
    assert abs(count - share * used.sum()) < 3.3 * np.sqrt(share * (1 - share) * used.sum())
    moved = np.linalg.norm(wrong.pixels.reshape(RUNS, len(state), -1, 2) - exact, axis=-1)
    assert (moved[wrong.wrong] > 10).mean() > 0.95
    assert_white((wrong.pixels.reshape(error.shape) - exact)[used & ~wrong.wrong], 0.7)


def test_a_run_does_not_depend_on_the_others(descent, seeds):
    all_of_them = landing.measure_inertial(descent, IMU, landing.streams(seeds, 0))
    one = landing.measure_inertial(descent, IMU, landing.streams(seeds[7:8], 0))
    np.testing.assert_array_equal(all_of_them.specific_force[7], one.specific_force[0])
    # Another stream is another noise.
    other = landing.measure_inertial(descent, IMU, landing.streams(seeds[7:8], 3))
    difference = one.specific_force - other.specific_force
    assert np.corrcoef(one.specific_force.ravel(), other.specific_force.ravel())[0, 1] < 0.05
    assert difference.any()


def test_a_trajectory_for_each_run(seeds):
    site = ln.dynamics.Site.inertial()
    starts = np.array([[0.0, 0.0, 300.0], [0.0, 5.0, 310.0]])
    each = landing.simulate_descent(
        site, Still(), starts, [0.0, 0.0, -1.0], duration=10.0, guidance=lambda t, r, v: -1e-3 * r
    )
    measured = landing.measure_inertial(each, ln.dynamics.Imu(0.0, 0.0), landing.streams(seeds[:2], 0))
    np.testing.assert_array_equal(measured.specific_force, each.specific_force)
    with pytest.raises(InvalidInputError, match="descent"):
        landing.measure_inertial(each, IMU, landing.streams(seeds, 0))


def test_bad_images(descent, seeds):
    camera = ln.sensors.LandmarkCamera(landing.ring_landmarks(), 500.0, 1.0)
    state = descent.state[[10, 20]]
    chosen, rngs = landing.choose_landmarks(camera, state), landing.streams(seeds, 1)
    for name, change in (
        ("landmarks", {"landmarks": np.zeros((2, 3))}),
        ("mismatches", {"mismatches": 1.0}),
    ):
        with pytest.raises(InvalidInputError, match=name):
            landing.measure_images(camera, state, chosen, rngs, **change)
    with pytest.raises(InvalidInputError, match="chosen"):
        landing.measure_images(camera, state, chosen[:1], rngs)
    with pytest.raises(InvalidInputError, match="state"):
        landing.choose_landmarks(camera, descent.state[10])
    for name, change in (("rings", {"rings": 0}), ("growth", {"growth": -1.0})):
        with pytest.raises(InvalidInputError, match=name):
            landing.ring_landmarks(**change)

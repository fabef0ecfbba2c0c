"""Site frames and the grades of inertial units."""

import pickle

import numpy as np
import pytest

import losnav as ln
from tests.conftest import SAME_FORMULA

RATE = 3.31165e-4


def test_site_on_body():
    """East, North, Up; the origin on the radius; the spin axis towards North and Up."""
    latitude, longitude = 0.6, -2.1
    site = ln.dynamics.Site.on_body(latitude, longitude, 15116.0, RATE)
    up = np.array(
        [np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)]
    )
    east = np.cross([0, 0, 1], up) / np.cos(latitude)
    np.testing.assert_allclose(site.site_from_fixed, [east, np.cross(up, east), up], atol=SAME_FORMULA)
    np.testing.assert_allclose(site.angular_velocity, site.site_from_fixed @ [0, 0, RATE], atol=1e-19)
    np.testing.assert_allclose(site.to_fixed([0, 0, 0]), 15116.0 * up, rtol=SAME_FORMULA)
    places = np.random.default_rng(0).normal(size=(4, 5, 3)) * 1e3
    np.testing.assert_allclose(site.from_fixed(site.to_fixed(places)), places, atol=1e-11)


def test_inertial_frame():
    site = ln.dynamics.Site.inertial()
    np.testing.assert_array_equal(site.to_fixed([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0])
    assert not site.angular_velocity.any()


def test_site_is_frozen_and_pickles():
    site = pickle.loads(pickle.dumps(ln.dynamics.Site.on_body(0.1, 0.2, 300.0, 1e-4)))
    with pytest.raises(AttributeError):
        site.center = np.zeros(3)
    assert "center" in repr(site)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ln.dynamics.Site.on_body(0.1, 0.2, 0.0, 1e-4), "radius: expected a number > 0"),
        (lambda: ln.dynamics.Site.on_body(np.nan, 0.2, 1.0, 1e-4), "latitude: expected a finite number"),
        (lambda: ln.dynamics.Site.on_body([0.1], 0.2, 1.0, 1e-4), "latitude: expected a number, got shape"),
        (
            lambda: ln.dynamics.Site(2 * np.eye(3), np.zeros(3), np.zeros(3)),
            "site_from_fixed: expected a rot",
        ),
        (
            lambda: ln.dynamics.Site(np.eye(3), np.zeros((2, 3)), np.zeros(3)),
            r"center: expected shape \(3,\)",
        ),
        (lambda: ln.dynamics.Imu(-1.0, 0.0), "velocity_random_walk: expected a number >= 0"),
        (lambda: ln.dynamics.GaussMarkov(1.0, 0.0), "time_constant: expected a number > 0"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ln.InvalidInputError, match=message):
        call()


@pytest.mark.parametrize(
    ("imu", "datasheet"),
    [
        (ln.dynamics.Imu.navigation(), (10.0, 0.01, 50.0, 0.1)),
        (ln.dynamics.Imu.tactical(), (50.0, 0.07, 300.0, 1.0)),
        (ln.dynamics.Imu.mems(), (100.0, 0.15, 1000.0, 10.0)),
    ],
)
def test_grades_in_the_units_of_data_sheets(imu, datasheet):
    """ug/sqrt(Hz), deg/sqrt(h), ug, deg/h."""
    back = (
        imu.velocity_random_walk / 9.80665e-6,
        np.degrees(imu.angle_random_walk) * 60,
        imu.accelerometer_bias / 9.80665e-6,
        np.degrees(imu.gyroscope_bias) * 3600,
    )
    np.testing.assert_allclose(back, datasheet, rtol=SAME_FORMULA)
    assert imu.accelerometer_bias_walk == imu.gyroscope_bias_walk == 0.0

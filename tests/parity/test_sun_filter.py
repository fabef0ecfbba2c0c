"""The heliocentric filter: updates by the direction of the Sun against textbook formulas, in any units."""

from __future__ import annotations

import numpy as np
import pytest

import losnav as ln
from losnav.constants import SUN_MU

STATE = np.array([1.6e11, -0.9e11, 0.4e11, 1.1e4, 2.3e4, -0.4e4])
P0 = np.diag([6e8**2] * 3 + [50.0**2] * 3)
SENSORS = [ln.sensors.SunDirection(5e-5), ln.sensors.SunDirection(5e-5, aberration=True)]
# Rows together or one by one: rounding of numbers seventeen decades apart, relative to 1 sigma.
SAME_ESTIMATE = 1e-9


def spread():
    """A covariance with all its correlations: the prior after a day."""
    orbit = ln.dynamics.TwoBody(SUN_MU)
    phi = orbit.transition(STATE, 20 * 86400.0)
    return phi @ P0 @ phi.T


def textbook(h, y, p, r):
    s = h @ p @ h.T + r
    k = p @ h.T @ np.linalg.inv(s)
    keep = np.eye(6) - k @ h
    return k @ y, keep @ p @ keep.T + k @ r @ k.T, float(y @ np.linalg.solve(s, y))


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("sensor", SENSORS)
def test_three_components_are_two(sensor, form):
    """Along the direction H is zero: three components with R = sigma^2 I are two in the tangent plane."""
    p = spread()
    z = sensor.predict(STATE + np.sqrt(np.diag(p)) * [0.5, -1, 0.7, 0.2, -0.3, 0.9])
    h, y = sensor.jacobian(STATE), z - sensor.predict(STATE)
    direction = sensor.predict(STATE)
    _, _, turned = np.linalg.svd(direction[np.newaxis])
    across = turned[1:]
    three = textbook(h, y, p, 5e-5**2 * np.eye(3))
    two = textbook(across @ h, across @ y, p, 5e-5**2 * np.eye(2))
    ekf = ln.ExtendedKalmanFilter(ln.dynamics.TwoBody(SUN_MU), STATE, p, form=form)
    step = ekf.update(sensor, z)
    assert step.dof == 2
    assert step.accepted
    sigma = np.sqrt(np.diag(two[1]))
    for delta, covariance, _ in (two, three):
        np.testing.assert_allclose((ekf.state - STATE - delta) / sigma, 0, atol=SAME_ESTIMATE)
        np.testing.assert_allclose(
            (ekf.covariance - covariance) / np.outer(sigma, sigma), 0, atol=SAME_ESTIMATE
        )
    np.testing.assert_allclose(step.nis, two[2], rtol=1e-9)


class Mine:
    """The same motion through Python."""

    def __init__(self, model):
        self.propagate, self.transition = model.propagate, model.transition
        self.process_noise = model.process_noise


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("options", [{}, {"iterations": 4}, {"underweighting": 0.2}, {"consider": [4]}])
def test_the_engine_does_what_python_does(form, options):
    orbit, p = ln.dynamics.TwoBody(SUN_MU, 1e-12), spread()
    sensor = ln.sensors.SunDirection(5e-5, aberration=True)
    far = STATE + np.sqrt(np.diag(p)) * [0.5, -1, 0.7, 0.2, -0.3, 0.9]
    z, dcm = sensor.simulate(far, 3), ln.attitude.dcm_from_mrp([0.2, 0.1, -0.4])
    ends = []
    for model in (orbit, Mine(orbit)):
        ekf = ln.ExtendedKalmanFilter(model, STATE, p, form=form, **options)
        ekf.update(sensor, z)
        ekf.step(-1800.0, sensor, dcm @ z, dcm=dcm)
        ends.append((ekf.state, ekf.covariance))
    sigma = np.sqrt(np.diag(ends[0][1]))
    np.testing.assert_allclose((ends[1][0] - ends[0][0]) / sigma, 0, atol=1e-7)
    np.testing.assert_allclose((ends[1][1] - ends[0][1]) / np.outer(sigma, sigma), 0, atol=1e-7)


def scaled(length, time):
    """The same problem in units of powers of two: state, covariance, dynamics."""
    unit = np.repeat([length, length / time], 3)
    model = ln.dynamics.TwoBody(SUN_MU * length**3 / time**2, 1e-12 * length**2 / time**3)
    return unit, model


@pytest.mark.parametrize("span", [1800.0, -1800.0])
def test_the_filter_knows_no_units(span):
    """Bit for bit the same in metres and in units of 2^37 m and 2^22 s: it needs no scaling of its own."""
    sensor = ln.sensors.SunDirection(5e-5)
    truth = ln.dynamics.TwoBody(SUN_MU).trajectory(STATE, np.arange(101) * span)[1:]
    z = sensor.simulate(truth, 5)
    ends = []
    for length, time in [(1.0, 1.0), (2.0**-37, 2.0**-22)]:
        unit, model = scaled(length, time)
        x, p = STATE * unit * 1.001, P0 * np.outer(unit, unit)
        ekf = ln.ExtendedKalmanFilter(model, x, p, iterations=2)
        log = ekf.run(np.arange(1, 101) * span * time, [(sensor, z)])
        ends.append((log.state / unit, log.covariance / np.outer(unit, unit), log.nis))
    for a, b in zip(*ends, strict=True):
        assert (a == b).all()
    assert np.isfinite(ends[0][0]).all()


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_covariances_seventeen_decades_apart(form):
    """m^2 beside (m/s)^2, correlated to 0.999999: definite at the start and after a thousand updates."""
    p = P0.copy()
    p[:3, 3:] = p[3:, :3] = 0.999999 * np.eye(3) * 6e8 * 50.0
    sensor, orbit = ln.sensors.SunDirection(5e-5), ln.dynamics.TwoBody(SUN_MU)
    times = np.arange(1, 1001) * 1800.0
    z = sensor.simulate(orbit.trajectory(STATE, np.r_[0.0, times])[1:], 1)
    ekf = ln.ExtendedKalmanFilter(orbit, STATE, p, form=form)
    log = ekf.run(times, [(sensor, z)])
    sigma = np.sqrt(np.diagonal(log.covariance, axis1=-2, axis2=-1))
    unit = log.covariance / (sigma[:, :, None] * sigma[:, None, :])
    assert (np.linalg.eigvalsh(unit) > 0).all()
    assert log.accepted.all()

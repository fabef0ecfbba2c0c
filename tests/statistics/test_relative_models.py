"""What the model of relative motion is worth to a filter: camera and laser, truth with J2."""

from __future__ import annotations

import numpy as np
import pytest

import losnav as ln
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS

FLAT = {"j2": EARTH_J2, "radius": EARTH_RADIUS}
EARTH = ln.dynamics.TwoBody(EARTH_MU, **FLAT)
RADIUS = EARTH_RADIUS + 780e3
RATE = float(ln.orbits.mean_motion(EARTH_MU, RADIUS))
TIMES = np.arange(0.0, 6001.0, 60.0)
START = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
RUNS = 40


@pytest.fixture(scope="module")
def arc():
    """Truth over an orbit: chaser, relative state, attitude; measurements of every run."""
    speed, tilt = RATE * RADIUS, np.radians(98.5)
    target = np.array([RADIUS, 0, 0, 0, speed * np.cos(tilt), speed * np.sin(tilt)])
    chaser = ln.orbits.chaser_state(START, target, EARTH.acceleration(target[:3]))
    targets, chasers = EARTH.trajectory(target, TIMES), EARTH.trajectory(chaser, TIMES)
    truth = ln.orbits.relative_state(chasers, targets, EARTH.acceleration(targets[:, :3]))[1:]
    ahead = -truth[:, :3] / np.linalg.norm(truth[:, :3], axis=1, keepdims=True)
    down = np.array([0, 0, 1.0]) - ahead * ahead[:, 2:]
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    dcm = np.stack([ahead, np.cross(down, ahead), down], axis=1)
    camera = ln.sensors.RangeBearing(0.2, np.hypot(np.radians(0.1) / 3, np.radians(1 / 60) / 3))
    rng = np.random.default_rng(1)
    measured = np.stack([camera.simulate(truth, rng, dcm=dcm) for _ in range(RUNS)])
    return chasers, truth, dcm, camera, measured


def three_sigma(arc, model):
    """3 rms of position (m) and velocity (m/s), and the mean NEES, over the second half of the orbit."""
    _, truth, dcm, camera, measured = arc
    ekf = ln.ExtendedKalmanFilter(model, [-510.0, 0, 10, 0, 0, 0], np.diag([100.0] * 3 + [0.0025] * 3))
    log = ekf.run(TIMES[1:], [(camera, measured)], dcm=dcm)
    late = TIMES[1:] >= 3000.0
    error, covariance = (log.state - truth)[:, late], log.covariance[:, late]
    weighed = np.linalg.solve(covariance, error[..., np.newaxis])[..., 0]
    rss = [3 * np.sqrt(np.square(part).sum(axis=-1).mean()) for part in (error[..., :3], error[..., 3:])]
    return *rss, np.einsum("...i,...i->...", error, weighed).mean()


def test_a_model_that_knows_j2(arc):
    """Linear: 0.86 m and 3.2 mm/s as published; the difference of two orbits: a third and a tenth."""
    position, velocity, nees = three_sigma(arc, ln.dynamics.ClohessyWiltshire(RATE, 1e-9))
    assert 0.75 < position < 1.05
    assert 2.7e-3 < velocity < 4.3e-3
    assert 4.0 < nees < 9.0
    rng = np.random.default_rng(9)
    fixes = arc[0] + rng.normal(size=arc[0].shape) * ([15.0] * 3 + [0.2 / 3] * 3)
    for chaser, times in ((fixes[0], 0.0), (fixes, TIMES)):
        aware = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, times, 1e-12, **FLAT)
        position, velocity, nees = three_sigma(arc, aware)
        assert position < 0.4
        assert velocity < 0.8e-3
        # The truth has no disturbance at all: with any process noise the filter is a little cautious.
        assert 3.0 < nees < 6.0

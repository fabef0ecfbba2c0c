"""The unscented filter: the Kalman filter where everything is linear, and the surface of the extended one."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import losnav as ln
from tests.oracle import filter_models, kalman
from tests.parity.test_filter_parity import MEAN_MOTION, PRIOR, START, UserDynamics, UserSensor, arc, spd

# Means and spreads over sigma points cancel digits that a product of matrices keeps.
UNSCENTED = 1e-9


def linear(rng):
    """A linear model and sensor, times and measurements with a gap and two bad epochs."""
    model = filter_models.clohessy_wiltshire(MEAN_MOTION, 1e-9)
    sensor = filter_models.Wavy(np.hstack([np.eye(3), np.zeros((3, 3))]), 0.0, spd(rng, 3))
    times = np.cumsum(rng.uniform(20, 90, 30)) * rng.choice([-1, 1])
    x, z = START, []
    for dt in np.diff(times, prepend=0.0):
        x = model.propagate(x, dt)
        z.append(sensor.predict(x) + rng.standard_normal(3))
    z = np.array(z)
    z[4] = np.nan
    z[[7, 11]] += 200.0
    return model, sensor, times, z


def in_deviations(difference, covariance):
    return np.abs(difference / np.sqrt(np.einsum("...ii->...i", np.array(covariance)))).max()


@pytest.mark.parametrize(
    "weights", [{}, {"alpha": 0.5, "beta": 2.0}, {"alpha": 1.0, "beta": 0.0, "kappa": 1.0}]
)
def test_linear_models_make_it_the_kalman_filter(rng, weights):
    model, sensor, times, z = linear(rng)
    controls = 1e-3 * rng.standard_normal((len(times), 3))
    filter_ = ln.UnscentedKalmanFilter(UserDynamics(model), START, PRIOR, gate=0.999, **weights)
    log = filter_.run(times, [(UserSensor(sensor), z)], controls)
    oracle = kalman.ExtendedKalmanFilter(model, START, PRIOR, kalman.Options(gate=0.999))
    expected = oracle.run(times, [(sensor, z)], controls)
    assert in_deviations(log.state - np.array(expected.state), expected.covariance) < UNSCENTED
    assert (
        in_deviations(np.einsum("kii->ki", log.covariance - expected.covariance), expected.covariance) < 1e-6
    )
    assert log.accepted[:, 0].tolist() == [update[0].accepted for update in expected.updates]
    assert not log.accepted[[4, 7, 11], 0].any()
    np.testing.assert_allclose(log.nis[:, 0], [update[0].nis for update in expected.updates], rtol=1e-8)
    smooth, (states, covariances) = log.smooth(), kalman.smooth(expected)
    assert in_deviations(smooth.state - states, covariances) < 1e-8
    assert in_deviations(np.einsum("kii->ki", smooth.covariance - covariances), covariances) < 1e-6


def test_small_errors_make_it_the_extended_filter(rng):
    """Nonlinear, but the spread is so small that the second order is below its noise."""
    model, times, _, controls, dcm, _ = arc(rng, gaps=False)
    small = PRIOR * 1e-10
    quiet = ln.sensors.RangeBearing(1e-3, 1e-5)
    truth = model.trajectory(START, np.append(0.0, times), controls)[1:]
    z = quiet.predict(truth, dcm=dcm)
    both = [
        kind(ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 0.0), START, small).run(
            times, [(quiet, z)], controls, dcm=dcm
        )
        for kind in (ln.UnscentedKalmanFilter, ln.ExtendedKalmanFilter)
    ]
    assert in_deviations(both[0].state - both[1].state, both[1].covariance) < 1e-4


def test_built_in_and_user_models_agree(rng):
    model, times, measurements, controls, dcm, _ = arc(rng)
    camera, z = measurements[0]

    class Camera:
        def predict(self, state, *, dcm):
            assert state.shape == (6,)
            return camera.predict(state, dcm=dcm)

        def noise(self, state=None, *, dcm=None):
            return camera.noise()

        residual = staticmethod(camera.residual)

    logs = [
        ln.UnscentedKalmanFilter(dynamics, START, PRIOR, gate=0.99).run(
            times, [(sensor, z)], controls, dcm=dcm
        )
        for dynamics, sensor in [(model, camera), (UserDynamics(model), Camera())]
    ]
    assert in_deviations(logs[0].state - logs[1].state, logs[0].covariance) < UNSCENTED
    assert (logs[0].accepted == logs[1].accepted).all()


def test_run_is_a_loop_and_a_batch_is_single_runs(rng):
    model, times, measurements, controls, dcm, _ = arc(rng, epochs=12, runs=5)
    log = ln.UnscentedKalmanFilter(model, START, PRIOR, gate=0.99, relock_after=2).run(
        times, measurements, controls, dcm=dcm
    )
    assert log.state.shape == (5, 12, 6)
    assert log.nis.shape == log.accepted.shape == (5, 12, 2)
    assert [i.shape for i in log.innovations] == [(5, 12, 3), (5, 12, 1)]
    for r in range(5):
        loop = ln.UnscentedKalmanFilter(model, START, PRIOR, gate=0.99, relock_after=2)
        for k, t in enumerate(times):
            loop.predict(t - loop.time, controls[k])
            for j, (sensor, z) in enumerate(measurements):
                step = loop.update(sensor, z[r, k], dcm=dcm[k])
                np.testing.assert_allclose(log.nis[r, k, j], step.nis, rtol=1e-7)
                assert log.accepted[r, k, j] == step.accepted
            assert in_deviations(log.state[r, k] - loop.state, loop.covariance) < UNSCENTED
        assert loop.time == pytest.approx(times[-1])


def test_angles_are_averaged_across_the_branch():
    """The target behind: azimuths of the sigma points lie on both sides of pi."""
    camera = ln.sensors.RangeBearing(0.2, 1e-3)
    model = ln.dynamics.ClohessyWiltshire(0.0, 1e-9)
    x = np.array([100.0, 0.0, 0.0, 0, 0, 0])
    filter_ = ln.UnscentedKalmanFilter(model, x, PRIOR)
    step = filter_.update(camera, [100.0, -np.pi + 1e-3, 0.0], dcm=np.eye(3))
    assert np.abs(step.innovation[1]) < 2e-3
    assert step.innovation_covariance[1, 1] < 0.02
    assert np.linalg.norm(filter_.state[:3] - x[:3]) < 1.0


def test_lock_out_protection():
    lidar = ln.sensors.Range(0.5)
    model = ln.dynamics.ClohessyWiltshire(0.0, 1e-9)

    def accepted(relock):
        filter_ = ln.UnscentedKalmanFilter(
            model, [100.0, 0, 0, 0, 0, 0], 1e-2 * np.eye(6), gate=9.0, relock_after=relock
        )
        return [bool(filter_.update(lidar, [200.0]).accepted) for _ in range(4)]

    assert accepted(2) == [False, False, True, False]
    assert accepted(None) == [False] * 4


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda f, s: f.update(s, [1.0, 0.0], dcm=np.eye(3)), "z"),
        (lambda f, s: f.update(s, [np.inf, 0.0, 0.0], dcm=np.eye(3)), "z"),
        (lambda f, s: f.update(s, [1.0, 0.0, 0.0]), "dcm"),
        (lambda f, s: f.step(60.0, s, [1.0, 0.0, 0.0]), "dcm"),
        (lambda f, s: f.predict(np.nan), "dt"),
        (lambda f, s: f.predict(1.0, [0.0, np.nan, 0.0]), "control"),
        (lambda f, s: f.run([[1.0]], [(s, np.zeros((1, 3)))]), "times"),
        (lambda f, s: f.run([1.0, 2.0], [(s, np.zeros((3, 3)))]), "z"),
        (lambda f, s: f.run([1.0, 2.0], [(s, np.ones((2, 3)))], np.zeros((3, 3)), dcm=np.eye(3)), "controls"),
        (lambda f, s: f.run([1.0, 2.0], [(s, [[1.0, 0, 0], [np.inf, 0, 0]])], dcm=np.eye(3)), "z"),
    ],
)
def test_what_is_refused_changes_nothing(call, argument):
    filter_ = ln.UnscentedKalmanFilter(ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9), START, PRIOR)
    before = filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call(filter_, ln.sensors.RangeBearing(0.2, 6e-4))
    assert (filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time) == before


@pytest.mark.parametrize(
    ("change", "argument"),
    [
        ({"state": 5.0}, "state"),
        ({"state": [np.nan] * 6}, "state"),
        ({"covariance": np.eye(5)}, "covariance"),
        ({"covariance": -np.eye(6)}, "covariance"),
        ({"covariance": np.ones((3, 6, 6)), "state": np.zeros((2, 6))}, "covariance"),
        ({"gate": -1.0}, "gate"),
        ({"relock_after": -1}, "relock_after"),
        ({"alpha": 0.0}, "alpha"),
    ],
)
def test_what_is_refused_at_the_start(change, argument):
    arguments = {"state": START, "covariance": PRIOR} | change
    state, covariance = arguments.pop("state"), arguments.pop("covariance")
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        ln.UnscentedKalmanFilter(ln.dynamics.ClohessyWiltshire(MEAN_MOTION), state, covariance, **arguments)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])
def test_copies_continue_bit_identically(rng, duplicate):
    model, times, measurements, _, dcm, _ = arc(rng, gaps=False)
    camera, z = measurements[0]
    filter_ = ln.UnscentedKalmanFilter(model, START, PRIOR, gate=0.99)
    filter_.run(times[:5], [(camera, z[:5])], dcm=dcm[:5])
    other = duplicate(filter_)
    for k in range(5, 10):
        for each in (filter_, other):
            each.step(60.0, camera, z[k], dcm=dcm[k])
        assert filter_.state.tobytes() == other.state.tobytes()
        assert filter_.covariance.tobytes() == other.covariance.tobytes()

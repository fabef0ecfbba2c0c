"""Directions to the Sun and to planets against the oracle: prediction, Jacobian, noise, what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import losnav as ln
from tests.conftest import BAND, JACOBIAN, ROUNDING, SAME_FORMULA
from tests.oracle import sensors as oracle
from tests.oracle.attitude import cross_matrix

STATE = np.array([1.6e11, -0.9e11, 0.4e11, 1.1e4, 2.3e4, -0.4e4])
GEOMETRIC = ln.sensors.SunDirection(5e-5)
APPARENT = ln.sensors.SunDirection(5e-5, aberration=True)


def case(seed):
    """A heliocentric state anywhere between Mercury and Neptune, some of them fast, and an attitude."""
    rng = np.random.default_rng(seed)
    state = np.concatenate(
        [rng.normal(size=3) * 10.0 ** rng.uniform(10, 12.5), rng.normal(size=3) * 10.0 ** rng.uniform(3, 7)]
    )
    return state, ln.attitude.dcm_from_mrp(rng.normal(size=3))


def seen(aberration):
    def direction(position, velocity, dcm):
        u = oracle.sun_direction(position, np.eye(3))
        return dcm @ (oracle.boosted(u, velocity) if aberration else u)

    return direction


@pytest.mark.parametrize(("sensor", "aberration"), [(GEOMETRIC, False), (APPARENT, True)])
@given(seed=st.integers(0, 2**32 - 1))
def test_sun_direction_is_the_oracles(sensor, aberration, seed):
    state, dcm = case(seed)
    r, v = state[:3], state[3:]
    expected = seen(aberration)(r, v, dcm)
    np.testing.assert_allclose(sensor.predict(state, dcm=dcm), expected, rtol=0, atol=ROUNDING)
    slope = oracle.jacobian(lambda p, w: seen(aberration)(p, w, dcm), r, v)
    got = sensor.jacobian(state, dcm=dcm)
    for columns in (slice(0, 3), slice(3, 6)):
        # The oracle divides by the square of the speed: its derivative along the velocity is good to 1e-8.
        tolerance = 100 * JACOBIAN if columns.start == 0 else 1e-6
        scale = np.abs(slope[:, columns]).max()
        np.testing.assert_allclose(got[:, columns], slope[:, columns], rtol=0, atol=tolerance * scale)


def test_the_default_is_the_geometric_direction():
    r = STATE[:3]
    expected = -r / np.linalg.norm(r)
    np.testing.assert_allclose(GEOMETRIC.predict(STATE), expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(GEOMETRIC.predict(r), expected, rtol=0, atol=1e-15)
    projector = np.eye(3) - np.outer(expected, expected)
    jacobian = GEOMETRIC.jacobian(STATE)
    np.testing.assert_allclose(jacobian[:, :3] * np.linalg.norm(r), -projector, rtol=0, atol=1e-15)
    assert (jacobian[:, 3:] == 0).all()
    assert GEOMETRIC.jacobian(r).shape == (3, 3)


def test_aberration_is_that_of_the_star_catalogue():
    """Towards the velocity by v/c across the direction: 1e-4 rad, and the exact formula in both places."""
    geometric, apparent = GEOMETRIC.predict(STATE), APPARENT.predict(STATE)
    np.testing.assert_allclose(
        apparent, ln.star_tracker.aberrate(geometric, STATE[3:]), rtol=0, atol=ROUNDING
    )
    across = STATE[3:] - (STATE[3:] @ geometric) * geometric
    np.testing.assert_allclose(apparent - geometric, across / 299792458.0, rtol=0, atol=2e-8)
    back = ln.star_tracker.remove_aberration(apparent, STATE[3:])
    np.testing.assert_allclose(back, geometric, rtol=0, atol=ROUNDING)


def test_attitude_columns_by_complex_step(rng):
    for _ in range(10):
        mrp = rng.normal(size=3) * 0.3
        dcm = ln.attitude.dcm_from_mrp(mrp)
        jacobian = GEOMETRIC.jacobian((STATE[:3], mrp))
        slope = oracle.jacobian(
            lambda alpha, dcm=dcm: oracle.sun_direction(STATE[:3], dcm - cross_matrix(alpha) @ dcm),
            np.zeros(3),
        )
        np.testing.assert_allclose(jacobian[:, 3:], slope, rtol=0, atol=SAME_FORMULA)


@pytest.mark.parametrize("sensor", [GEOMETRIC, APPARENT])
def test_broadcasting_is_a_loop(sensor, rng):
    states = STATE * (1 + 0.1 * rng.normal(size=(5, 1, 6)))
    attitudes = ln.attitude.dcm_from_mrp(rng.normal(size=(3, 3)))
    predicted, jacobian = sensor.predict(states, dcm=attitudes), sensor.jacobian(states, dcm=attitudes)
    assert predicted.shape == (5, 3, 3)
    assert jacobian.shape == (5, 3, 3, 6)
    for i in range(5):
        for k in range(3):
            assert (predicted[i, k] == sensor.predict(states[i, 0], dcm=attitudes[k])).all()
            assert (jacobian[i, k] == sensor.jacobian(states[i, 0], dcm=attitudes[k])).all()


def test_simulation_has_the_stated_noise():
    states = np.broadcast_to(STATE, (5000, 6))
    measured = APPARENT.simulate(states, 7)
    assert (measured == APPARENT.simulate(states, np.random.default_rng(7))).all()
    np.testing.assert_allclose(np.linalg.norm(measured, axis=-1), 1, rtol=0, atol=ROUNDING)
    total = np.square((measured - APPARENT.predict(STATE)) / APPARENT.sigma).sum()
    low, high = stats.chi2.ppf([BAND / 2, 1 - BAND / 2], 2 * len(states))
    assert low < total < high
    np.testing.assert_array_equal(APPARENT.noise(), 5e-5**2 * np.eye(3))


DAY = 86400.0
EARTH = ln.Ephemeris.sampled(
    lambda t: ln.ephemeris.approximate_planet("earth", t), np.arange(-10.0, 400.0, 4.0) * DAY
)


@pytest.mark.parametrize("light_time", [False, True])
@pytest.mark.parametrize("aberration", [False, True])
@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1))
def test_body_direction_is_the_oracles(light_time, aberration, seed):
    rng = np.random.default_rng(seed)
    state, dcm = case(seed)
    state[:3] *= 3e11 / max(np.linalg.norm(state[:3]), 3e11)  # light of half an hour at most
    time = rng.uniform(0, 390) * DAY
    sensor = ln.sensors.BodyDirection(EARTH, 5e-6, light_time=light_time, aberration=aberration)

    def direction(position, velocity):
        # A complex delay enters the polynomial through its derivative.
        def path(delay):
            here = EARTH(time - np.real(delay))
            return here[:3] - 1j * np.imag(delay) * here[3:]

        options = {"path": path, "light_time": light_time, "aberration": aberration}
        return oracle.body_direction(position, velocity, dcm, **options)

    r, v = state[:3], state[3:]
    # What the jerk does in half an hour: 20 m beside 1e10 m.
    np.testing.assert_allclose(
        sensor.predict(state, dcm=dcm, time=time), direction(r, v).real, rtol=0, atol=1e-9
    )
    slope = oracle.jacobian(direction, r, v)
    got = sensor.jacobian(state, dcm=dcm, time=time)
    np.testing.assert_allclose(got[:, :3], slope[:, :3], rtol=0, atol=1e-7 * np.abs(slope[:, :3]).max())
    np.testing.assert_allclose(got[:, 3:], slope[:, 3:], rtol=0, atol=1e-6 * np.abs(slope[:, 3:]).max())


def test_a_body_at_the_origin_is_the_sun():
    still = ln.Ephemeris([0.0, 1e9], np.zeros((2, 3)), np.zeros((2, 3)))
    for aberration, sun in ((False, GEOMETRIC), (True, APPARENT)):
        body = ln.sensors.BodyDirection(still, 5e-5, aberration=aberration)
        assert (body.predict(STATE, time=5.0) == sun.predict(STATE)).all()
        np.testing.assert_allclose(body.jacobian(STATE, time=5.0), sun.jacobian(STATE), rtol=1e-15, atol=0)


def test_directions_of_many_times_at_once():
    sensor = ln.sensors.BodyDirection(EARTH, 5e-6)
    times = np.array([1.0, 30.0, 200.0]) * DAY
    both = sensor.predict(STATE, time=times)
    assert both.shape == (3, 3)
    for k, time in enumerate(times):
        assert (both[k] == sensor.predict(STATE, time=time)).all()
    measured = sensor.simulate(np.broadcast_to(STATE, (3, 6)), 5, time=times)
    assert np.abs(np.linalg.norm(measured, axis=1) - 1).max() < ROUNDING
    assert 1e-7 < np.abs(measured - both).max() < 5e-5


def test_the_filter_tells_its_time():
    """Engine, Python and unscented filters tell a planet's direction when it is seen; a step remembers it."""

    class Mine:
        def __init__(self, model):
            self.propagate, self.transition = model.propagate, model.transition
            self.process_noise = model.process_noise

    orbit = ln.dynamics.TwoBody(ln.constants.SUN_MU)
    planet, sun = ln.sensors.BodyDirection(EARTH, 5e-6), ln.sensors.SunDirection(5e-5)
    start, times = 10 * DAY, (10 + np.arange(1, 41)) * DAY
    truth = orbit.trajectory(STATE, np.r_[start, times])[1:]
    pairs = [(planet, planet.simulate(truth, 1, time=times)), (sun, sun.simulate(truth, 2))]
    p = np.diag([1e8**2] * 3 + [10.0**2] * 3)
    first = STATE + np.array([6e7, -4e7, 1e8, 5.0, -9.0, 4.0])
    logs = [ln.ExtendedKalmanFilter(m, first, p, time=start).run(times, pairs) for m in (orbit, Mine(orbit))]
    sigma = np.sqrt(np.diagonal(logs[0].covariance, axis1=1, axis2=2))
    assert (np.abs(logs[0].state - logs[1].state) < 1e-6 * sigma).all()
    assert [list(log.dof) for log in logs] == [[2, 2], [2, 2]]
    assert np.square((logs[0].state - truth)[-1] / sigma[-1]).max() < 25
    assert logs[0].nis.mean() < 3.0
    unscented = ln.UnscentedKalmanFilter(orbit, first, p, time=start).run(times, pairs)
    assert (np.abs(unscented.state - logs[0].state)[-1] < 0.1 * sigma[-1]).all()
    ekf = ln.ExtendedKalmanFilter(orbit, first, p, time=start)
    step = ekf.step(DAY, planet, pairs[0][1][0])
    assert step.innovation_covariance.shape == (3, 3)
    ekf.update(sun, pairs[1][1][0])
    assert (ekf.state == logs[0].state[0]).all()
    again = pickle.loads(pickle.dumps(step))
    assert (again.gain == step.gain).all()
    with pytest.raises(ln.InvalidInputError, match="time: expected epochs within the ephemeris"):
        ekf.step(400 * DAY, planet, pairs[0][1][0])
    assert ekf.time == start + DAY


def test_doppler_of_the_sun_is_a_range_rate():
    doppler = ln.sensors.RangeRate(0.01)
    r, v = STATE[:3], STATE[3:]
    np.testing.assert_allclose(doppler.predict(STATE), [v @ r / np.linalg.norm(r)], rtol=1e-15)


def test_sensors_are_values():
    sensor = pickle.loads(pickle.dumps(APPARENT))
    assert (sensor.sigma, sensor.aberration) == (5e-5, True)
    assert (sensor.predict(STATE) == APPARENT.predict(STATE)).all()
    assert repr(sensor) == "SunDirection(sigma=5e-05, aberration=True)"
    planet = pickle.loads(pickle.dumps(ln.sensors.BodyDirection(EARTH, 5e-6, aberration=False)))
    assert (planet.sigma, planet.light_time, planet.aberration) == (5e-6, True, False)
    assert (planet.ephemeris(DAY) == EARTH(DAY)).all()
    with pytest.raises(AttributeError):
        sensor.sigma = 1.0


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.sensors.SunDirection(0.0), "sigma"),
        (lambda: ln.sensors.SunDirection([1e-5, 1e-5]), "sigma"),
        (lambda: ln.sensors.SunDirection(1e-5, aberration="yes"), "aberration"),
        (lambda: GEOMETRIC.predict(np.zeros(6)), "state: the target coincides"),
        (lambda: GEOMETRIC.predict(STATE, dcm=2 * np.eye(3)), "dcm"),
        (lambda: GEOMETRIC.predict(STATE[:4]), "state"),
        (lambda: APPARENT.predict(STATE[:3]), "state: expected"),
        (lambda: APPARENT.predict((STATE[:3], np.zeros(3))), "state: expected"),
        (lambda: GEOMETRIC.predict([1e200, 0, 0]), "state: the target is too far"),
        (lambda: ln.sensors.BodyDirection([1.0], 1e-5), "ephemeris"),
        (lambda: ln.sensors.BodyDirection(EARTH, -1e-5), "sigma"),
        (lambda: ln.sensors.BodyDirection(EARTH, 1e-5, light_time=1), "light_time"),
        (lambda: ln.sensors.BodyDirection(EARTH, 1e-5).predict(STATE, time=-1e9), "time"),
        (lambda: ln.sensors.BodyDirection(EARTH, 1e-5).predict(STATE[:3], time=1e5), "state: expected"),
        (
            lambda: ln.ExtendedKalmanFilter(ln.dynamics.TwoBody(1e20), STATE, np.eye(6), time=1e5).update(
                ln.sensors.BodyDirection(EARTH, 1e-5), [1.0, 0, 0], time=3.0
            ),
            "time: unknown context",
        ),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()


def test_bounds_know_when_a_planet_is_seen():
    """The bound along an arc is the covariance of a filter linearised at the truth."""
    orbit = ln.dynamics.TwoBody(ln.constants.SUN_MU)
    planet, times = ln.sensors.BodyDirection(EARTH, 5e-6), (10 + np.arange(0, 31)) * DAY
    truth = orbit.trajectory(STATE, times)
    p = np.diag([1e8**2] * 3 + [10.0**2] * 3)
    bound = ln.observability.crlb(orbit, planet, STATE, times, prior=p)
    log = ln.ExtendedKalmanFilter(orbit, STATE, p, time=times[0]).run(
        times, [(planet, planet.predict(truth, time=times))]
    )
    sigma = np.sqrt(np.diagonal(bound, axis1=1, axis2=2))
    np.testing.assert_allclose(
        (log.covariance - bound) / (sigma[:, :, None] * sigma[:, None, :]), 0, atol=1e-6
    )

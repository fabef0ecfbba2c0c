"""Directions to the Sun and to planets against the oracle: prediction, Jacobian, noise, what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
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


def test_sensors_are_values():
    sensor = pickle.loads(pickle.dumps(APPARENT))
    assert (sensor.sigma, sensor.aberration) == (5e-5, True)
    assert (sensor.predict(STATE) == APPARENT.predict(STATE)).all()
    assert repr(sensor) == "SunDirection(sigma=5e-05, aberration=True)"
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
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

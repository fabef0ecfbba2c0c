"""Sensors of one target against the oracle: prediction, Jacobian, angles, simulation, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

import losnav as ln
from tests.conftest import BAND, JACOBIAN, SAME_FORMULA
from tests.oracle import sensors as oracle
from tests.oracle.attitude import cross_matrix

CAMERA = ln.sensors.RangeBearing(0.2, 6e-4)
STATE = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
SENSORS = [CAMERA, ln.sensors.Range(0.2), ln.sensors.RangeRate(0.01)]


def case(seed):
    """A state, an attitude and a target; ranges from centimetres to a thousand kilometres."""
    rng = np.random.default_rng(seed)
    size = 10.0 ** rng.uniform(-2, 6)
    state = np.concatenate([rng.normal(size=3) * size, rng.normal(size=3)])
    return state, ln.attitude.dcm_from_mrp(rng.normal(size=3)), rng.normal(size=3) * size


def assert_rows(got, expected):
    """Entries relative to the largest of their row."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    np.testing.assert_allclose(got / scale, expected / scale, rtol=0, atol=100 * JACOBIAN)


@given(st.integers(0, 2**32 - 1))
def test_range_bearing_is_the_oracles(seed):
    state, dcm, target = case(seed)
    position = state[:3]
    expected = oracle.range_bearing(position, dcm, target).real
    got = CAMERA.predict(state, dcm=dcm, target=target)
    np.testing.assert_allclose(got[0], expected[0], rtol=SAME_FORMULA)
    np.testing.assert_allclose(got[1:], expected[1:], rtol=0, atol=1e-9)  # the arcsine, near the pole
    slope = oracle.jacobian(lambda p: oracle.range_bearing(p, dcm, target), position)
    if abs(expected[2]) < 1.5:
        jacobian = CAMERA.jacobian(state, dcm=dcm, target=target)
        assert_rows(jacobian[:, :3], slope)
        assert (jacobian[:, 3:] == 0).all()
        assert (CAMERA.jacobian(position, dcm=dcm, target=target) == jacobian[:, :3]).all()


def test_attitude_columns_by_complex_step(rng):
    """Of a state with an attitude of its own: dcm = (I - [dalpha x]) dcm_estimate."""
    for _ in range(20):
        position, mrp, target = rng.normal(size=3) * 50, rng.normal(size=3) * 0.3, rng.normal(size=3)
        dcm = ln.attitude.dcm_from_mrp(mrp)

        def turned(alpha, position=position, dcm=dcm, target=target):
            return oracle.range_bearing(position, dcm - cross_matrix(alpha) @ dcm, target)

        jacobian = CAMERA.jacobian((position, mrp), target=target)
        slope = oracle.jacobian(turned, np.zeros(3))
        np.testing.assert_allclose(jacobian[0, 3:], 0, atol=1e-12)  # a turn changes no range
        assert_rows(jacobian[1:, 3:], slope[1:])
        assert (ln.sensors.Range(1.0).jacobian((position, mrp))[:, 3:] == 0).all()


@given(st.integers(0, 2**32 - 1))
def test_range_and_rate_are_the_oracles(seed):
    state, _, target = case(seed)
    position, velocity = state[:3], state[3:]
    laser, doppler = ln.sensors.Range(1.0), ln.sensors.RangeRate(1.0)
    np.testing.assert_allclose(
        laser.predict(state, target=target), oracle.distance(position, target), rtol=SAME_FORMULA
    )
    np.testing.assert_allclose(
        doppler.predict(state, target=target),
        oracle.distance_rate(position, velocity, target),
        rtol=0,
        atol=SAME_FORMULA * np.linalg.norm(velocity),
    )
    slope = oracle.jacobian(lambda p: oracle.distance(p, target), position)
    assert_rows(laser.jacobian(state, target=target)[:, :3], slope)
    rate = oracle.jacobian(lambda p, v: oracle.distance_rate(p, v, target), position, velocity)
    got = doppler.jacobian(state, target=target)
    assert_rows(got[:, 3:], rate[:, 3:])
    scale = np.linalg.norm(velocity) / np.linalg.norm(position - target)
    np.testing.assert_allclose(got[:, :3], rate[:, :3], rtol=0, atol=100 * JACOBIAN * scale)


def test_axes_of_the_camera():
    """Boresight +x; azimuth from +x towards +y; elevation towards +z; signs of a small pointing error."""
    toward = CAMERA.predict([0.0, 0.0, 0.0], dcm=np.eye(3), target=[10.0, 0.1, 0.2])
    np.testing.assert_allclose(toward[1:], [0.01, 0.02], rtol=1e-3)
    theta = np.array([0.0, 2e-5, 3e-5])
    turned = CAMERA.predict([-10.0, 0.0, 0.0], dcm=np.eye(3) - cross_matrix(theta))
    np.testing.assert_allclose(turned[1:], [-theta[2], theta[1]], rtol=1e-6)
    assert CAMERA.predict([5.0, 0.0, 0.0], dcm=np.eye(3))[1] == np.pi
    assert CAMERA.predict([5.0, 0.0, 0.0], dcm=np.eye(3)[np.newaxis])[0, 1] == np.pi


def test_residuals_are_wrapped():
    z = np.array([[3.0, 3.1, 0.5], [3.0, -3.1, 0.5], [np.nan] * 3])
    residual = CAMERA.residual(z, [1.0, -3.1, 0.2])
    np.testing.assert_allclose(residual[0], [2.0, 6.2 - 2 * np.pi, 0.3])
    np.testing.assert_allclose(residual[1], [2.0, 0.0, 0.3])
    assert np.isnan(residual[2]).all()
    assert CAMERA.residual([0.0, np.pi, 0.0], [0.0, 0.0, 0.0])[1] == np.pi
    assert CAMERA.residual([0.0, -np.pi, 0.0], [0.0, 0.0, 0.0])[1] == np.pi
    direction = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 1e-3)
    assert (direction.residual([4.0, 0.0, 0.0], [0.0, 0.0, 1.0]) == [4.0, 0.0, -1.0]).all()
    with pytest.raises(ln.InvalidInputError, match=r"^z"):
        CAMERA.residual([1.0, 2.0], [1.0, 2.0, 3.0])


def test_a_line_of_sight_to_the_target_is_its_bearing():
    direction = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 1e-3)
    dcm = ln.attitude.dcm_from_mrp([0.1, -0.3, 0.2])
    _, azimuth, elevation = CAMERA.predict(STATE, dcm=dcm)
    expected = [
        np.cos(elevation) * np.cos(azimuth),
        np.cos(elevation) * np.sin(azimuth),
        np.sin(elevation),
    ]
    np.testing.assert_allclose(direction.predict(STATE, dcm=dcm), expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: type(s).__name__)
def test_broadcasting_is_a_loop(sensor, rng):
    states = rng.normal(size=(5, 1, 6)) * 100
    attitudes = ln.attitude.dcm_from_mrp(rng.normal(size=(3, 3)))
    targets = rng.normal(size=(5, 3, 3))
    predicted = sensor.predict(states, dcm=attitudes, target=targets)
    jacobian = sensor.jacobian(states, dcm=attitudes, target=targets)
    rows = len(sensor.noise())
    assert predicted.shape == (5, 3, rows)
    assert jacobian.shape == (5, 3, rows, 6)
    for i in range(5):
        for k in range(3):
            one = {"dcm": attitudes[k], "target": targets[i, k]}
            assert (predicted[i, k] == sensor.predict(states[i, 0], **one)).all()
            assert (jacobian[i, k] == sensor.jacobian(states[i, 0], **one)).all()
    placed = type(sensor)(*[1.0] * (rows - rows // 2), target=targets[0, 0])
    assert (placed.predict(states[0, 0], dcm=attitudes[0]) == predicted[0, 0]).all()


@pytest.mark.parametrize("sensor", SENSORS, ids=lambda s: type(s).__name__)
def test_simulation_has_the_stated_noise(sensor):
    states = np.broadcast_to(STATE, (5000, 6))
    dcm = ln.attitude.dcm_from_mrp([0.3, -0.2, 0.1])
    measured = sensor.simulate(states, 7, dcm=dcm)
    assert (measured == sensor.simulate(states, np.random.default_rng(7), dcm=dcm)).all()
    error = sensor.residual(measured, sensor.predict(states, dcm=dcm)) / np.sqrt(np.diag(sensor.noise()))
    low, high = stats.chi2.ppf([BAND / 2, 1 - BAND / 2], len(error))
    assert ((low < np.square(error).sum(axis=0)) & (np.square(error).sum(axis=0) < high)).all()


def test_simulated_azimuths_are_wrapped():
    behind = np.broadcast_to([5.0, 0.0, 0.0], (1000, 3))
    azimuth = CAMERA.simulate(behind, 1, dcm=np.eye(3))[:, 1]
    assert ((-np.pi < azimuth) & (azimuth <= np.pi)).all()
    assert 400 < (azimuth < 0).sum() < 600


def test_sensors_are_values():
    sensor = pickle.loads(pickle.dumps(ln.sensors.RangeBearing(0.2, 6e-4, target=[1.0, 2.0, 3.0])))
    assert (sensor.sigma_range, sensor.sigma_angle, list(sensor.target)) == (0.2, 6e-4, [1.0, 2.0, 3.0])
    with pytest.raises(AttributeError):
        sensor.sigma_range = 1.0
    with pytest.raises(ValueError, match="read-only"):
        CAMERA.target[0] = 1.0
    assert "sigma_angle=0.0006" in repr(sensor)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.sensors.RangeBearing(0.0, 1e-3), "sigma_range"),
        (lambda: ln.sensors.RangeBearing(1.0, np.nan), "sigma_angle"),
        (lambda: ln.sensors.Range([1.0, 2.0]), "sigma"),
        (lambda: ln.sensors.Range(1.0, target=[1.0, 2.0]), "target"),
        (lambda: ln.sensors.Range(1.0, target=np.zeros((2, 3))), "target"),
        (lambda: CAMERA.predict(STATE), "dcm"),
        (lambda: CAMERA.predict(STATE, dcm=2 * np.eye(3)), "dcm"),
        (lambda: CAMERA.predict(STATE, dcm=np.eye(3), target=[1.0]), "target"),
        (lambda: CAMERA.predict(np.zeros(6), dcm=np.eye(3)), "state: the target coincides"),
        (lambda: CAMERA.predict([0, 0, 5.0], dcm=np.eye(3)), "state: the target is on the z axis"),
        (lambda: CAMERA.predict([[1, 0, 5.0], [0, 0, 5]], dcm=np.eye(3)), r"state: .*state 1 of the batch"),
        (lambda: CAMERA.predict([1e200, 0, 0], dcm=np.eye(3)), "state: the target is too far"),
        (lambda: ln.sensors.Range(1.0).predict(np.zeros(3)), "state: the target coincides"),
        (lambda: ln.sensors.RangeRate(1.0).predict(STATE[:3]), "state: expected"),
        (lambda: ln.sensors.RangeRate(1.0).predict((STATE[:3], np.zeros(3))), "state: expected"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

"""The listed sensors against the oracle: prediction, Jacobian, simulation, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from scipy import stats

import losnav as ln
from tests import strategies
from tests.conftest import BAND, JACOBIAN, ROUNDING
from tests.oracle import los as oracle

LANDMARKS = np.array([[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0]])
POSITION = np.array([-50.0, 50, 500])
MRP = np.array([0.09, -0.04, 0.03])
DCM = ln.attitude.dcm_from_mrp(MRP)
STATE = np.array([*POSITION, 0.01, -0.075, -0.2])


def sensor(sigma=1e-3):
    return ln.sensors.LineOfSight(LANDMARKS, sigma)


@given(strategies.scenes(maximum=6))
def test_prediction_and_jacobian_are_the_oracles(scene):
    los = ln.sensors.LineOfSight(scene.landmarks, scene.sigma)
    pose = (scene.position, scene.mrp)
    expected = oracle.los_tangent_jacobian(scene.landmarks, scene.position, scene.dcm).reshape(-1, 6)
    np.testing.assert_allclose(los.predict(pose), scene.los.ravel(), rtol=0, atol=10 * ROUNDING)
    for columns in (slice(0, 3), slice(3, 6)):
        scale = np.abs(expected[:, columns]).max()
        got = los.jacobian(pose)[:, columns]
        np.testing.assert_allclose(got, expected[:, columns], rtol=0, atol=10 * JACOBIAN * scale)


def test_each_kind_of_state_has_its_columns():
    los = sensor()
    pose = los.jacobian((POSITION, MRP))
    assert pose.shape == (12, 6)
    with_velocity = los.jacobian(STATE, dcm=DCM)
    assert with_velocity.shape == (12, 6)
    np.testing.assert_allclose(with_velocity[:, :3], pose[:, :3], rtol=0, atol=1e-16)
    assert (with_velocity[:, 3:] == 0).all()
    assert (los.jacobian(POSITION, dcm=DCM) == with_velocity[:, :3]).all()
    assert (los.predict(STATE, dcm=DCM) == los.predict(POSITION, dcm=DCM)).all()


def test_a_solution_is_a_state():
    measured = sensor().predict((POSITION, MRP)).reshape(4, 3)
    solution = ln.solve_pose(LANDMARKS, measured, guess=[*POSITION, *MRP])
    np.testing.assert_allclose(sensor().predict(solution), measured.ravel(), rtol=0, atol=1e-12)


def test_broadcasting_is_a_loop(rng):
    los = sensor()
    states, attitudes = rng.normal(size=(5, 1, 6)) * 100, ln.attitude.dcm_from_mrp(rng.normal(size=(3, 3)))
    marks = LANDMARKS + rng.normal(size=(5, 3, 4, 3))
    predicted = los.predict(states, dcm=attitudes, landmarks=marks)
    jacobian = los.jacobian(states, dcm=attitudes, landmarks=marks)
    assert predicted.shape == (5, 3, 12)
    assert jacobian.shape == (5, 3, 12, 6)
    for i in range(5):
        for k in range(3):
            one = {"dcm": attitudes[k], "landmarks": marks[i, k]}
            assert (predicted[i, k] == los.predict(states[i, 0], **one)).all()
            assert (jacobian[i, k] == los.jacobian(states[i, 0], **one)).all()
    assert los.predict(np.zeros((0, 6)), dcm=DCM).shape == (0, 12)
    many = rng.normal(size=(2000, 3)) * 100 + 300
    assert (los.predict(many, dcm=DCM)[-1] == los.predict(many[-1], dcm=DCM)).all()


def test_simulation_has_the_stated_noise():
    """Two degrees of freedom a direction: chi-square over all of them, one sigma for each landmark."""
    sigma = np.array([1e-5, 2e-5, 3e-5, 4e-5])
    los = sensor(sigma)
    states = np.broadcast_to(POSITION, (2000, 3))
    measured = los.simulate(states, 7, dcm=DCM)
    assert (measured == los.simulate(states, np.random.default_rng(7), dcm=DCM)).all()
    np.testing.assert_allclose(np.linalg.norm(measured.reshape(-1, 3), axis=-1), 1, rtol=0, atol=ROUNDING)
    error = (measured - los.predict(states, dcm=DCM)).reshape(-1, 4, 3)
    for k in range(4):
        total = np.square(error[:, k] / sigma[k]).sum()
        low, high = stats.chi2.ppf([BAND / 2, 1 - BAND / 2], 2 * len(states))
        assert low < total < high
    np.testing.assert_array_equal(np.diag(los.noise()), np.repeat(sigma**2, 3))


def test_sensors_are_values():
    los = pickle.loads(pickle.dumps(sensor()))
    assert (los.landmarks == LANDMARKS).all()
    with pytest.raises(AttributeError):
        los.sigma = 1.0
    with pytest.raises(ValueError, match="read-only"):
        sensor().landmarks[0, 0] = 1.0


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.sensors.LineOfSight(LANDMARKS, 0.0), "sigma"),
        (lambda: ln.sensors.LineOfSight(LANDMARKS, [1e-3, 1e-3]), "sigma"),
        (lambda: ln.sensors.LineOfSight(LANDMARKS[0], 1e-3), "landmarks"),
        (lambda: sensor().predict(STATE), "dcm"),
        (lambda: sensor().predict((POSITION, MRP), dcm=DCM), "dcm"),
        (lambda: sensor().predict(STATE, dcm=2 * DCM), "dcm"),
        (lambda: sensor().predict(STATE[:4], dcm=DCM), "state"),
        (lambda: sensor().predict(STATE, dcm=DCM, landmarks=[1.0, 2.0, 3.0]), "landmarks"),
        (lambda: sensor([1e-3] * 4).predict(STATE, dcm=DCM, landmarks=LANDMARKS[:3]), "landmarks"),
        (lambda: sensor().predict(LANDMARKS[1], dcm=DCM), "state: landmark 1"),
        (
            lambda: sensor().jacobian(
                LANDMARKS[:, :3] + [[5, 0, 0], [0, 0, 0], [5, 0, 0], [5, 0, 0]], dcm=DCM
            ),
            "state",
        ),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

"""The filter from outside: steps, arcs, what a failure leaves, copies."""

import copy
import pickle

import numpy as np
import pytest

import losnav as ln

ORBIT = ln.dynamics.ClohessyWiltshire(mean_motion=1.04248275e-3, acceleration_psd=1e-9)
CAMERA = ln.sensors.RangeBearing(sigma_range=0.2, sigma_angle=6e-4)
START = np.array([-510.0, 0.0, 10.0, 0.0, 0.0, 0.0])
SPREAD = np.diag([100.0] * 3 + [2.5e-3] * 3)
TRUTH = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
# Boresight along -x of the orbital frame: the azimuth of the target stays near the cut of the angle.
AWAY = np.diag([-1.0, -1.0, 1.0])
TIMES = 60.0 * np.arange(1, 31)


def filter_of(**options):
    return ln.ExtendedKalmanFilter(ORBIT, START, SPREAD, **options)


def arc(runs=None, dcm=None, seed=0):
    truth = ORBIT.trajectory(TRUTH, np.r_[0.0, TIMES])[1:]
    rng = np.random.default_rng(seed)
    one = [CAMERA.simulate(truth, rng, dcm=AWAY if dcm is None else dcm) for _ in range(runs or 1)]
    return np.stack(one) if runs else one[0]


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_an_angle_across_its_cut_is_a_small_innovation(form):
    log = filter_of(form=form).run(TIMES, [(CAMERA, arc())], dcm=AWAY)
    azimuth = log.innovation[:, 1]
    assert (np.abs(arc()[:, 1]) > 3.0).all()
    assert np.abs(azimuth[5:]).max() < 0.01
    assert log.accepted.all()


def test_a_unit_vector_measures_two_numbers():
    camera = ln.sensors.LineOfSight([[0.0, 0.0, 0.0], [5.0, 0.0, 1.0]], sigma=1e-3)
    ekf = filter_of()
    step = ekf.update(camera, camera.predict(START, dcm=np.eye(3)), dcm=np.eye(3))
    assert step.dof == 4
    assert step.innovation.shape == (6,)
    assert step.gain.shape == (6, 6)


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_an_arc_is_the_same_steps_one_by_one(form):
    z = arc()
    log = filter_of(form=form, gate=0.99).run(TIMES, [(CAMERA, z)], dcm=AWAY)
    ekf = filter_of(form=form, gate=0.99)
    for k in range(TIMES.size):
        step = ekf.step(60.0, CAMERA, z[k], dcm=AWAY)
        np.testing.assert_array_equal(ekf.state, log.state[k])
        np.testing.assert_array_equal(ekf.covariance, log.covariance[k])
        assert step.nis == log.nis[k, 0]
        np.testing.assert_array_equal(step.innovation, log.innovation[k])


def test_a_filter_ends_where_its_arc_ends():
    ekf = filter_of()
    log = ekf.run(TIMES, [(CAMERA, arc())], dcm=AWAY)
    np.testing.assert_array_equal(ekf.state, log.state[-1])
    np.testing.assert_array_equal(ekf.covariance, log.covariance[-1])
    assert ekf.time == TIMES[-1]


def test_a_filter_of_many_arcs_stays():
    ekf = filter_of()
    log = ekf.run(TIMES, [(CAMERA, arc(runs=3))], dcm=AWAY)
    assert log.state.shape == (3, 30, 6)
    np.testing.assert_array_equal(ekf.state, START)
    assert ekf.time == 0.0


def test_a_missing_measurement_is_none():
    z = arc()
    z[4] = np.nan
    log = filter_of(gate=0.99).run(TIMES, [(CAMERA, z)], dcm=AWAY)
    assert not log.accepted[4, 0]
    assert np.isnan(log.nis[4, 0])
    assert log.accepted[5, 0]


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_a_failed_update_changes_nothing(form):
    ekf = filter_of(form=form)
    ekf.step(60.0, CAMERA, arc()[0], dcm=AWAY)
    before = pickle.dumps(ekf)
    on_the_target = ln.sensors.RangeBearing(0.2, 6e-4, target=ekf.state[:3])
    with pytest.raises(ln.DegenerateGeometryError, match="unchanged"):
        ekf.update(on_the_target, [1.0, 0.0, 0.0], dcm=AWAY)
    with pytest.raises(ln.InvalidInputError, match="z"):
        ekf.update(CAMERA, [1.0, 0.0], dcm=AWAY)
    with pytest.raises(ln.InvalidInputError, match="dcm"):
        ekf.update(CAMERA, [1.0, 0.0, 0.0])
    assert pickle.dumps(ekf) == before


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])
@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_copies_go_on_bit_by_bit(form, duplicate):
    z, ekf = arc(), filter_of(form=form, gate=0.999, consider=(5,))
    ekf.run(TIMES[:10], [(CAMERA, z[:10])], dcm=AWAY)
    other = duplicate(ekf)
    for k in range(10, 20):
        ekf.step(60.0, CAMERA, z[k], dcm=AWAY)
        other.step(60.0, CAMERA, z[k], dcm=AWAY)
    np.testing.assert_array_equal(ekf.state, other.state)
    np.testing.assert_array_equal(ekf.covariance, other.covariance)
    assert ekf.time == other.time


def test_what_is_no_model_says_what_it_lacks():
    with pytest.raises(ln.InvalidInputError, match="sensor: expected an object with predict"):
        filter_of().update(None, [1.0], dcm=AWAY)
    with pytest.raises(ln.InvalidInputError, match="dynamics: expected an object with propagate"):
        ln.ExtendedKalmanFilter(CAMERA, START, SPREAD)
    with pytest.raises(ln.InvalidInputError, match="state: expected 6 components"):
        ln.ExtendedKalmanFilter(ORBIT, START[:5], SPREAD)


def test_each_sensor_is_told_what_concerns_it():
    marks, place = np.array([[0.0, 0.0, 0.0], [0.0, 40.0, 0.0]]), np.array([3.0, 0.0, 0.0])
    camera, laser = ln.sensors.LineOfSight(marks + 1.0, sigma=1e-3), ln.sensors.Range(0.2)
    told = {"dcm": np.eye(3), "landmarks": marks, "target": place}
    seen = [camera.predict(TRUTH, dcm=np.eye(3), landmarks=marks), laser.predict(TRUTH, target=place)]
    ekf = filter_of()
    looked, ranged = ekf.update(camera, seen[0], **told), ekf.update(laser, seen[1], **told)
    assert looked.gain.shape == (6, 6)
    assert ranged.gain.shape == (6, 1)
    log = filter_of().run([0.0], [(camera, seen[:1]), (laser, [seen[1]])], **told)
    np.testing.assert_array_equal(log.state[0], ekf.state)
    with pytest.raises(ln.InvalidInputError, match="target: expected finite numbers"):
        ekf.update(laser, seen[1], target=[np.nan, 0.0, 0.0])
    with pytest.raises(ln.InvalidInputError, match="landmarks: expected shape"):
        ekf.update(camera, seen[0], dcm=np.eye(3), landmarks=place)

"""The doors of the filters on inertial navigation: arcs are steps, copies are copies, errors named."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import losnav as ln
from tests.statistics import hover

CAMERA = ln.sensors.LandmarkCamera(hover.LANDMARKS, 500.0, 1.0)
VELOCIMETER = ln.sensors.Velocimeter(0.01)
SIX = hover.prior()
U = ([0.0, 0.0, 0.014], [0.002, -0.001, 0.01])


class MyVelocimeter:
    """The velocimeter as a user would write it."""

    def predict(self, state):
        return state.dcm @ state.velocity

    def jacobian(self, state):
        v = self.predict(state)
        h = np.zeros((3, 9))
        h[:, 3:6] = state.dcm
        h[:, 6:9] = [[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]
        return h

    def noise(self, state):
        return 1e-4 * np.eye(3)


def made(kind=ln.ExtendedKalmanFilter, dynamics=None, state=hover.START, covariance=SIX, **options):
    return kind(dynamics or hover.model(), state, covariance, **options)


def belief(ekf):
    return ekf.state._numbers(), ekf.covariance, ekf.joint_covariance, ekf.time


def same(a, b):
    return all(np.array_equal(x, y) for x, y in zip(belief(a), belief(b), strict=True))


@pytest.fixture(scope="module")
def flight():
    flights = hover.Hover(1, seed=4)
    return flights.pixels()[0], flights.velocities[0], [u[0] for u in flights.controls]


@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.PredictiveFilter])
@pytest.mark.parametrize("options", [{}, {"gate": 0.999}, {"iterations": 3, "underweighting": 0.2}])
def test_an_arc_is_a_loop_of_steps(flight, kind, options):
    pixels, velocities, (force, rate) = flight
    if kind is ln.PredictiveFilter and "gate" in options:
        options = {**options, "expectation": "series"}
    ekf = made(kind, **options)
    looks = [(CAMERA, pixels), (VELOCIMETER, velocities)]
    log = ekf.copy().run(hover.TIMES, looks, (force, rate), substeps=hover.SUBSTEPS)
    for k in range(20):
        for j in range(k * hover.SUBSTEPS, (k + 1) * hover.SUBSTEPS):
            ekf.predict(hover.STEP, (force[j], rate[j]))
        if kind is ln.PredictiveFilter:
            steps = ekf.epoch([(CAMERA, pixels[k]), (VELOCIMETER, velocities[k])])
            np.testing.assert_array_equal(ekf.model_error, log.model_error[k])
        else:
            steps = [ekf.update(CAMERA, pixels[k]), ekf.update(VELOCIMETER, velocities[k])]
        np.testing.assert_allclose(ekf.state._numbers(), log.state._numbers()[k], rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(ekf.covariance, log.covariance[k], rtol=1e-9)
        np.testing.assert_allclose([s.nis for s in steps], log.nis[k], rtol=1e-9)
        assert [s.dof for s in steps] == list(log.dof[k])


def test_runs_of_a_batch_are_runs_by_themselves():
    flights = hover.Hover(3, seed=5)
    pixels, looks = flights.pixels(), flights.velocities
    start = flights.start
    together = made(state=start)
    log = together.run(hover.TIMES, [(CAMERA, pixels), (VELOCIMETER, looks)], flights.controls, substeps=10)
    for run in range(3):
        alone = made(state=start[run])
        controls = tuple(u[run] for u in flights.controls)
        one = alone.run(
            hover.TIMES, [(CAMERA, pixels[run]), (VELOCIMETER, looks[run])], controls, substeps=10
        )
        np.testing.assert_array_equal(one.covariance, log.covariance[run])
        np.testing.assert_array_equal(one.state._numbers(), log.state._numbers()[run])
    np.testing.assert_array_equal(together.state._numbers(), log.state._numbers()[:, -1])
    assert together.time == hover.TIMES[-1]
    with pytest.raises(ln.InvalidInputError, match="state: this filter holds a batch"):
        together.update(VELOCIMETER, looks[0, 0])


def test_numbers_of_a_step(flight):
    pixels, _, _ = flight
    ekf = made()
    before = ekf.state, ekf.covariance
    step = ekf.update(CAMERA, pixels[0])
    h = CAMERA.jacobian(before[0])[:, :9]
    s = h @ before[1] @ h.T + CAMERA.noise(before[0])
    np.testing.assert_allclose(step.innovation_covariance, s, rtol=1e-9)
    np.testing.assert_allclose(step.gain, np.linalg.solve(s, h @ before[1]).T, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(step.innovation, pixels[0] - CAMERA.predict(before[0]), atol=1e-9)
    np.testing.assert_allclose(step.nis, step.innovation @ np.linalg.solve(s, step.innovation), rtol=1e-8)
    np.testing.assert_array_equal(step.prior_state._numbers(), before[0]._numbers())
    expected = before[1] - step.gain @ s @ step.gain.T
    np.testing.assert_allclose(ekf.covariance, expected, rtol=1e-5, atol=1e-9)
    delta = step.gain @ step.innovation
    np.testing.assert_allclose(ekf.state.minus(before[0], 9), delta, rtol=1e-6, atol=1e-9)
    again = pickle.loads(pickle.dumps(step))
    assert (again.nis, again.dof, list(again.used)) == (step.nis, step.dof, list(step.used))


def test_what_is_only_considered_has_no_gain(flight):
    pixels, _, _ = flight
    ekf = made(consider=[6, 7, 8])
    step = ekf.update(CAMERA, pixels[0])
    assert (step.gain[6:] == 0.0).all()
    assert (step.gain[:3] != 0.0).any()
    delta = ekf.state.minus(hover.START, 9)
    np.testing.assert_allclose(delta, step.gain @ step.innovation, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(ekf.covariance[6:, 6:], SIX[6:, 6:], rtol=1e-12)


def test_a_pose_used_at_once_is_the_pose_of_now(flight):
    pixels, _, _ = flight
    direct, through = made(), made()
    direct.update(CAMERA, pixels[0])
    through.update(CAMERA, pixels[0], clone=through.clone())
    np.testing.assert_allclose(through.state._numbers(), direct.state._numbers(), rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(through.covariance, direct.covariance, rtol=1e-9, atol=1e-18)
    assert through.poses == {}


def test_poses_come_and_go(flight):
    pixels, velocities, _ = flight
    ekf = made()
    first = ekf.clone()
    ekf.predict(1.0, U)
    second = ekf.clone()
    ekf.predict(1.0, U)
    assert list(ekf.poses) == [first, second]
    assert ekf.joint_covariance.shape == (21, 21)
    np.testing.assert_array_equal(ekf.poses[first][0], hover.START.position)
    ekf.update(VELOCIMETER, velocities[1])
    ekf.update(CAMERA, pixels[0], clone=second)
    assert list(ekf.poses) == [first]
    ekf.drop(first)
    assert ekf.joint_covariance.shape == (9, 9)
    np.testing.assert_array_equal(ekf.joint_covariance, ekf.covariance)
    with pytest.raises(ln.InvalidInputError, match="key: no pose"):
        ekf.drop(first)
    with pytest.raises(ln.InvalidInputError, match="clone: no pose"):
        ekf.update(CAMERA, pixels[0], clone=first)


def test_factors_have_no_room_for_constants(flight):
    pixels, _, _ = flight
    mapped = ln.sensors.LandmarkCamera(hover.LANDMARKS, 500.0, 1.0, landmark_sigma=1.0, map_errors="consider")
    ekf = made(form="ud")
    for call, argument in [
        (ekf.clone, "clone"),
        (lambda: ekf.update(mapped, pixels[0]), "map_errors"),
        (lambda: ekf.run([1.0], [(mapped, pixels[:1])]), "map_errors"),
        (lambda: ekf.run([1.0], [(ln.sensors.Delayed(CAMERA, 1.0), pixels[:1])]), "measurements"),
    ]:
        with pytest.raises(ln.InvalidInputError, match=f'{argument}.* need form="joseph"'):
            call()


@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.PredictiveFilter])
def test_copies(flight, kind):
    pixels, velocities, _ = flight
    camera = ln.sensors.LandmarkCamera(hover.LANDMARKS, 500.0, 1.0, landmark_sigma=0.5, map_errors="estimate")
    ekf = made(kind, gate=0.99)
    ekf.update(camera, pixels[0])
    ekf.clone()
    ekf.predict(1.0, U)
    for other in (ekf.copy(), pickle.loads(pickle.dumps(ekf))):
        assert type(other) is type(ekf)
        assert same(ekf, other)
        np.testing.assert_array_equal(ekf.landmarks(camera), other.landmarks(camera))
        assert (ekf.landmarks(camera) != hover.LANDMARKS).all()
        other.update(VELOCIMETER, velocities[0])
        assert not same(ekf, other)
        third = ekf.copy()
        third.update(VELOCIMETER, velocities[0])
        assert same(third, other)


def test_landmarks_that_are_estimated_move(flight):
    pixels, _, _ = flight
    camera = ln.sensors.LandmarkCamera(hover.LANDMARKS, 500.0, 1.0, landmark_sigma=2.0, map_errors="estimate")
    ekf = made()
    image = pixels[0].copy()
    image[6:] = np.nan
    ekf.update(camera, image)
    moved = np.linalg.norm(ekf.landmarks(camera) - hover.LANDMARKS, axis=1)
    assert (moved[:3] > 0).all()
    assert (moved[3:] == 0).all()
    assert ekf.joint_covariance.shape == (18, 18)
    considered = ln.sensors.LandmarkCamera(
        hover.LANDMARKS, 500.0, 1.0, landmark_sigma=2.0, map_errors="consider"
    )
    schmidt = made()
    schmidt.update(considered, image)
    np.testing.assert_array_equal(schmidt.landmarks(considered), hover.LANDMARKS)
    np.testing.assert_allclose(schmidt.joint_covariance[9:, 9:], 4 * np.eye(9), atol=1e-12)
    # The first update of the state is the same whether landmarks are corrected or not.
    np.testing.assert_allclose(schmidt.state._numbers(), ekf.state._numbers(), rtol=1e-10, atol=1e-12)


def test_a_sensor_of_the_user():
    mine, theirs = made(gate=0.999), made(gate=0.999)
    z = [0.5, 0.3, 2.1]
    a, b = mine.update(MyVelocimeter(), z), theirs.update(VELOCIMETER, z)
    np.testing.assert_allclose(mine.state._numbers(), theirs.state._numbers(), rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(mine.covariance, theirs.covariance, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose([a.nis, a.dof], [b.nis, b.dof], rtol=1e-9)
    np.testing.assert_allclose(a.gain, b.gain, rtol=1e-8, atol=1e-12)
    mine.step(0.1, MyVelocimeter(), z, U)
    theirs.step(0.1, VELOCIMETER, z, U)
    np.testing.assert_allclose(mine.state._numbers(), theirs.state._numbers(), rtol=1e-10, atol=1e-12)
    with pytest.raises(ln.InvalidInputError, match="built-in sensors"):
        mine.run([1.0], [(MyVelocimeter(), [z])])


def test_rejections_and_locking_on_again():
    ekf = made(gate=0.999, relock_after=2)
    wrong = [50.0, 0.0, 0.0]
    before = belief(ekf)
    for _ in range(2):
        step = ekf.update(VELOCIMETER, wrong)
        assert not step.accepted
        assert step.nis > 1e3
        assert not step.used.any()
    assert all(np.array_equal(x, y) for x, y in zip(before, belief(ekf), strict=True))
    assert ekf.update(VELOCIMETER, wrong).accepted


def test_missing_measurements():
    ekf = made()
    before = belief(ekf)
    step = ekf.update(VELOCIMETER, [np.nan, 0.0, 0.0])
    assert not step.accepted
    assert np.isnan(step.nis)
    step = ekf.update(CAMERA, np.full(16, np.nan))
    assert not step.accepted
    assert all(np.array_equal(x, y) for x, y in zip(before, belief(ekf), strict=True))


def test_smoothing_an_arc(flight):
    pixels, velocities, controls = flight
    log = made().run(hover.TIMES, [(CAMERA, pixels), (VELOCIMETER, velocities)], tuple(controls), substeps=10)
    smooth = log.smooth()
    np.testing.assert_array_equal(smooth.state._numbers()[-1], log.state._numbers()[-1])
    assert (smooth.sigma[:-1] < log.sigma[:-1]).all()


BAD = [
    ({"state": np.zeros(15)}, "state: expected a NavState"),
    ({"covariance": np.eye(15)}, "covariance"),
    ({"covariance": -SIX}, "covariance"),
    ({"gate": 0.0}, "gate"),
    ({"form": "square-root"}, "form"),
    ({"iterations": 0}, "iterations"),
    ({"consider": [9]}, "consider"),
    ({"time": np.nan}, "time"),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.PredictiveFilter])
def test_what_is_refused(kind, changes, message):
    with pytest.raises(ln.InvalidInputError, match=message):
        made(kind, **changes)


def test_what_is_refused_later(flight):
    pixels, _, (force, rate) = flight
    ekf = made()
    before = belief(ekf)
    for call, message in [
        (lambda: ekf.predict(np.nan, U), "dt"),
        (lambda: ekf.predict(1.0, ([0.0, 0.0], [0.0, 0.0, 0.0])), "specific_force"),
        (lambda: ekf.predict(1.0, ([0.0, 0.0, np.inf], [0.0, 0.0, 0.0])), "control"),
        (lambda: ekf.predict(1.0, np.zeros(5)), "control"),
        (lambda: ekf.update(VELOCIMETER, [0.0, 0.0]), "z"),
        (lambda: ekf.update(VELOCIMETER, [0.0, np.inf, 0.0]), "z"),
        (lambda: ekf.run([1.0, 2.0], [(VELOCIMETER, np.zeros((3, 3)))]), r"measurements\[0\]"),
        (lambda: ekf.run(hover.TIMES, [], (force[:-1], rate[:-1]), substeps=10), "controls"),
        (lambda: ekf.run(hover.TIMES, [], (force, rate), substeps=0), "substeps"),
        (lambda: ekf.run([1.0], [VELOCIMETER]), "measurements"),
        (lambda: ln.PredictiveFilter(hover.model(), hover.START, SIX, weight=-1.0), "weight"),
        (lambda: ln.PredictiveFilter(hover.model(), hover.START, SIX, expectation="lie"), "expectation"),
        (
            lambda: ln.filters.InertialKalmanFilter(hover.model(), hover.START, SIX, adaptive=(2, 1, 5)),
            "adaptive",
        ),
        (lambda: ln.ExtendedKalmanFilter(ln.dynamics.TwoBody(1.0), hover.START, np.eye(6)), "state"),
    ]:
        with pytest.raises(ln.InvalidInputError, match=message):
            call()
    upside_down = made(state=ln.NavState(hover.START.position, [0.0] * 3, [0.0, 0.0, 0.0, 1.0]))
    with pytest.raises(ln.DegenerateGeometryError, match="behind the camera"):
        upside_down.update(CAMERA, pixels[0])
    assert all(np.array_equal(x, y) for x, y in zip(before, belief(ekf), strict=True))
    with pytest.raises(ln.NumericalError, match="not finite"):
        ekf.predict(1e200, U)
    assert all(np.array_equal(x, y) for x, y in zip(before, belief(ekf), strict=True))

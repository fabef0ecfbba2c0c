"""Camera, velocimeter and altimeter against the oracle: prediction, Jacobian, noise, and what is refused."""

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

DOWN = np.diag([1.0, -1.0, -1.0])  # body axes East, South, down
MARKS = np.array([[10.0, -20.0, 0.0], [-30.0, 5.0, 2.0], [40.0, 40.0, -1.0], [0.0, 3.0, 0.5]])
STATE = ln.NavState.from_dcm([4.0, -3.0, 120.0], [1.0, 0.5, -5.0], DOWN)


def camera(**options):
    return ln.sensors.LandmarkCamera(MARKS, 500.0, 1.0, **options)


class Case:
    """A lander anywhere above a field of landmarks that its camera has in front."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.size = 10.0 ** rng.uniform(-1, 4)
        self.dcm = ln.attitude.dcm_from_mrp(rng.normal(size=3))
        self.position, self.velocity = rng.normal(size=3) * self.size, rng.normal(size=3)
        self.mounting = ln.attitude.dcm_from_mrp(rng.normal(size=3))
        self.lever_arm = rng.normal(size=3) * 0.05 * self.size
        self.focal, self.center = 10.0 ** rng.uniform(1, 4, size=2), rng.normal(size=2) * 500
        seen = np.column_stack([rng.normal(size=(5, 2)), rng.uniform(0.5, 3.0, 5)]) * self.size
        self.marks = self.position + (seen @ self.mounting + self.lever_arm) @ self.dcm
        roots = rng.normal(size=(5, 3, 3))
        self.covariances = 0.01 * self.size**2 * (roots @ roots.transpose(0, 2, 1))
        self.sigmas = rng.uniform(0.5, 2.0, 5)

    @property
    def state(self):
        return ln.NavState.from_dcm(self.position, self.velocity, self.dcm)

    def sensor(self, **options):
        return ln.sensors.LandmarkCamera(
            self.marks,
            self.focal,
            self.sigmas,
            self.covariances,
            principal_point=self.center,
            camera_from_body=self.mounting,
            lever_arm=self.lever_arm,
            **options,
        )

    def pixels(self, position, alpha, marks=None):
        dcm = oracle.turned(self.dcm, alpha)
        marks = self.marks if marks is None else marks
        placed = {"mounting": self.mounting, "lever_arm": self.lever_arm}
        return oracle.pinhole(position, dcm, marks, self.focal, self.center, **placed)


def assert_rows(got, expected):
    """Entries relative to the largest of their row."""
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    np.testing.assert_allclose(got / scale, expected / scale, rtol=0, atol=100 * JACOBIAN)


@given(st.integers(0, 2**32 - 1))
def test_camera_is_the_oracles(seed):
    case = Case(seed)
    sensor, zero = case.sensor(), np.zeros(3)
    exact = case.pixels(case.position, zero)
    np.testing.assert_allclose(
        sensor.predict(case.state), exact, rtol=0, atol=1e-10 * case.focal.max() + 1e-10
    )
    slope = oracle.jacobian(case.pixels, case.position, zero)
    jacobian = sensor.jacobian(case.state)
    assert jacobian.shape == (10, 15)
    assert_rows(jacobian[:, :3], slope[:, :3])
    assert_rows(jacobian[:, 6:9], slope[:, 3:])
    assert (jacobian[:, 3:6] == 0).all()
    assert (jacobian[:, 9:] == 0).all()


@given(st.integers(0, 2**32 - 1))
def test_the_map_is_noise_of_the_pixels_or_is_not(seed):
    """R = sigma^2 I + H_L S H_L', by complex step along the landmark."""
    case = Case(seed)
    expected = np.diag(np.repeat(case.sigmas**2, 2))
    for choice in ("consider", "estimate", "ignore"):
        np.testing.assert_array_equal(case.sensor(map_errors=choice).noise(case.state), expected)
    for i in range(5):
        h = oracle.jacobian(lambda p, i=i: case.pixels(case.position, np.zeros(3), [p]), case.marks[i])
        block = slice(2 * i, 2 * i + 2)
        expected[block, block] += h @ case.covariances[i] @ h.T
    scale = np.abs(expected).max()
    noise = case.sensor().noise(case.state)
    np.testing.assert_allclose(noise / scale, expected / scale, rtol=0, atol=1e-11)


def test_axes_of_the_camera():
    """Boresight +z, x right, y down: seen from above with body axes East, South, down."""
    camera = ln.sensors.LandmarkCamera([[10.0, -20.0, 0.0]], 500.0, 1.0, principal_point=(512.0, 500.0))
    here = ln.NavState.from_dcm([0.0, 0.0, 100.0], np.zeros(3), DOWN)
    np.testing.assert_allclose(camera.predict(here), [512 + 50, 500 + 100], rtol=SAME_FORMULA)
    # A body turned about x by a small angle sees what is ahead move up or down.
    turn = np.array([1e-6, 0.0, 0.0])
    moved = ln.NavState.from_dcm(here.position, here.velocity, oracle.turned(DOWN, turn))
    centered = ln.sensors.LandmarkCamera([[0.0, 0.0, 0.0]], 500.0, 1.0)
    np.testing.assert_allclose(centered.predict(moved), [0.0, 500e-6], rtol=0, atol=1e-9)
    np.testing.assert_allclose(centered.jacobian(here)[:, 6:9], [[0, -500, 0], [500, 0, 0]], atol=1e-9)


def test_a_landmark_behind_the_camera_is_an_error_not_a_mirrored_pixel():
    sensor = camera()
    above = [*MARKS[:3], [0.0, 0.0, 121.0]]
    with pytest.raises(ln.InvalidInputError, match="landmark 3 is behind the camera"):
        sensor.predict(STATE, landmarks=above)
    batch = [MARKS, above]
    with pytest.raises(
        ln.InvalidInputError, match=r"landmark 3 is behind the camera \(state 1 of the batch\)"
    ):
        sensor.jacobian(STATE, landmarks=batch)
    level = [*MARKS[:3], [7.0, 0.0, 120.0]]
    with pytest.raises(ln.InvalidInputError, match="landmark 3 is behind"):
        sensor.predict(STATE, landmarks=level)
    assert sensor.visible(STATE, landmarks=batch).tolist() == [[True] * 4, [True] * 3 + [False]]
    seen = sensor.simulate(STATE, 3, landmarks=above)
    assert np.isnan(seen).tolist() == [False] * 6 + [True] * 2


def test_the_image_ends():
    """Centred at the boresight, or from the corner where the principal point says so."""
    marks = np.array([[0.0, 0, 0], [110, 0, 0], [-110, 0, 0], [0, 50, 0], [0, -60, 0]])
    here = ln.NavState.from_dcm([0.0, 0.0, 100.0], np.zeros(3), DOWN)
    centered = ln.sensors.LandmarkCamera(marks, 500.0, 1.0, image_size=(1200, 510))
    assert centered.visible(here).tolist() == [True, True, True, True, False]
    corner = ln.sensors.LandmarkCamera(marks, 500.0, 1.0, image_size=(1200, 510), principal_point=(600, 200))
    assert corner.visible(here).tolist() == [True, True, True, False, True]
    shifted = ln.sensors.LandmarkCamera(marks, 500.0, 1.0, image_size=(1200, 510), principal_point=(60, 255))
    assert shifted.visible(here).tolist() == [True, True, False, True, False]
    assert ln.sensors.LandmarkCamera(marks, 500.0, 1.0).visible(here).all()
    z = corner.simulate(ln.NavState.from_dcm(np.zeros((4, 3)) + here.position, np.zeros(3), DOWN), 1)
    assert (np.isnan(z).reshape(4, 5, 2).all(axis=-1) == ~corner.visible(here)).all()


def test_simulation_has_the_noise_of_the_image():
    sensor = ln.sensors.LandmarkCamera(MARKS, 500.0, [0.5, 1.0, 2.0, 3.0], landmark_sigma=1.0)
    states = ln.NavState.from_dcm(np.broadcast_to(STATE.position, (4000, 3)), np.zeros(3), DOWN)
    z = sensor.simulate(states, 11)
    assert (z == sensor.simulate(states, np.random.default_rng(11))).all()
    error = (z - sensor.predict(STATE)) / np.repeat(sensor.sigma_px, 2)
    low, high = stats.chi2.ppf([BAND / 2, 1 - BAND / 2], len(error))
    total = np.square(error).sum(axis=0)
    assert ((low < total) & (total < high)).all()


@given(st.integers(0, 2**32 - 1))
def test_velocimeter_and_altimeter_are_the_oracles(seed):
    case = Case(seed)
    zero = np.zeros(3)
    beams = np.random.default_rng(seed).normal(size=(4, 3))
    beams /= np.linalg.norm(beams, axis=1, keepdims=True)
    for lines in (None, beams):
        sensor, axes = ln.sensors.Velocimeter(0.01, lines), np.eye(3) if lines is None else lines
        expected = oracle.velocity_along(case.velocity, case.dcm, axes)
        speed = np.linalg.norm(case.velocity)
        np.testing.assert_allclose(sensor.predict(case.state), expected, rtol=0, atol=SAME_FORMULA * speed)

        def along(v, a, axes=axes):
            return oracle.velocity_along(v, oracle.turned(case.dcm, a), axes)

        slope = oracle.jacobian(along, case.velocity, zero)
        jacobian = sensor.jacobian(case.state)
        assert (jacobian[:, :3] == 0).all()
        np.testing.assert_allclose(jacobian[:, 3:6], slope[:, :3], rtol=0, atol=10 * JACOBIAN)
        np.testing.assert_allclose(jacobian[:, 6:9], slope[:, 3:], rtol=0, atol=10 * JACOBIAN * speed)
    position = np.append(case.position[:2], abs(case.position[2]))
    state = ln.NavState.from_dcm(position, case.velocity, case.dcm)
    assert ln.sensors.Altimeter(1.0).predict(state)[0] == position[2]
    assert (ln.sensors.Altimeter(1.0).jacobian(state)[0] == np.eye(15)[2]).all()
    # A beam some 80 degrees about straight down.
    beam = -case.dcm[:, 2] + 0.8 * beams[0] * np.sign(-beams[0] @ case.dcm[:, 2])
    beam /= np.linalg.norm(beam)
    laser = ln.sensors.Altimeter(1.0, beam)
    exact = oracle.distance_to_ground(position, case.dcm, beam)
    np.testing.assert_allclose(laser.predict(state), exact, rtol=SAME_FORMULA)
    slope = oracle.jacobian(
        lambda p, a: oracle.distance_to_ground(p, oracle.turned(case.dcm, a), beam), position, zero
    )
    jacobian = laser.jacobian(state)
    assert_rows(jacobian[:, :3], slope[:, :3])
    np.testing.assert_allclose(jacobian[:, 6:9], slope[:, 3:], rtol=0, atol=100 * JACOBIAN * exact[0])


SENSORS = {
    "camera": (camera(), {"landmarks"}),
    "velocimeter": (ln.sensors.Velocimeter(0.01), set()),
    "beams": (
        ln.sensors.Velocimeter(
            [0.01, 0.02, 0.03, 0.04], [[0.6, 0, 0.8], [0, 0.6, 0.8], [-1, 0, 0], [0, 0, 1]]
        ),
        set(),
    ),
    "altimeter": (ln.sensors.Altimeter(0.5), set()),
    "laser": (ln.sensors.Altimeter(0.5, [0.28, 0.0, 0.96]), set()),
    "line of sight": (ln.sensors.LineOfSight(MARKS, 1e-3), {"landmarks"}),
    "range and bearing": (ln.sensors.RangeBearing(0.2, 1e-3, MARKS[1]), {"target"}),
    "range": (ln.sensors.Range(0.2, MARKS[1]), {"target"}),
    "range rate": (ln.sensors.RangeRate(0.01, MARKS[1]), {"target"}),
}


@pytest.mark.parametrize("name", SENSORS)
def test_every_sensor_takes_a_navigation_state(name):
    """The same as [r v] with the attitude told, and columns [dr dv dalpha] by complex step or difference."""
    sensor, context = SENSORS[name]
    assert set(type(sensor).told) == context
    vector = np.concatenate([STATE.position, STATE.velocity])
    assert (sensor.predict(STATE) == sensor.predict(vector, dcm=DOWN)).all()
    whole, part = sensor.jacobian(STATE), sensor.jacobian(vector, dcm=DOWN)
    rows = len(sensor.noise(STATE))
    assert whole.shape == (rows, 15)
    assert (whole[:, :6] == part).all()
    assert (whole[:, 9:] == 0).all()
    step = 1e-6
    for k in range(9):
        nudge = np.zeros(15)
        nudge[k] = step
        change = sensor.residual(sensor.predict(STATE.inject(nudge)), sensor.predict(STATE.inject(-nudge)))
        np.testing.assert_allclose(whole[:, k], change / (2 * step), rtol=0, atol=1e-6 * np.abs(whole).max())
    with pytest.raises(ln.InvalidInputError, match=r"^dcm"):
        sensor.predict(STATE, dcm=DOWN)
    batch = ln.NavState.from_dcm(np.stack([STATE.position] * 3), STATE.velocity, DOWN)
    assert (sensor.predict(batch) == sensor.predict(STATE)).all()
    assert sensor.jacobian(batch).shape == (3, rows, 15)
    assert sensor.simulate(batch, 1).shape == (3, rows)


@pytest.mark.parametrize("name", ["camera", "velocimeter", "beams", "altimeter", "laser"])
def test_broadcasting_is_a_loop(name, rng):
    sensor, context = SENSORS[name]
    states = rng.normal(size=(5, 1, 6)) + np.array([0, 0, 100, 0, 0, 0])
    attitudes = ln.attitude.dcm_from_mrp(rng.normal(size=(3, 3)) * 0.05) @ DOWN
    told = {"landmarks": MARKS + rng.normal(size=(5, 3, 4, 3))} if context else {}
    predicted = sensor.predict(states, dcm=attitudes, **told)
    jacobian = sensor.jacobian(states, dcm=attitudes, **told)
    # An attitude that is not needed does not make a batch.
    assert predicted.shape[:2] == ((5, 1) if name == "altimeter" else (5, 3))
    predicted = np.broadcast_to(predicted, (5, 3, predicted.shape[-1]))
    jacobian = np.broadcast_to(jacobian, (5, 3, *jacobian.shape[-2:]))
    for i in range(5):
        for k in range(3):
            one = {key: value[i, k] for key, value in told.items()}
            assert (predicted[i, k] == sensor.predict(states[i, 0], dcm=attitudes[k], **one)).all()
            assert (jacobian[i, k] == sensor.jacobian(states[i, 0], dcm=attitudes[k], **one)).all()
    assert sensor.predict(np.zeros((0, 6)), dcm=DOWN).shape == (0, predicted.shape[-1])


def test_a_vertical_height_needs_no_attitude():
    assert ln.sensors.Altimeter(1.0).predict([1.0, 2.0, 30.0]) == [30.0]
    with pytest.raises(ln.InvalidInputError, match=r"^dcm"):
        ln.sensors.Altimeter(1.0, [0.0, 0.0, 1.0]).predict([1.0, 2.0, 30.0])


def test_a_pose_is_a_state_of_the_camera():
    pose = (STATE.position, ln.attitude.mrp_from_dcm(DOWN))
    np.testing.assert_allclose(camera().predict(pose), camera().predict(STATE), rtol=0, atol=1e-10)
    np.testing.assert_allclose(
        camera().jacobian(pose), camera().jacobian(STATE)[:, [0, 1, 2, 6, 7, 8]], rtol=0, atol=1e-10
    )


@pytest.mark.parametrize("name", ["camera", "beams", "laser", "altimeter"])
def test_sensors_are_values(name):
    sensor, _ = SENSORS[name]
    twin = pickle.loads(pickle.dumps(sensor))
    assert (twin.predict(STATE) == sensor.predict(STATE)).all()
    for field in ("landmarks", "sigma_px", "beams", "boresight", "sigma"):
        if getattr(sensor, field, None) is None:
            continue
        with pytest.raises(AttributeError):
            setattr(sensor, field, 1.0)
        with pytest.raises(ValueError, match="read-only"):
            getattr(sensor, field)[...] = 1.0


def test_some_landmarks_of_a_camera():
    whole = ln.sensors.LandmarkCamera(
        MARKS, 500.0, [1.0, 2.0, 3.0, 4.0], [0.1, 0.2, 0.3, 0.4], map_errors="ignore"
    )
    for which in ([1, 3], [False, True, False, True]):
        some = whole.only(which)
        np.testing.assert_array_equal(some.predict(STATE), whole.predict(STATE)[[2, 3, 6, 7]])
        np.testing.assert_array_equal(some.noise(), np.diag([4.0, 4, 16, 16]))
        assert (some.landmark_sigma == [0.2, 0.4]).all()
        assert some.map_errors == "ignore"
    for bad in ([4], [], [True]):
        with pytest.raises(ln.InvalidInputError):
            whole.only(bad)


class Mine:
    """A model of a user's, which the engine does not know."""

    def __init__(self, model):
        self.propagate, self.transition = model.propagate, model.transition
        self.process_noise = model.process_noise


def test_landmarks_that_were_not_seen_are_missing_one_by_one(rng):
    """In the engine, step by step and as an arc; and in a filter whose model is in Python."""
    orbit = ln.dynamics.ClohessyWiltshire(1e-3, 1e-6)
    start = np.concatenate([STATE.position, STATE.velocity])
    behind = ln.sensors.LandmarkCamera([*MARKS, [0.0, 0.0, 500.0]], 500.0, 1.0)
    z = np.full((6, 10), np.nan)
    place = start
    for k in range(6):
        place = orbit.propagate(place, 1.0)
        z[k] = camera().only([0, 1, 2, 3]).simulate(place, rng, dcm=DOWN).tolist() + [np.nan] * 2
        z[k, 2 * k % 8 : 2 * k % 8 + 2] = np.nan
    z[4] = np.nan
    ends = []
    for model in (orbit, Mine(orbit)):
        ekf = ln.ExtendedKalmanFilter(model, start + 0.1, np.eye(6))
        log = ekf.run(np.arange(1.0, 7.0), [(behind, z)], dcm=DOWN)
        assert log.accepted[:, 0].tolist() == [True] * 4 + [False, True]
        assert (np.isnan(log.innovation) == np.isnan(z)).all()
        ends.append((log.state, log.covariance, log.nis[np.isfinite(log.nis)]))
    for a, b in zip(*ends, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


def test_delayed_wraps_a_sensor():
    late = ln.sensors.Delayed(camera(), 2)
    assert late.latency == 2.0
    assert isinstance(late.sensor, ln.sensors.LandmarkCamera)
    with pytest.raises(AttributeError):
        late.latency = 1.0


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.sensors.LandmarkCamera(MARKS, 0.0, 1.0), "focal_length_px"),
        (lambda: ln.sensors.LandmarkCamera(MARKS, [1.0, 2.0, 3.0], 1.0), "focal_length_px"),
        (lambda: ln.sensors.LandmarkCamera(MARKS, 500.0, [1.0, 1.0]), "sigma_px"),
        (lambda: ln.sensors.LandmarkCamera(MARKS, 500.0, -1.0), "sigma_px"),
        (lambda: ln.sensors.LandmarkCamera(MARKS[0], 500.0, 1.0), "landmarks"),
        (lambda: camera(landmark_sigma=-1.0), "landmark_sigma"),
        (lambda: camera(landmark_sigma=[1.0, 2.0]), "landmark_sigma"),
        (lambda: camera(landmark_sigma=np.stack([np.diag([1.0, -1, 1])] * 4)), "landmark_sigma"),
        (lambda: camera(landmark_sigma=np.nan), "landmark_sigma"),
        (lambda: camera(principal_point=3.0), "principal_point"),
        (lambda: camera(image_size=(0, 5)), "image_size"),
        (lambda: camera(camera_from_body=2 * np.eye(3)), "camera_from_body"),
        (lambda: camera(camera_from_body=np.stack([np.eye(3)] * 2)), "camera_from_body"),
        (lambda: camera(lever_arm=[1.0]), "lever_arm"),
        (lambda: camera(map_errors="none"), "map_errors"),
        (lambda: camera(landmark_sigma=1.0).noise(), "state"),
        (lambda: camera(landmark_sigma=[1.0] * 4).predict(STATE, landmarks=MARKS[:2]), "landmarks"),
        (lambda: camera().predict(STATE.position), "dcm"),
        (lambda: camera().visible(STATE.position), "dcm"),
        (lambda: ln.sensors.Velocimeter(0.0), "sigma"),
        (lambda: ln.sensors.Velocimeter([1.0, 2.0]), "sigma"),
        (lambda: ln.sensors.Velocimeter(1.0, [[1.0, 1.0, 0.0]]), "beams"),
        (lambda: ln.sensors.Velocimeter(1.0, [1.0, 0.0, 0.0]), "beams"),
        (lambda: ln.sensors.Velocimeter(1.0).predict([1.0, 2.0, 3.0], dcm=DOWN), "state"),
        (lambda: ln.sensors.Velocimeter(1.0).predict((STATE.position, np.zeros(3))), "state"),
        (lambda: ln.sensors.Altimeter(-1.0), "sigma"),
        (lambda: ln.sensors.Altimeter([1.0]), "sigma"),
        (lambda: ln.sensors.Altimeter(1.0, [0.0, 0.0, 2.0]), "boresight"),
        (lambda: ln.sensors.Altimeter(1.0, np.eye(3)), "boresight"),
        (lambda: ln.sensors.Altimeter(1.0, [0, 0, -1]).predict(STATE), "state: the beam"),
        (lambda: ln.sensors.Delayed(camera(), -1.0), "latency"),
        (lambda: ln.sensors.Delayed(camera(), np.nan), "latency"),
        (lambda: ln.sensors.Delayed(ln.sensors.Delayed(camera(), 1.0), 1.0), "sensor"),
        (lambda: ln.sensors.Delayed(3.0, 1.0), "sensor"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

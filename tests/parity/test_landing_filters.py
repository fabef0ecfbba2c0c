"""Filters on inertial navigation against their NumPy twin: every kind of state, of map and of update."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import SeedSequence

import losnav as ln
from losnav import landing
from tests.oracle import landing as twin

MU, RUNS, STEP, EPOCHS = 4.46e5, 3, 0.1, 12
SITE = ln.dynamics.Site.on_body(0.04, 0.3, radius=15e3, rotation_rate=3.3e-4)
MOUNTING = ln.attitude.dcm_from_mrp([0.03, -0.02, 0.05])
LEVER = np.array([0.4, -0.2, 0.3])
CENTRE = np.array([500.0, 520.0])
VRW, ARW, WALK_A, WALK_G = 2e-3, 2e-4, 1e-4, 1e-6
# States and covariances in sigmas: some thousand operations each, and the twin's gains come from an inverse.
# That the engine takes gravity of one stage of its integrator from the gradient at another is 1e-14 m/s^2.
SAME_FILTER = 1e-9

GRADE = twin.Grade(VRW, ARW)
KINDS = {
    "9": (twin.Slots(), GRADE),
    "9, noise": (twin.Slots(), replace(GRADE, psd=1.6e-5)),
    "12": (twin.Slots(acceleration=True), replace(GRADE, acceleration=(5e-3, 40.0))),
    "15": (twin.Slots(biases=True), replace(GRADE, accelerometer_walk=WALK_A, gyroscope_walk=WALK_G)),
    "18": (
        twin.Slots(biases=True, acceleration=True),
        replace(GRADE, accelerometer_walk=WALK_A, gyroscope_walk=WALK_G, acceleration=(5e-3, 40.0)),
    ),
}


def gravity(r):
    """Point mass, and its gradient, at the site."""
    turn = SITE.site_from_fixed
    x = (r + SITE.center) @ turn
    d = np.linalg.norm(x, axis=-1)[..., None]
    g = -0.3 * MU * x / d**3
    slope = (
        0.3 * MU * (3 * x[..., :, None] * x[..., None, :] / d[..., None] ** 5 - np.eye(3) / d[..., None] ** 3)
    )
    return g @ turn.T, turn @ slope @ turn.T


WORLD = twin.World(SITE.angular_velocity, SITE.center, gravity)


class Arc:
    """Twelve seconds of a descent, measured three times."""

    def __init__(self):
        field = ln.gravity.PointMass(MU)
        guide = landing.ApolloGuidance([0, 0, 30], [0, 0, -0.1], [0, 0, 0], final_time=200.0)
        flight = landing.simulate_descent(
            SITE, field, [60.0, -40.0, 400.0], [-0.5, 0.7, -3.0], duration=EPOCHS, guidance=guide, step=STEP
        )
        rngs = landing.streams(SeedSequence(3).spawn(RUNS), 0)
        unit = ln.dynamics.Imu(VRW, ARW, WALK_A, WALK_G, accelerometer_bias=1e-3, gyroscope_bias=1e-5)
        samples = landing.measure_inertial(flight, unit, rngs)
        self.controls = np.concatenate([samples.specific_force, samples.angular_rate], axis=-1)
        epochs = flight.every(1.0)
        self.times, self.truth = flight.time[epochs], flight.state[epochs]
        self.marks = landing.ring_landmarks(6, first=30.0)[::4]
        self.camera = self.camera_of("white")
        chosen = landing.choose_landmarks(self.camera, self.truth)
        wrong = np.stack([rng.normal(size=self.marks.shape) for rng in rngs])
        images = landing.measure_images(self.camera, self.truth, chosen, rngs, landmarks=self.marks + wrong)
        self.pixels = images.pixels
        self.velocimeter = ln.sensors.Velocimeter(0.01)
        exact = self.velocimeter.predict(self.truth)
        self.velocity = exact + 0.01 * np.stack([rng.normal(size=exact.shape) for rng in rngs])
        # An image without landmarks, and an epoch without velocity.
        self.pixels[:, 3] = np.nan
        self.velocity[:, 5] = np.nan
        self.start, self.errors = flight.state[0], np.stack([rng.normal(size=9) for rng in rngs])

    def camera_of(self, map_errors):
        """The engine's camera."""
        return ln.sensors.LandmarkCamera(
            self.marks,
            500.0,
            1.3,
            1.0,
            principal_point=CENTRE,
            image_size=2 * CENTRE,
            camera_from_body=MOUNTING,
            lever_arm=LEVER,
            map_errors=map_errors,
        )


@pytest.fixture(scope="module")
def arc():
    return Arc()


def sigmas(slots, grade):
    """Of the first errors."""
    parts = [np.repeat([5.0, 0.2, 0.01], 3)]
    if slots.biases:
        parts.append(np.repeat([1e-3, 1e-5], 3))
    if slots.acceleration:
        parts.append(np.full(3, grade.acceleration[0]))
    return np.concatenate(parts)


def engine(arc, slots, grade, kind=None, **options):
    """The engine's filter, three runs."""
    imu = ln.dynamics.Imu(grade.vrw, grade.arw, grade.accelerometer_walk, grade.gyroscope_walk)
    markov = ln.dynamics.GaussMarkov(*grade.acceleration) if slots.acceleration else None
    field = ln.gravity.PointMass(0.3 * MU)
    model = ln.dynamics.Strapdown(
        SITE, field, imu, biases=slots.biases, acceleration=markov, acceleration_psd=grade.psd
    )
    deviation = sigmas(slots, grade)
    first = arc.start.inject(-arc.errors * deviation[:9])
    return (kind or ln.ExtendedKalmanFilter)(model, first, np.diag(deviation**2), **options)


def run(arc, ekf, camera=None):
    """The engine over the arc."""
    sensors = [(camera or arc.camera, arc.pixels), (arc.velocimeter, arc.velocity)]
    return ekf.run(arc.times, sensors, controls=arc.controls, substeps=10)


def oracle(arc, slots, grade, *, map_errors="white", weight=None, late=0):
    """The twin over the arc: estimates and covariances of the state's own errors."""
    deviation = sigmas(slots, grade)
    x = twin.State(
        arc.start.position - arc.errors[:, :3] * deviation[:3],
        arc.start.velocity - arc.errors[:, 3:6] * deviation[3:6],
        arc.start.dcm.T @ twin.rotation(-arc.errors[:, 6:] * deviation[6:9]),
        *(np.zeros((RUNS, 3)) for _ in range(3)),
    )
    n, model = slots.size, twin.Model(WORLD, grade, slots)
    p = np.broadcast_to(np.diag(deviation**2), (RUNS, n, n))
    camera = twin.Camera(arc.marks, 500.0, 1.3, 1.0, map_errors, CENTRE, MOUNTING, LEVER)
    considered = 0
    if map_errors in ("consider", "estimate"):
        extra = arc.marks.size
        whole = np.zeros((RUNS, n + extra, n + extra))
        whole[:, :n, :n], whole[:, n:, n:] = p, np.eye(extra)
        x, p = replace(x, map=np.broadcast_to(arc.marks, (RUNS, *arc.marks.shape))), whole
        considered = extra if map_errors == "consider" else 0
    states, covariances = [], []
    for k in range(EPOCHS):
        for j in range(10 * k, 10 * k + 10):
            x, p = twin.predict(x, p, (arc.controls[:, j, :3], arc.controls[:, j, 3:]), STEP, model)
        if late:
            x, p = twin.cloned(x, p, slots)
        x, p = taken(arc, k, x, p, (slots, camera, considered, weight, late))
        states.append(x)
        covariances.append(p[:, :n, :n])
    return states, covariances


def taken(arc, k, x, p, setting):
    """The updates of an epoch: camera, then velocimeter; both as one for the predictive filter."""
    slots, camera, considered, weight, late = setting
    image = k - late

    def camera_rows(x):
        return twin.camera_rows(camera, x, arc.pixels[:, image], slots, 0 if late else None)

    def velocity_rows(x):
        return twin.velocimeter_rows(0.01, x, arc.velocity[:, k], slots)

    parts = []
    if image >= 0 and not np.isnan(arc.pixels[:, image]).all():
        parts.append(camera_rows)
    if not np.isnan(arc.velocity[:, k]).any():
        parts.append(velocity_rows)
    if weight is not None and velocity_rows in parts:
        d = twin.model_error(twin.together(*(rows(x) for rows in parts)), 1.0, weight)
        x = twin.pushed(x, d, 1.0)
    for rows in parts:
        x, p, _ = twin.update(x, p, rows(x), slots, considered)
    if late and image >= 0:
        x, p = twin.dropped(x, p, slots, 0)
    return x, p


def agree(log, states, covariances, slots):
    """Everything to a billionth of a sigma."""
    n = slots.size
    for k, (x, p) in enumerate(zip(states, covariances, strict=True)):
        sigma = np.sqrt(np.diagonal(p, axis1=-2, axis2=-1))
        mine = log.state[:, k]
        other = ln.NavState.from_dcm(
            x.r, x.v, np.swapaxes(x.c, -1, -2), accelerometer_bias=x.ba, gyroscope_bias=x.bg, acceleration=x.d
        )
        difference = mine.minus(other, n) / sigma
        assert np.abs(difference).max() < SAME_FILTER, (k, np.abs(difference).max())
        spread = (log.covariance[:, k] - p) / (sigma[..., :, None] * sigma[..., None, :])
        assert np.abs(spread).max() < SAME_FILTER, (k, np.abs(spread).max())


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_kinds_of_state(arc, name, form):
    slots, grade = KINDS[name]
    agree(run(arc, engine(arc, slots, grade, form=form)), *oracle(arc, slots, grade), slots)


@pytest.mark.parametrize("map_errors", ["ignore", "consider", "estimate"])
@pytest.mark.parametrize("name", ["9", "15"])
def test_errors_of_the_map(arc, map_errors, name):
    slots, grade = KINDS[name]
    log = run(arc, engine(arc, slots, grade), arc.camera_of(map_errors))
    agree(log, *oracle(arc, slots, grade, map_errors=map_errors), slots)


@pytest.mark.parametrize("name", ["9", "12"])
@pytest.mark.parametrize("weight", [1e2, 1e4, 1e6])
def test_predictive_filter(arc, name, weight):
    slots, grade = KINDS[name]
    log = run(arc, engine(arc, slots, grade, ln.PredictiveFilter, weight=weight))
    agree(log, *oracle(arc, slots, grade, weight=weight), slots)


@pytest.mark.parametrize("late", [1, 3])
@pytest.mark.parametrize("name", ["9", "15"])
def test_old_images(arc, late, name):
    slots, grade = KINDS[name]
    camera = ln.sensors.Delayed(arc.camera, float(late))
    agree(run(arc, engine(arc, slots, grade), camera), *oracle(arc, slots, grade, late=late), slots)


def test_one_run_is_one_of_many(arc):
    """Through ``predict`` and ``update`` as well as through ``run``."""
    slots, grade = KINDS["15"]
    log = run(arc, engine(arc, slots, grade))
    ekf = engine(arc, slots, grade)
    one = type(ekf)(ekf.state and ekf._dynamics, ekf.state[1], np.diag(sigmas(slots, grade) ** 2))
    for k in range(EPOCHS):
        for j in range(10 * k, 10 * k + 10):
            one.predict(STEP, arc.controls[1, j])
        one.update(arc.camera, arc.pixels[1, k])
        one.update(arc.velocimeter, arc.velocity[1, k])
    difference = one.state.minus(log.state[1, -1], 15) / np.sqrt(np.diagonal(one.covariance))
    assert np.abs(difference).max() < SAME_FILTER

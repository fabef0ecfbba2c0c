"""The engine's filter against the oracle's, over random models, sensors, steps and options."""

from __future__ import annotations

import copy
import pickle
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from tests.oracle import arcs, filter_models, kalman
from tests.oracle.attitude import dcm_from_rotation_vector
from tests.strategies import SEEDS

# A few hundred operations on matrices whose condition the draws keep below 1e5; relative to the standard
# deviations before the update, in which rounding arises.
FILTER = 1e-10
# The two forms of covariance against each other.
FORMS = 1e-9
# Smoother against batch, in standard deviations.
SMOOTHER = 1e-8
MEAN_MOTION = 1.04248275e-3
START = np.array([-510.0, 0, 10, 0, 0, 0])
PRIOR = np.diag([100.0] * 3 + [0.0025] * 3)


# --- twins: a losnav model and the oracle's ---------------------------------------------------------------


class UserDynamics:
    """A user's own model around any of the oracle's: one state at a time, nothing of losnav."""

    def __init__(self, model):
        self.model = model

    def propagate(self, state, dt, control=None):
        return self.model.propagate(state, dt, control)

    def transition(self, state, dt, control=None):
        return self.model.transition(state, dt, control)

    def process_noise(self, state, dt):
        return self.model.process_noise(state, dt)


class UserSensor:
    """A user's own sensor around any of the oracle's."""

    def __init__(self, model):
        self.model = model
        self.residual = model.residual

    def predict(self, state):
        return self.model.predict(state)

    def jacobian(self, state):
        return self.model.jacobian(state)

    def noise(self, state=None):
        return self.model.noise()


def spd(rng, n, scale=1.0):
    a = rng.standard_normal((n, n))
    return scale * (a @ a.T / n + 0.1 * np.eye(n))


class Orbit:
    """Relative motion with a random attitude at every epoch."""

    size = 6

    def __init__(self, rng, sensors, built_in=True):
        psd = 10 ** rng.uniform(-10, -6)
        self.oracle = filter_models.clohessy_wiltshire(MEAN_MOTION, psd)
        self.dynamics = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, psd)
        self.built_in = built_in
        if not built_in:
            self.dynamics = UserDynamics(self.oracle)
        self.rng = rng
        self.state = rng.uniform(-1, 1, 6) * [500, 50, 50, 0.1, 0.1, 0.1] + [600, 60, 60, 0, 0, 0]
        self.covariance = np.diag(np.square([10.0, 10, 10, 0.05, 0.05, 0.05])) @ np.eye(6)
        self.landmarks = rng.uniform(-50, 50, (3, 3))
        self.kinds = sensors
        # No two alike: rejections are counted for each sensor, and equal sensors are one.
        self.sigmas = [1e-3 * (1 + place) for place in range(len(sensors))]
        self.sensors = [self._listed(*each) for each in zip(sensors, self.sigmas, strict=True)]

    def _listed(self, kind, sigma):
        if kind == "range-bearing":
            return ln.sensors.RangeBearing(0.2, sigma)
        return ln.sensors.LineOfSight(self.landmarks, sigma)

    def step(self):
        return self.rng.uniform(5, 120) * (1 if self.rng.random() < 0.8 else -1)

    def control(self):
        return 1e-3 * self.rng.standard_normal(3) if self.rng.random() < 0.5 else None

    def look(self, place):
        """(losnav's sensor, the oracle's, context)."""
        dcm = dcm_from_rotation_vector(self.rng.standard_normal(3))
        if self.kinds[place] == "range-bearing":
            twin = filter_models.RangeBearing(0.2, self.sigmas[place], dcm)
        else:
            twin = filter_models.LineOfSight(self.landmarks, self.sigmas[place], dcm)
        return self.sensors[place], twin, {"dcm": dcm}


class MadeUp:
    """A nonlinear model of any size and measurements of any size."""

    def __init__(self, rng, size, rows):
        self.size, self.rng = size, rng
        q = spd(rng, size, 0.01)
        self.oracle = filter_models.Swirl(
            rng.standard_normal((size, size)) / size, 0.1, rng.standard_normal((size, 3)), q
        )
        self.dynamics = UserDynamics(self.oracle)
        self.state, self.covariance = rng.standard_normal(size), spd(rng, size)
        self.twins = [
            filter_models.Wavy(rng.standard_normal((m, size)), 0.05, spd(rng, m, 0.1)) for m in rows
        ]
        self.sensors = [UserSensor(twin) for twin in self.twins]

    def step(self):
        return self.rng.uniform(-0.3, 0.3)

    def control(self):
        return self.rng.standard_normal(3) if self.rng.random() < 0.5 else None

    def look(self, place):
        return self.sensors[place], self.twins[place], {}


@st.composite
def options(draw, size):
    consider = draw(st.lists(st.integers(0, size - 1), max_size=2, unique=True))
    return {
        "gate": draw(st.sampled_from([None, 0.9, 0.999, 3.0, 20.0])),
        "relock_after": draw(st.sampled_from([None, 1, 2, 3])),
        "iterations": draw(st.integers(1, 4)),
        "underweighting": draw(st.sampled_from([0.0, 0.2, 1.0])),
        "consider": tuple(consider),
    }


@st.composite
def cases(draw):
    rng = np.random.default_rng(draw(SEEDS))
    if draw(st.booleans()):
        kinds = draw(st.lists(st.sampled_from(["range-bearing", "directions"]), min_size=1, max_size=2))
        return Orbit(rng, kinds, built_in=draw(st.booleans()))
    rows = draw(st.lists(st.integers(1, 4), min_size=1, max_size=2))
    return MadeUp(rng, draw(st.integers(2, 9)), rows)


def pair(case, settings_, form="joseph"):
    ours = ln.ExtendedKalmanFilter(case.dynamics, case.state, case.covariance, form=form, **settings_)
    theirs = kalman.ExtendedKalmanFilter(
        case.oracle, case.state, case.covariance, kalman.Options(**settings_)
    )
    return ours, theirs


def assert_same(ours, theirs, before, tolerance=FILTER):
    """In standard deviations before the step."""
    deviation = np.sqrt(np.maximum(np.diag(before), np.diag(theirs.covariance)))
    scale = np.maximum(deviation, np.abs(theirs.state))
    np.testing.assert_allclose((ours.state - theirs.state) / scale, 0, rtol=0, atol=tolerance)
    np.testing.assert_allclose(
        (ours.covariance - theirs.covariance) / np.outer(deviation, deviation), 0, rtol=0, atol=tolerance
    )


def measure(case, twin, state, covariance):
    """A measurement off by a few standard deviations of its innovation, sometimes many: gates have work."""
    rng = case.rng
    h = twin.jacobian(state)
    spread = np.linalg.cholesky(h @ covariance @ h.T + twin.noise() + 1e-30 * np.eye(len(h)))
    z = twin.predict(state) + spread @ rng.standard_normal(len(h)) * rng.choice([0.3, 1.0, 5.0])
    if twin.unit:
        return (z.reshape(-1, 3) / np.linalg.norm(z.reshape(-1, 3), axis=1)[:, np.newaxis]).ravel()
    return z


# --- parity -----------------------------------------------------------------------------------------------


@settings(max_examples=150)
@given(st.data())
def test_filter_is_the_oracles(data):
    """Predict, update, predict, ... with every option, forwards and backwards."""
    case = data.draw(cases())
    form = data.draw(st.sampled_from(["joseph", "ud"]))
    ours, theirs = pair(case, data.draw(options(case.size)), form)
    for _ in range(6):
        dt, control = case.step(), case.control()
        ours.predict(dt, control)
        theirs.predict(dt, control)
        before = theirs.covariance
        assert_same(ours, theirs, before)
        assert ours.time == pytest.approx(theirs.time, abs=1e-9)
        for place in range(len(case.sensors)):
            sensor, twin, context = case.look(place)
            z = measure(case, twin, theirs.state, theirs.covariance)
            if case.rng.random() < 0.1:
                z[:] = np.nan
            step, expected = ours.update(sensor, z, **context), theirs.update(twin, z, place)
            assert bool(step.accepted) == expected.accepted
            np.testing.assert_allclose(step.nis, expected.nis, rtol=1e-8)
            assert_same(ours, theirs, before)


@settings(max_examples=60)
@given(st.data())
def test_step_is_predict_and_update(data):
    case = data.draw(cases())
    chosen = data.draw(options(case.size))
    one, two = (pair(case, chosen)[0] for _ in range(2))
    for _ in range(4):
        dt, control = case.step(), case.control()
        sensor, twin, context = case.look(0)
        z = measure(case, twin, case.state, case.covariance)
        step = one.step(dt, sensor, z, control, **context)
        two.predict(dt, control)
        update = two.update(sensor, z, **context)
        assert (one.state == two.state).all()
        assert (one.covariance == two.covariance).all()
        assert one.time == two.time
        for name in ("innovation", "innovation_covariance", "nis", "accepted", "gain"):
            np.testing.assert_array_equal(getattr(step, name), getattr(update, name))


@settings(max_examples=60)
@given(st.data())
def test_step_says_what_the_update_did(data):
    """Innovation, its covariance, gain: consistent with each other and with the oracle."""
    case = data.draw(cases())
    ours, theirs = pair(case, {})
    sensor, twin, context = case.look(0)
    z = measure(case, twin, case.state, case.covariance)
    step, expected = ours.update(sensor, z, **context), theirs.update(twin, z)
    y = twin.residual(z.copy(), twin.predict(case.state))
    np.testing.assert_allclose(step.innovation, y, rtol=0, atol=1e-12 * max(1, np.abs(z).max()))
    h, r = twin.jacobian(case.state), twin.noise()
    s = h @ case.covariance @ h.T + r
    np.testing.assert_allclose(step.innovation_covariance, s, rtol=0, atol=1e-11 * np.abs(s).max())
    moved = case.state + step.gain @ step.innovation
    scale = np.sqrt(np.diag(case.covariance))
    np.testing.assert_allclose((moved - theirs.state) / scale, 0, rtol=0, atol=1e-9)
    assert expected.accepted


@settings(max_examples=40)
@given(st.data())
def test_forms_agree(data):
    case = data.draw(cases())
    chosen = data.draw(options(case.size))
    one, two = pair(case, chosen)[0], pair(case, chosen, "ud")[0]
    for _ in range(5):
        dt = case.step()
        sensor, twin, context = case.look(0)
        z = measure(case, twin, one.state, one.covariance)
        before = one.covariance
        one.step(dt, sensor, z, **context)
        two.step(dt, sensor, z, **context)
        deviation = np.sqrt(np.maximum(np.diag(before), np.diag(one.covariance)))
        np.testing.assert_allclose((one.state - two.state) / deviation, 0, rtol=0, atol=FORMS)
        np.testing.assert_allclose(
            (one.covariance - two.covariance) / np.outer(deviation, deviation), 0, rtol=0, atol=FORMS
        )


# --- runs -------------------------------------------------------------------------------------------------


def arc(rng, epochs=25, runs=None, gaps=True):
    """Times, attitudes, measurements of two sensors around a true arc, controls."""
    times = np.cumsum(rng.uniform(20, 90, epochs))
    lead = () if runs is None else (runs,)
    dcm = np.array([dcm_from_rotation_vector(0.3 * rng.standard_normal(3)) for _ in range(epochs)])
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9)
    controls = 1e-4 * rng.standard_normal((epochs, 3))
    truth = model.trajectory(
        START + np.sqrt(np.diag(PRIOR)) * rng.standard_normal((*lead, 6)), np.append(0.0, times), controls
    )[..., 1:, :]
    camera, lidar = ln.sensors.RangeBearing(0.2, 6e-4), ln.sensors.Range(0.5)
    first, second = camera.simulate(truth, rng, dcm=dcm), lidar.simulate(truth, rng)
    if gaps:
        first[..., 3:5, :] = np.nan
        second[..., ::2, :] = np.nan
    return model, times, [(camera, first), (lidar, second)], controls, dcm, truth


def made(model, form="joseph", **chosen):
    return ln.ExtendedKalmanFilter(model, START, PRIOR, form=form, **chosen)


CHOICES = [
    {},
    {"gate": 0.99, "relock_after": 2},
    {"iterations": 3, "underweighting": 0.2},
    {"consider": (2,), "gate": 30.0},
]


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("chosen", CHOICES)
def test_run_is_a_loop_of_steps(rng, chosen, form):
    model, times, measurements, controls, dcm, _ = arc(rng)
    whole, loop = made(model, form, **chosen), made(model, form, **chosen)
    log = whole.run(times, measurements, controls, dcm=dcm)
    for k, t in enumerate(times):
        loop.predict(t - loop.time, controls[k])
        for j, (sensor, z) in enumerate(measurements):
            step = loop.update(sensor, z[k], dcm=dcm[k])
            np.testing.assert_allclose(log.nis[k, j], step.nis, rtol=1e-9)
            assert bool(log.accepted[k, j]) == bool(step.accepted)
            np.testing.assert_allclose(log.innovations[j][k], step.innovation, rtol=0, atol=1e-10)
        deviation = np.sqrt(np.diag(loop.covariance))
        np.testing.assert_allclose((log.state[k] - loop.state) / deviation, 0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            (log.covariance[k] - loop.covariance) / np.outer(deviation, deviation), 0, rtol=0, atol=1e-9
        )
    assert (log.time == times).all()
    assert whole.time == times[-1]
    assert (whole.state == log.state[-1]).all()
    # Factors are multiplied out by another instruction set here and there.
    np.testing.assert_allclose(whole.covariance, log.covariance[-1], rtol=1e-9)


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("chosen", CHOICES)
def test_a_batch_is_single_runs(rng, chosen, form):
    """37 runs: not a multiple of any number of lanes."""
    model, times, measurements, controls, dcm, _ = arc(rng, epochs=12, runs=37)
    log = made(model, form, **chosen).run(times, measurements, controls, dcm=dcm)
    assert log.state.shape == (37, 12, 6)
    assert log.covariance.shape == (37, 12, 6, 6)
    assert log.nis.shape == log.accepted.shape == (37, 12, 2)
    for r in range(37):
        one = made(model, form, **chosen).run(
            times, [(sensor, z[r]) for sensor, z in measurements], controls, dcm=dcm
        )
        deviation = np.sqrt(np.einsum("kii->ki", one.covariance))
        np.testing.assert_allclose((log.state[r] - one.state) / deviation, 0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(log.nis[r], one.nis, rtol=1e-8)
        assert (log.accepted[r] == one.accepted).all()
        scale = deviation[:, :, np.newaxis] * deviation[:, np.newaxis, :]
        np.testing.assert_allclose((log.covariance[r] - one.covariance) / scale, 0, rtol=0, atol=1e-9)


def test_arc_is_the_oracles(rng):
    model, times, measurements, controls, dcm, _ = arc(rng)
    log = made(model, gate=0.99).run(times, measurements, controls, dcm=dcm)
    twins = [
        ([filter_models.RangeBearing(0.2, 6e-4, c) for c in dcm], measurements[0][1]),
        (filter_models.Wavy(np.zeros((1, 6)), 0.0, np.eye(1)), np.full((len(times), 1), np.nan)),
    ]
    oracle = kalman.ExtendedKalmanFilter(
        filter_models.clohessy_wiltshire(MEAN_MOTION, 1e-9), START, PRIOR, kalman.Options(gate=0.99)
    )
    only = made(model, gate=0.99).run(times, measurements[:1], controls, dcm=dcm)
    expected = oracle.run(times, twins, controls)
    deviation = np.sqrt(np.einsum("kii->ki", np.array(expected.covariance)))
    np.testing.assert_allclose((only.state - expected.state) / deviation, 0, rtol=0, atol=1e-8)
    assert not np.allclose(only.state, log.state)


def test_a_users_models_run_like_the_built_in(rng):
    model, times, measurements, controls, dcm, _ = arc(rng)

    class Camera:
        """The built-in one, hidden."""

        inner = measurements[0][0]

        def predict(self, state, *, dcm):
            return self.inner.predict(state, dcm=dcm)

        def jacobian(self, state, *, dcm):
            return self.inner.jacobian(state, dcm=dcm)

        def noise(self, state=None, *, dcm=None):
            return self.inner.noise()

        def residual(self, z, predicted):
            return self.inner.residual(z, predicted)

    z = measurements[0][1]
    expected = made(model, gate=0.99).run(times, [(measurements[0][0], z)], controls, dcm=dcm)
    for dynamics, sensor in [
        (UserDynamics(model), measurements[0][0]),
        (model, Camera()),
        (UserDynamics(model), Camera()),
    ]:
        log = made(dynamics, gate=0.99).run(times, [(sensor, z)], controls, dcm=dcm)
        deviation = np.sqrt(np.einsum("kii->ki", expected.covariance))
        np.testing.assert_allclose((log.state - expected.state) / deviation, 0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(log.nis, expected.nis, rtol=1e-7)
        assert (log.accepted == expected.accepted).all()
        smooth, reference = log.smooth(), expected.smooth()
        np.testing.assert_allclose((smooth.state - reference.state) / deviation, 0, rtol=0, atol=1e-7)


# --- smoother ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_smoother_is_the_oracles_and_batch_least_squares(rng, form):
    model, times, measurements, controls, dcm, _ = arc(rng, epochs=40)
    log = made(model, form).run(times, measurements[:1], controls, dcm=dcm)
    smooth = log.smooth()
    twin = filter_models.clohessy_wiltshire(MEAN_MOTION, 1e-9)
    seen = [([filter_models.RangeBearing(0.2, 6e-4, c) for c in dcm], measurements[0][1])]
    expected = kalman.ExtendedKalmanFilter(twin, START, PRIOR).run(times, seen, controls)
    best, covariance = arcs.linear_batch(
        arcs.Arc(twin, (START, PRIOR), times, seen, controls=controls), expected
    )
    deviation = np.sqrt(np.einsum("kii->ki", covariance))
    np.testing.assert_allclose((smooth.state - best) / deviation, 0, rtol=0, atol=SMOOTHER)
    scale = deviation[:, :, np.newaxis] * deviation[:, np.newaxis, :]
    np.testing.assert_allclose((smooth.covariance - covariance) / scale, 0, rtol=0, atol=SMOOTHER)


# --- failures, copies, threads ------------------------------------------------------------------------------


def snapshot(filter_):
    return filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time


BAD_UPDATES = {
    "at the target": lambda f, s: f.update(s, [1.0, 0, 0], dcm=np.eye(3)),
    "wrong shape": lambda f, s: f.update(s, [1.0, 0], dcm=np.eye(3)),
    "infinite": lambda f, s: f.update(s, [np.inf, 0, 0], dcm=np.eye(3)),
    "no attitude": lambda f, s: f.update(s, [1.0, 0, 0]),
    "not a rotation": lambda f, s: f.update(s, [1.0, 0, 0], dcm=2 * np.eye(3)),
    "huge": lambda f, s: f.update(s, [1e308, 0, 0], dcm=np.eye(3)),
    "step to nowhere": lambda f, s: f.step(np.nan, s, [1.0, 0, 0], dcm=np.eye(3)),
    "step, then bad": lambda f, s: f.step(60.0, s, [1.0, 0], dcm=np.eye(3)),
    "time overflows": lambda f, s: f.predict(1e308),
    "control": lambda f, s: f.predict(60.0, [1.0, np.nan, 0.0]),
    "run with a bad row": lambda f, s: f.run(
        [60.0, 120.0], [(s, [[1.0, 0, 0], [np.inf, 0, 0]])], dcm=np.eye(3)
    ),
    "run, times": lambda f, s: f.run([60.0, np.nan], [(s, np.ones((2, 3)))], dcm=np.eye(3)),
}


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize("name", BAD_UPDATES)
def test_a_failed_update_changes_nothing(name, form):
    state = np.zeros(6) if name == "at the target" else START
    filter_ = ln.ExtendedKalmanFilter(
        ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9), state, PRIOR, form=form
    )
    before = snapshot(filter_)
    if name == "huge":
        # Valid numbers, so it may also succeed with a finite answer.
        try:
            BAD_UPDATES[name](filter_, ln.sensors.RangeBearing(0.2, 6e-4))
        except (ln.InvalidInputError, ln.NumericalError):
            assert snapshot(filter_) == before
        assert np.isfinite(filter_.state).all()
        assert np.isfinite(filter_.covariance).all()
        return
    with pytest.raises((ln.InvalidInputError, ln.NumericalError, ln.DegenerateGeometryError)):
        BAD_UPDATES[name](filter_, ln.sensors.RangeBearing(0.2, 6e-4))
    assert snapshot(filter_) == before


@pytest.mark.parametrize("method", ["predict", "jacobian", "noise"])
@pytest.mark.parametrize("defect", ["nan", "shape", "raise"])
def test_a_users_failing_sensor_changes_nothing(method, defect, rng):
    case = MadeUp(rng, 4, [2])
    filter_, _ = pair(case, {})
    sensor = case.sensors[0]
    right = getattr(sensor, method)

    def wrong(state=None):
        value = right(state)
        if defect == "raise":
            raise RuntimeError("a user's own error")
        return value * np.nan if defect == "nan" else value[:1]

    setattr(sensor, method, wrong)
    filter_.predict(0.1)
    before = snapshot(filter_)
    expected = RuntimeError if defect == "raise" else (ln.InvalidInputError, ln.NumericalError)
    with pytest.raises(expected):
        filter_.update(sensor, np.zeros(2))
    assert snapshot(filter_) == before


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda f: pickle.loads(pickle.dumps(f))])
@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_copies_continue_bit_identically(rng, duplicate, form):
    """Rejections counted so far included: the gate turns the first two after the copy away, or not."""
    model, times, measurements, controls, dcm, _ = arc(rng, gaps=False)
    camera, z = measurements[0]
    z = z + 0.05 * (np.arange(len(times)) % 5 > 1)[:, np.newaxis]
    filter_ = made(model, form, gate=0.99, relock_after=2)
    for k in range(9):
        filter_.step(times[k] - filter_.time, camera, z[k], controls[k], dcm=dcm[k])
    other = duplicate(filter_)
    assert snapshot(other) == snapshot(filter_)
    for k in range(9, len(times)):
        one = filter_.step(times[k] - filter_.time, camera, z[k], controls[k], dcm=dcm[k])
        two = other.step(times[k] - other.time, camera, z[k], controls[k], dcm=dcm[k])
        assert bool(one.accepted) == bool(two.accepted)
        assert snapshot(other) == snapshot(filter_)
    assert filter_.state is not other.state


def test_what_a_filter_gives_out_is_its_own(rng):
    """Writing into a result changes no filter, and the arguments were copied."""
    state, covariance = START.copy(), PRIOR.copy()
    filter_ = ln.ExtendedKalmanFilter(ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9), state, covariance)
    state[:], covariance[:] = 0.0, 0.0
    before = snapshot(filter_)
    for array in (filter_.state, filter_.covariance):
        if array.flags.writeable:
            array[...] = 7.0
    assert snapshot(filter_) == before
    assert before[0] == START.tobytes()


def test_threads_share_models_but_not_filters(rng):
    model, times, measurements, controls, dcm, _ = arc(rng)
    expected = made(model, gate=0.99).run(times, measurements, controls, dcm=dcm).state
    found = [None] * 16

    def work(i):
        filter_ = made(model, gate=0.99)
        for _ in range(20):
            found[i] = copy.copy(filter_).run(times, measurements, controls, dcm=dcm).state

    threads = [threading.Thread(target=work, args=(i,)) for i in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all((states == expected).all() for states in found)


def test_threads_on_one_filter_lose_no_step():
    """Each step is whole: the time is the sum of all, the covariance stays one."""
    filter_ = made(ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9))
    sensor, z = ln.sensors.Range(0.5), [510.0]

    def work():
        for _ in range(200):
            filter_.step(1.0, sensor, z)

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert filter_.time == 1600.0
    assert np.linalg.eigvalsh(filter_.covariance).min() > 0

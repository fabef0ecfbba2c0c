"""Observability of every system by the same three calls, and of models that live in Python."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import SUN_MU
from losnav.errors import InvalidInputError
from tests.conftest import SAME_FORMULA
from tests.parity.test_lie import SIGHT, STATE, SUN, published

lie_matrix, degree, analyze = (ln.observability.lie_matrix, ln.observability.degree, ln.observability.analyze)
# What series leave of a singular value that is zero, relative to the largest: condition numbers of the
# systems here are below 1e6.
NOTHING = 1e-10
# The stated accuracy of differences, relative to the largest entry of an order.
DIFFERENCES = {2: 1e-9, 5: 1e-6}


class Orbit:
    """A user's planet: only ``rates``, in plain NumPy."""

    mu = SUN_MU

    def rates(self, state, control=(0.0, 0.0, 0.0)):
        r = state[:3]
        return np.concatenate([state[3:], -SUN_MU * r / np.linalg.norm(r) ** 3 + np.asarray(control)])


class Propagated:
    """The same without ``rates``."""

    mu = SUN_MU

    def propagate(self, state, dt):
        return SUN.propagate(state, dt)

    def transition(self, state, dt):
        return SUN.transition(state, dt)


class Sight:
    """A user's direction to the Sun."""

    def predict(self, state):
        return -state[:3] / np.sqrt(state[:3] @ state[:3])

    def jacobian(self, state):
        return SIGHT.jacobian(state)


class Angles:
    """Azimuth and elevation of the Sun by inverse functions, and a distance by logarithm and exponential."""

    def predict(self, state):
        x, y, z = -state[:3]
        distance = np.exp(0.5 * np.log(x**2 + y**2 + z**2))
        return np.array([np.arctan2(y, x), np.arcsin(z / distance), distance])

    def jacobian(self, state):
        return ln.sensors.RangeBearing(1.0, 1.0).jacobian(state, dcm=np.eye(3))[[1, 2, 0]]


def same(found, expected, tolerance=SAME_FORMULA):
    assert found.shape == expected.shape
    rows = len(expected) // 6
    for k in range(6):
        block = slice(k * rows, (k + 1) * rows)
        error = np.abs(found[block] - expected[block]).max()
        assert error <= tolerance * np.abs(expected[block]).max(), k


@settings(max_examples=20)
@given(st.floats(0.0, 0.9), st.floats(-180.0, 180.0), st.floats(0.5, 3.0))
def test_models_in_python_are_the_built_in_ones(e, f, a):
    state = published(f, e=e, a=a * 1.5e11)
    expected = lie_matrix(SUN, SIGHT, state, 5)
    for dynamics in (SUN, Orbit()):
        for sensor in (SIGHT, Sight()):
            same(lie_matrix(dynamics, sensor, state, 5), expected)
    bearing = ln.sensors.RangeBearing(1.0, 1.0)
    turned = lie_matrix(SUN, bearing, state, 5, dcm=np.eye(3)).reshape(6, 3, 6)[:, [1, 2, 0]].reshape(18, 6)
    same(lie_matrix(Orbit(), Angles(), state, 5), turned, 10 * SAME_FORMULA)
    assert degree(lie_matrix(Orbit(), Sight(), state, 5)) == pytest.approx(degree(expected), abs=SAME_FORMULA)


def test_control_and_batches_reach_models_in_python():
    states = np.array([published(f) for f in (0.0, 90.0, 200.0)])
    push = np.array([1e-3, -2e-3, 5e-4])
    expected = lie_matrix(SUN, [SIGHT, ln.sensors.Range(1.0)], states, 4, control=push)
    found = lie_matrix(Orbit(), [Sight(), ln.sensors.Range(1.0)], states, 4, control=push)
    assert found.shape == (3, 20, 6)
    for k in range(3):
        scale = np.abs(expected[k]).max(axis=1, keepdims=True)
        assert (np.abs(found[k] - expected[k]) <= 10 * SAME_FORMULA * scale).all()


@pytest.mark.parametrize("order", DIFFERENCES)
def test_differences_are_as_good_as_stated(order):
    # Smooth over half a unit of time: far from the Sun.
    for f in (120.0, 180.0, -140.0):
        state = published(f)
        found = lie_matrix(Propagated(), SIGHT, state, order).reshape(-1, 3, 6)
        expected = lie_matrix(SUN, SIGHT, state, order).reshape(-1, 3, 6)
        for k in range(order + 1):
            assert np.abs(found[k] - expected[k]).max() <= DIFFERENCES[order] * np.abs(expected[k]).max()


# --- relative navigation --------------------------------------------------------------------------------


def test_angles_alone_need_a_manoeuvre():
    model = ln.dynamics.ClohessyWiltshire(1.04e-3)
    sensor = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 1e-3)
    state = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
    coasting = analyze(lie_matrix(model, sensor, state, 6, dcm=np.eye(3)), tolerance=NOTHING)
    assert coasting.rank == 5
    # What is lost is the state itself: all distances times the same factor look alike.
    lost = (
        coasting.unobservable[:, 0]
        * np.r_[[np.linalg.norm(state[:3])] * 3, [np.linalg.norm(state[:3]) * 1.04e-3] * 3]
    )
    assert abs(lost @ state) / np.linalg.norm(lost) / np.linalg.norm(state) == pytest.approx(1.0, abs=1e-9)
    pushed = analyze(
        lie_matrix(model, sensor, state, 6, dcm=np.eye(3), control=[0, 1e-3, 1e-3]), tolerance=NOTHING
    )
    assert pushed.rank == 6
    ranged = lie_matrix(model, [sensor, ln.sensors.Range(0.2)], state, 2, dcm=np.eye(3))
    assert analyze(ranged, tolerance=NOTHING).rank == 6


# --- landmarks ------------------------------------------------------------------------------------------


def pose_rank(landmarks, position):
    sensor = ln.sensors.LineOfSight(landmarks, 1e-3)
    return analyze(lie_matrix(None, sensor, (position, [0.1, -0.2, 0.05]), 0), tolerance=1e-9).rank


def test_rank_of_a_pose_from_landmarks():
    ring = 100.0 * np.array([[np.cos(a), np.sin(a), 0.0] for a in (0.3, 2.0, 4.1, 5.2)])
    above = np.array([20.0, -30.0, 400.0])
    assert [pose_rank(ring[:n], above) for n in (1, 2, 3, 4)] == [2, 4, 6, 6]
    assert pose_rank([[0.0, 0, 0], [50.0, 0, 0], [120.0, 0, 0]], above) == 5
    cylinder = np.array([100.0 * np.cos(1.1), 100.0 * np.sin(1.1), 400.0])
    assert pose_rank(ring[:3], cylinder) == 5
    assert pose_rank([*ring[:3], [30.0, -20.0, 40.0]], cylinder) == 6


def test_what_does_not_move_says_nothing_new():
    sensor = ln.sensors.LineOfSight([[0.0, 0, 0], [50.0, 0, 0]], 1e-3)
    matrix = lie_matrix(None, sensor, ([1.0, 2.0, 300.0], [0.1, 0.0, 0.0]), 2)
    assert matrix.shape == (18, 6)
    assert not matrix[6:].any()


# --- landing --------------------------------------------------------------------------------------------

SITE = ln.dynamics.Site.on_body(np.radians(2.0), 0.0, 15116.0, ln.gravity.eros.ROTATION_RATE)
MARKS = np.array([[300.0, -100.0, 10.0], [-150.0, 250.0, -5.0], [500.0, -600.0, 20.0], [100.0, -700.0, 3.0]])
DOWN = np.diag([1.0, -1.0, -1.0])
LANDER = ln.NavState.from_dcm(
    [400.0, -300.0, 2000.0], [-1.0, 0.7, -5.0], ln.attitude.dcm_from_mrp([0.01, -0.02, 0.015]) @ DOWN
)
SAMPLE = (np.array([2e-4, -3e-4, -4.2e-3]), np.array([1e-3, -2e-3, 1.5e-3]))
SPEED = ln.sensors.Velocimeter(0.01)
# Its acceleration forgets itself in no time that matters.
CONSTANT = ln.dynamics.GaussMarkov(1e-3, 1e12)


def lander(biases=False, acceleration=None, gravity=None):
    field = gravity or ln.gravity.eros.five_terms(brillouin_radius=0.0)
    imu = ln.dynamics.Imu.navigation()
    return ln.dynamics.Strapdown(SITE, field, imu, biases=biases, acceleration=acceleration)


def camera(count, marks=MARKS):
    return ln.sensors.LandmarkCamera(marks[:count], 500.0, 1.0)


def landing_rank(model, sensors, order, state=LANDER, sample=SAMPLE):
    return analyze(lie_matrix(model, sensors, state, order, control=sample), tolerance=NOTHING).rank


@pytest.mark.parametrize(
    ("sensors", "ranks"),
    [
        ([camera(3), SPEED], [9, 9]),
        ([camera(3)], [6, 9]),
        ([camera(2), SPEED], [7, 9]),
        ([camera(1), SPEED], [5, 9]),
    ],
    ids=["3 landmarks and speed", "3 landmarks", "2 landmarks and speed", "1 landmark and speed"],
)
def test_ranks_of_a_landing(sensors, ranks):
    assert [landing_rank(lander(), sensors, order) for order in (0, 1)] == ranks


def test_a_velocimeter_alone_does_not_know_the_turn_about_the_spin():
    model = lander(gravity=ln.gravity.PointMass(4.46275472004e5))
    assert landing_rank(model, SPEED, 4) == 8


def test_ranks_with_biases_and_an_unknown_acceleration():
    both = [camera(3), SPEED]
    assert [landing_rank(lander(biases=True), both, order) for order in (0, 1)] == [9, 15]
    assert landing_rank(lander(acceleration=CONSTANT), both, 1) == 12
    everything = lander(biases=True, acceleration=CONSTANT)
    # Body axes at rest in those of the site: the bias turned and the acceleration are one signal.
    resting = (SAMPLE[0], LANDER.dcm @ SITE.angular_velocity)
    assert [landing_rank(everything, both, order, sample=resting) for order in (2, 4)] == [15, 15]
    assert landing_rank(everything, both, 3) == 18


def test_the_danger_cylinder_of_a_landing():
    centre, radius = np.array([50.0, -40.0]), 300.0
    marks = np.array([[*(centre + radius * np.array([np.cos(a), np.sin(a)])), 0.0] for a in (0.4, 2.2, 4.0)])
    marks = np.vstack([marks, [80.0, 60.0, 30.0]])
    place = [*(centre + radius * np.array([np.cos(5.3), np.sin(5.3)])), 1500.0]
    state = ln.NavState(place, LANDER.velocity, LANDER.quaternion)
    assert landing_rank(lander(), [camera(3, marks), SPEED], 0, state) == 8
    assert landing_rank(lander(), [camera(3, marks), SPEED], 1, state) == 9
    assert landing_rank(lander(), [camera(4, marks), SPEED], 0, state) == 9


# --- doors ----------------------------------------------------------------------------------------------


def test_batches_broadcast():
    states = np.array([[published(f) for f in (0.0, 30.0)], [published(f) for f in (60.0, 90.0)]])
    matrix = lie_matrix(SUN, SIGHT, states, 3)
    assert matrix.shape == (2, 2, 12, 6)
    for index in np.ndindex(2, 2):
        np.testing.assert_array_equal(matrix[index], lie_matrix(SUN, SIGHT, states[index], 3))
    many = lie_matrix(SUN, SIGHT, np.tile(states.reshape(4, 6), (60, 1)), 3)
    np.testing.assert_array_equal(many[-4:].reshape(2, 2, 12, 6), matrix)
    landers = ln.NavState(np.tile(LANDER.position, (3, 1)), LANDER.velocity, LANDER.quaternion)
    assert lie_matrix(lander(), SPEED, landers, 1, control=SAMPLE).shape == (3, 6, 9)


def test_units():
    raw = lie_matrix(SUN, SIGHT, STATE, 2, "SI")
    length, time = ln.observability.canonical_units(SUN_MU, ln.constants.AU)
    sizes = np.repeat([length, length / time], 3)
    expected = raw * sizes * np.repeat(time ** np.arange(3.0), 3)[:, np.newaxis]
    for scale in (None, length, (length, time), sizes, (sizes, time)):
        np.testing.assert_allclose(lie_matrix(SUN, SIGHT, STATE, 2, scale), expected, rtol=1e-13)


@pytest.mark.parametrize(
    ("arguments", "told", "message"),
    [
        ((SUN, SIGHT, STATE, 16), {}, "order: expected 0 to 15"),
        ((SUN, SIGHT, STATE, 1.5), {}, "order: expected a whole number"),
        ((SUN, SIGHT, STATE[:5], 1), {}, "state: expected shape"),
        ((SUN, SIGHT, 0 * STATE, 1), {}, "state"),
        ((SUN, [], STATE, 1), {}, "sensor"),
        ((SUN, object(), STATE, 1), {}, "sensor"),
        ((object(), SIGHT, STATE, 1), {}, "dynamics"),
        ((SUN, SIGHT, STATE, 1, "canonical"), {}, "scale"),
        ((SUN, SIGHT, STATE, 1, -1.0), {}, "length"),
        ((SUN, SIGHT, STATE, 1, [1.0, 2.0]), {}, "scale"),
        ((SUN, SIGHT, STATE, 1), {"control": [1.0, 2.0]}, "control"),
        ((SUN, SIGHT, STATE, 1), {"place": [1.0, 2.0]}, "place"),
        ((SUN, ln.sensors.RangeBearing(1.0, 1.0), STATE, 1), {}, "dcm"),
        ((lander(), SPEED, STATE, 1), {}, "state: expected a NavState"),
    ],
)
def test_what_is_wrong_is_named(arguments, told, message):
    with pytest.raises(InvalidInputError, match=message):
        lie_matrix(*arguments, **told)


def test_plain_numbers_only_are_named():
    class Floats(Sight):
        def predict(self, state):
            return np.asarray(state[:3], dtype=float)

    with pytest.raises(InvalidInputError, match=r"sensor.predict.*plain NumPy"):
        lie_matrix(SUN, Floats(), STATE, 1)

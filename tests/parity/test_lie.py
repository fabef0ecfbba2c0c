"""Lie derivatives of the library against nested differences in many digits, and against exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import AU, EARTH_J2, EARTH_MU, EARTH_RADIUS, SUN_MU
from tests.conftest import SAME_FORMULA
from tests.oracle import lie as oracle

lie_matrix, degree, analyze = (ln.observability.lie_matrix, ln.observability.degree, ln.observability.analyze)
TURN = ln.attitude.dcm_from_mrp([0.2, -0.3, 0.1])
SUN = ln.dynamics.TwoBody(SUN_MU)
SIGHT = ln.sensors.SunDirection(5e-5)


def orbit(a, e, f, *, i=0.0, node=0.0, periapsis=0.0, mu=SUN_MU):
    """``[r v]`` of elements: lengths in m, angles in degrees."""
    f, i, node, w = np.radians([f, i, node, periapsis])
    p = a * (1 - e**2)
    plane = np.array([[np.cos(f), np.sin(f), 0.0], [-np.sin(f), e + np.cos(f), 0.0]])
    plane *= np.array([[p / (1 + e * np.cos(f))], [np.sqrt(mu / p)]])

    def about(axis, angle):
        c, s = np.cos(angle), np.sin(angle)
        return np.array(
            {"x": [[1, 0, 0], [0, c, -s], [0, s, c]], "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]]}[axis]
        )

    return (plane @ (about("z", node) @ about("x", i) @ about("z", w)).T).ravel()


def published(f, **changes):
    """The orbit of the analysis: a = 2e8 km, e = 0.25, i = 23 deg."""
    return orbit(**{"a": 2e11, "e": 0.25, "i": 23.0, "node": 1.16, "periapsis": 108.89, **changes}, f=f)


STATE = published(40.0)
EARTH_STATE = np.array([4.1e6, -3.2e6, 4.9e6, 4.9e3, 5.6e3, -0.4e3])
NEAR = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
CASES = {
    "Sun": (SUN, SIGHT, STATE, oracle.two_body(SUN_MU), oracle.direction(np.eye(3)), {}),
    "Sun in body axes": (SUN, SIGHT, STATE, oracle.two_body(SUN_MU), oracle.direction(TURN), {"dcm": TURN}),
    "flattened planet": (
        ln.dynamics.TwoBody(EARTH_MU, j2=EARTH_J2, radius=EARTH_RADIUS),
        ln.sensors.RangeBearing(1.0, 1e-3, target=[1e6, 2e6, -3e5]),
        EARTH_STATE,
        oracle.two_body(EARTH_MU, EARTH_J2, EARTH_RADIUS),
        oracle.range_bearing(TURN, [1e6, 2e6, -3e5]),
        {"dcm": TURN},
    ),
    "Doppler": (
        ln.dynamics.TwoBody(EARTH_MU),
        ln.sensors.RangeRate(1.0, target=[6e6, 2e6, 0.0]),
        EARTH_STATE,
        oracle.two_body(EARTH_MU),
        oracle.range_rate([6e6, 2e6, 0.0]),
        {},
    ),
    "relative": (
        ln.dynamics.ClohessyWiltshire(1.04e-3),
        ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 1e-3),
        NEAR,
        oracle.clohessy_wiltshire(1.04e-3, [1e-4, -2e-4, 3e-4]),
        oracle.direction(TURN),
        {"dcm": TURN, "control": [1e-4, -2e-4, 3e-4]},
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_matrix_is_that_of_many_digits(name):
    dynamics, sensor, state, f, h, told = CASES[name]
    length = np.linalg.norm(state[:3])
    time = length / np.linalg.norm(state[3:])
    matrix = lie_matrix(dynamics, sensor, state, 5, (length, time), **told)
    units = np.repeat([length, length / time], 3)
    reference = oracle.gradients(f, h, state, order=5, units=units, pace=time)
    rows = len(reference) // 6
    for k in range(6):
        block = slice(k * rows, (k + 1) * rows)
        scale = np.abs(reference[block]).max()
        assert np.abs(matrix[block] - reference[block]).max() <= SAME_FORMULA * scale, k


def test_orders_nest_and_the_first_is_the_jacobian():
    matrix = lie_matrix(SUN, SIGHT, STATE, 15, "SI")
    assert matrix.shape == (48, 6)
    np.testing.assert_allclose(matrix[:3], SIGHT.jacobian(STATE), rtol=0, atol=1e-14 / 1.5e11)
    for order in range(15):
        lower = lie_matrix(SUN, SIGHT, STATE, order, "SI")
        np.testing.assert_allclose(lower, matrix[: 3 * (order + 1)], rtol=1e-13, atol=0)


# --- rank -----------------------------------------------------------------------------------------------

CANONICAL = ln.dynamics.TwoBody(1.0)
# Rational in every number, the distance too.
RATIONAL = [Fraction(3, 5), Fraction(0), Fraction(4, 5), Fraction(-1, 2), Fraction(7, 9), Fraction(1, 3)]


@pytest.mark.parametrize(
    "state",
    [
        RATIONAL,
        [Fraction(v) for v in (1, 0, 0, 0, 1, 0)],
        [Fraction(v) for v in (1, 0, 0, 0, Fraction(13, 10), 0)],
    ],
    ids=["general", "circle", "pericentre"],
)
def test_ranks_in_exact_arithmetic(state):
    rows = oracle.exact_gradients(state, Fraction(1), 5)
    matrix = lie_matrix(CANONICAL, SIGHT, [float(v) for v in state], 5)
    np.testing.assert_allclose(
        matrix, np.array(rows, dtype=float), rtol=0, atol=SAME_FORMULA * np.abs(matrix).max()
    )
    for order, rank in enumerate([2, 4, 5, 6, 6, 6]):
        part = 3 * (order + 1)
        assert oracle.exact_rank(rows[:part]) == rank
        assert analyze(matrix[:part]).rank == rank


def test_falling_straight_is_not_observable():
    state = [Fraction(3, 5), Fraction(0), Fraction(4, 5), Fraction(3, 10), Fraction(0), Fraction(2, 5)]
    rows = oracle.exact_gradients(state, Fraction(1), 5)
    result = analyze(lie_matrix(CANONICAL, SIGHT, [float(v) for v in state], 5))
    assert oracle.exact_rank(rows) == 4 == result.rank
    # Neither the distance nor its rate.
    along = np.array([0.6, 0.0, 0.8])
    for part in (np.r_[along, 0, 0, 0], np.r_[0, 0, 0, along]):
        basis = result.unobservable
        np.testing.assert_allclose(basis @ basis.T @ part, part, atol=1e-12)


# --- degree ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("anomaly", "expected"), [(0, 0.00947493), (60, 0.0148070), (120, 0.0762254), (180, 0.396464)]
)
def test_published_degrees(anomaly, expected):
    for f in (anomaly, -anomaly):
        assert degree(lie_matrix(SUN, SIGHT, published(f), 5)) == pytest.approx(expected, abs=1e-6, rel=1e-5)


@given(
    st.floats(0.2, 5.0),
    st.floats(0.0, 0.9),
    st.floats(-180.0, 180.0),
    st.floats(0.1, 10.0),
    st.integers(3, 6),
)
def test_a_larger_orbit_in_a_larger_unit_is_the_same(a, e, f, factor, order):
    small, large = (
        lie_matrix(SUN, SIGHT, published(f, a=k * a * AU, e=e), order, scale=k * AU) for k in (1.0, factor)
    )
    np.testing.assert_allclose(large, small, rtol=0, atol=SAME_FORMULA * np.abs(small).max())
    assert degree(large) == pytest.approx(degree(small), abs=SAME_FORMULA)


@given(st.floats(0.0, 180.0), st.floats(0.0, 360.0), st.floats(0.0, 360.0), st.floats(-180.0, 180.0))
def test_orientation_of_the_orbit_does_not_matter(i, node, periapsis, f):
    turned = lie_matrix(SUN, SIGHT, published(f, i=i, node=node, periapsis=periapsis), 5)
    flat = lie_matrix(SUN, SIGHT, published(f, i=0.0, node=0.0, periapsis=0.0), 5)
    assert degree(turned) == pytest.approx(degree(flat), abs=SAME_FORMULA)


@pytest.mark.parametrize(("order", "crossing"), [(3, 2.44e11), (4, 2.82e11), (5, 3.07e11)])
def test_large_orbits_are_best_seen_at_perihelion(order, crossing):
    def ahead(a):
        near, far = (degree(lie_matrix(SUN, SIGHT, published(f, a=a), order)) for f in (0.0, 180.0))
        return near - far

    assert ahead(crossing - 0.01e11) < 0.0 < ahead(crossing + 0.01e11)


@pytest.mark.parametrize(("order", "threshold"), [(4, 0.549), (5, 0.545)])
def test_eccentric_orbits_dip_at_aphelion(order, threshold):
    def dip(e):
        at, beside = (degree(lie_matrix(SUN, SIGHT, published(f, e=e), order)) for f in (180.0, 179.0))
        return beside - at

    assert dip(threshold - 0.002) < 0.0 < dip(threshold + 0.002)


def test_raw_units_say_nothing():
    assert degree(lie_matrix(SUN, SIGHT, published(0.0), 5, "SI")) < 1e-15

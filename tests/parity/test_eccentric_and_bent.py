"""Relative motion about eccentric orbits and along bent coordinates: closed forms, limits, true orbits."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import losnav as ln
from losnav.constants import EARTH_MU
from tests.oracle.relative import yamanaka_ankersen

PLANET = ln.dynamics.TwoBody(EARTH_MU)
AXIS = 9.0e6
RATE = float(ln.orbits.mean_motion(EARTH_MU, AXIS))
STATE = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
PUSH = np.array([1e-3, -2e-3, 5e-4])
BENT = ln.dynamics.CurvilinearClohessyWiltshire(RATE, AXIS, 1e-9)


def orbit(e, anomaly=0.7, psd=0.0):
    return ln.dynamics.YamanakaAnkersen(EARTH_MU, AXIS, e, anomaly, psd)


def target(e, anomaly):
    """State of the target in its own plane."""
    p = AXIS * (1 - e**2)
    r, v = p / (1 + e * np.cos(anomaly)), np.sqrt(EARTH_MU / p)
    s, c = np.sin(anomaly), np.cos(anomaly)
    return np.array([r * c, r * s, 0.0, -v * s, v * (e + c), 0.0])


def in_units(matrix, left, right):
    return matrix * np.outer([1 / left] * 3 + [1.0] * 3, [right] * 3 + [1.0] * 3)


@pytest.mark.parametrize("e", [0.0, 0.01, 0.2, 0.7, 0.9])
@pytest.mark.parametrize("dt", [1.0, 60.0, -700.0, 8000.0, 40_000.0])
def test_yamanaka_ankersen_closed_form(e, dt):
    got = in_units(orbit(e).transition(STATE, dt), 1000, 1000)
    expected = in_units(yamanaka_ankersen(EARTH_MU, AXIS, e, 0.7, dt), 1000, 1000)
    # The closed form divides by 1 - e^2, and its terms by powers of rho.
    np.testing.assert_allclose(got, expected, rtol=0, atol=2e-12 * np.abs(expected).max() / (1 - e) ** 2)


@pytest.mark.parametrize("dt", [0.1, 60.0, -600.0, 9000.0])
def test_a_circle_is_clohessy_wiltshire(dt):
    circle, linear = orbit(0.0, 2.0, 1e-9), ln.dynamics.ClohessyWiltshire(RATE, 1e-9)
    unit = abs(dt)
    got, expected = (in_units(m.transition(STATE, dt), unit, unit) for m in (circle, linear))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    got, expected = (in_units(m.process_noise(STATE, dt), unit, 1 / unit) for m in (circle, linear))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-11 * np.abs(expected).max())
    got, expected = (m.propagate(0 * STATE, dt, PUSH) for m in (circle, linear))
    np.testing.assert_allclose(got[:3], expected[:3], rtol=0, atol=1e-11 * np.abs(expected[:3]).max())
    np.testing.assert_allclose(got[3:], expected[3:], rtol=0, atol=1e-11 * np.abs(expected[3:]).max())


@pytest.mark.parametrize("e", [0.05, 0.2, 0.6])
def test_eccentric_against_true_orbits(e):
    """Finite differences of the nonlinear flow of two orbits."""
    base = target(e, 0.7)
    dt, step = 3000.0, np.array([10.0] * 3 + [1e-2] * 3)

    def flow(relative):
        moved = PLANET.propagate(np.stack([ln.orbits.chaser_state(relative, base), base]), dt)
        return ln.orbits.relative_state(moved[0], moved[1])

    numeric = np.column_stack([(flow(s) - flow(-s)) / 2 for s in np.diag(step)]) / step
    got = in_units(orbit(e).transition(STATE, dt), dt, dt)
    expected = in_units(numeric, dt, dt)
    # Rounding of positions of 1e7 m, over 10 m.
    np.testing.assert_allclose(got, expected, rtol=0, atol=6e-9 * np.abs(expected).max())


def test_eccentric_response_and_noise():
    """Against the differential equation, dX/dt = A X with A read off the transition itself."""
    e, dt = 0.3, 1500.0
    model = orbit(e, 0.7, 1e-9)
    h = 1e-2

    def slope(t):
        ahead, behind = (model.transition(STATE, s, time=t) for s in (h, -h))
        return (ahead - behind) / (2 * h)

    g = np.vstack([np.zeros((3, 3)), np.eye(3)])

    def rates(t, y):
        q, b, a = y[:36].reshape(6, 6), y[36:].reshape(6, 3), slope(t)
        return np.concatenate([(a @ q + q @ a.T + g @ g.T).ravel(), (a @ b + g).ravel()])

    end = solve_ivp(rates, (0, dt), np.zeros(54), method="DOP853", rtol=1e-10, atol=1e-8).y[:, -1]
    q, b = end[:36].reshape(6, 6), end[36:].reshape(6, 3)
    scale = np.sqrt(np.diag(q))
    got = model.process_noise(STATE, dt) / 1e-9
    np.testing.assert_allclose(got / np.outer(scale, scale), q / np.outer(scale, scale), rtol=0, atol=1e-6)
    response = np.column_stack([model.propagate(0 * STATE, dt, u) for u in np.eye(3)])
    np.testing.assert_allclose(response, b, rtol=0, atol=1e-6 * np.abs(b).max())


def test_time_is_told():
    model = orbit(0.2)
    times = np.array([500.0, 800.0, 1400.0])
    path = model.trajectory(STATE, times, PUSH)
    one = model.propagate(STATE, 300.0, PUSH, time=500.0)
    np.testing.assert_allclose(path[1], one, rtol=1e-14)
    np.testing.assert_allclose(path[2], model.propagate(one, 600.0, PUSH, time=800.0), rtol=1e-13)
    period = 2 * np.pi / RATE
    np.testing.assert_allclose(model.propagate(STATE, 300.0, PUSH, time=500.0 + 10 * period), one, rtol=1e-9)
    both = model.propagate(STATE, 300.0, PUSH, time=[500.0, 0.0])
    assert (both[0] == one).all()
    assert np.abs(both[1] - one).max() > 1e-2


@pytest.mark.parametrize(("along", "bound"), [(1e4, 2.0), (160e3, 60.0), (1e6, 400.0)])
def test_bent_coordinates_reach_far(along, bound):
    """Half an orbit beside two true circular-ish orbits: errors of kilometres become metres."""
    origin = target(0.0, 0.0)
    start = ln.orbits.lvlh_from_curvilinear([-along, 200.0, 300.0, 0.4, 0.1, 0.05], AXIS)
    dt = np.pi / RATE
    moved = PLANET.propagate(np.stack([ln.orbits.chaser_state(start, origin), origin]), dt)
    truth = ln.orbits.relative_state(moved[0], moved[1])
    straight = ln.dynamics.ClohessyWiltshire(RATE).propagate(start, dt)
    bent = BENT.propagate(start, dt)
    far, near = (np.linalg.norm((x - truth)[:3]) for x in (straight, bent))
    assert near < bound
    assert far > 20 * near


def test_bent_coordinates_are_those_of_orbits(rng):
    """A step is: over, the linear model, and back."""
    linear = ln.dynamics.ClohessyWiltshire(RATE)
    states = rng.normal(size=(50, 6)) * ([3e5, 3e4, 3e4] + [30.0] * 3)
    curved = linear.propagate(ln.orbits.curvilinear_from_lvlh(states, AXIS), 900.0, PUSH)
    expected = ln.orbits.lvlh_from_curvilinear(curved, AXIS)
    got = BENT.propagate(states, 900.0, PUSH)
    np.testing.assert_allclose(got, expected, rtol=1e-11, atol=1e-8)


def test_bent_noise_is_the_linear_one_carried_over():
    near = in_units(BENT.process_noise(1e-3 * STATE, 60.0), 60.0, 1 / 60.0)
    linear = ln.dynamics.ClohessyWiltshire(RATE, 1e-9).process_noise(STATE, 60.0)
    expected = in_units(linear, 60.0, 1 / 60.0)
    np.testing.assert_allclose(near, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    # Far along the track it is turned with the horizon, not changed.
    far = BENT.process_noise(ln.orbits.lvlh_from_curvilinear([-9e5, 0, 0, 0, 0, 0], AXIS), 60.0)
    angle = 0.1
    turn = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    np.testing.assert_allclose(far[:3, :3], turn.T @ linear[:3, :3] @ turn, rtol=0, atol=1e-3 * far[0, 0])


def test_models_are_values():
    for model in (orbit(0.2, psd=1e-9), BENT):
        assert pickle.loads(pickle.dumps(model)) == model
        assert hash(model) == hash(pickle.loads(pickle.dumps(model)))


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.dynamics.YamanakaAnkersen(0.0, AXIS, 0.1), "mu"),
        (lambda: ln.dynamics.YamanakaAnkersen(EARTH_MU, -AXIS, 0.1), "semi_major_axis"),
        (lambda: orbit(-0.1), "eccentricity"),
        (lambda: orbit(1.0), "eccentricity"),
        (lambda: orbit(0.1, np.nan), "true_anomaly"),
        (lambda: orbit(0.1, [0.0, 1.0]), "true_anomaly"),
        (lambda: ln.dynamics.CurvilinearClohessyWiltshire(1e-3, 0.0), "radius"),
        (lambda: ln.dynamics.CurvilinearClohessyWiltshire(-1e-3, AXIS), "mean_motion"),
        (lambda: BENT.propagate(STATE[:3], 1.0), "state"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

"""Orbits against SciPy's integrator of equations written a second time, and what orbits are known to do."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import AU, EARTH_J2, EARTH_MU, EARTH_RADIUS, SUN_MU
from tests.oracle import orbits as oracle

POINT = ln.dynamics.TwoBody(EARTH_MU, 1e-9)
EARTH = ln.dynamics.TwoBody(EARTH_MU, 1e-9, j2=EARTH_J2, radius=EARTH_RADIUS)
FIELD = {"mu": EARTH_MU, "j2": EARTH_J2, "radius": EARTH_RADIUS}
PUSH = np.array([1e-3, -2e-3, 5e-4])
LOW = np.array([4.1e6, -3.2e6, 4.9e6, 4.9e3, 5.6e3, -0.4e3])


def relative(got, expected):
    """Largest error of position and of velocity beside their sizes."""
    error, size = (np.linalg.norm(a.reshape(-1, 2, 3), axis=-1) for a in (got - expected, expected))
    return (error / size).max()


def in_units(phi, dt):
    unit = np.array([abs(dt)] * 3 + [1.0] * 3)
    return phi * np.outer(1 / unit, unit)


def any_orbit(rng):
    """A state about the Earth, its speed between a third of the circular one and a fast flyby."""
    r, v = rng.normal(size=(2, 3))
    r *= 10 ** rng.uniform(6.8, 8) / np.linalg.norm(r)
    v *= rng.uniform(0.4, 2.5) * np.sqrt(EARTH_MU / np.linalg.norm(r)) / np.linalg.norm(v)
    pace = np.sqrt(np.linalg.norm(r) ** 3 / EARTH_MU)
    return np.concatenate([r, v]), pace * rng.uniform(-3, 3)


def nearest_approach(state):
    r, v = state[:3], state[3:]
    momentum = np.cross(r, v)
    lrl = np.cross(v, momentum) / EARTH_MU - r / np.linalg.norm(r)
    return momentum @ momentum / EARTH_MU / (1 + np.linalg.norm(lrl))


def clear_orbit(rng):
    """One that does not dive to the centre, where an integrator's error is magnified."""
    while True:
        state, dt = any_orbit(rng)
        if nearest_approach(state) > 0.2 * np.linalg.norm(state[:3]):
            return state, dt


def test_constants_are_those_of_the_conventions():
    assert (EARTH_MU, EARTH_J2, EARTH_RADIUS) == (3.986004418e14, 1.08262668e-3, 6378137.0)
    assert (SUN_MU, AU) == (1.32712440018e20, 149597870700.0)
    # A year, from the constants alone.
    assert abs(2 * np.pi * np.sqrt(AU**3 / SUN_MU) / 86400 - 365.2568983) < 1e-6


@given(st.integers(0, 2**32 - 1))
def test_closed_form_against_scipy(seed):
    state, dt = clear_orbit(np.random.default_rng(seed))
    assert relative(POINT.propagate(state, dt), oracle.propagate(state, dt, mu=EARTH_MU)) < 1e-11


@given(st.integers(0, 2**32 - 1))
def test_closed_form_conserves(seed):
    """Energy, momentum and eccentricity vector, however close to the centre; and back is back."""
    state, dt = any_orbit(np.random.default_rng(seed))

    def constants(x):
        r, v = x[:3], x[3:]
        momentum = np.cross(r, v)
        lrl = np.cross(v, momentum) / EARTH_MU - r / np.linalg.norm(r)
        return np.concatenate([momentum / np.linalg.norm(r0) / np.linalg.norm(v0), lrl])

    r0, v0 = state[:3], state[3:]
    moved = POINT.propagate(state, dt)
    np.testing.assert_allclose(constants(moved), constants(state), rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        moved[3:] @ moved[3:] / 2 - EARTH_MU / np.linalg.norm(moved[:3]),
        v0 @ v0 / 2 - EARTH_MU / np.linalg.norm(r0),
        rtol=0,
        atol=1e-13 * max(moved[3:] @ moved[3:], EARTH_MU / np.linalg.norm(moved[:3])) + 1e-13 * (v0 @ v0),
    )
    phi = POINT.transition(state, dt)
    # Symplectic: Phi' J Phi = J.
    j = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.eye(3), np.zeros((3, 3))]])
    unit = in_units(phi, dt)
    np.testing.assert_allclose(unit.T @ j @ unit, j, rtol=0, atol=1e-13 * np.abs(unit).max() ** 2)


@pytest.mark.parametrize("seed", range(12))
def test_transition_against_variational_equations(seed):
    state, dt = clear_orbit(np.random.default_rng(seed))
    for model, field, control in [
        (POINT, {"mu": EARTH_MU}, np.zeros(3)),
        (EARTH, FIELD, np.zeros(3)),
        (EARTH, FIELD, PUSH),
    ]:
        got, expected = (
            in_units(phi, dt)
            for phi in (
                model.transition(state, dt, control),
                oracle.transition(state, dt, control, **field),
            )
        )
        np.testing.assert_allclose(got, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("dt", [60.0, -600.0, 6000.0, 30_000.0])
@pytest.mark.parametrize("control", [np.zeros(3), PUSH])
def test_flattened_planet_against_scipy(dt, control):
    expected = oracle.propagate(LOW, dt, control, **FIELD)
    assert relative(EARTH.propagate(LOW, dt, control), expected) < 1e-11
    assert relative(POINT.propagate(LOW, dt, PUSH), oracle.propagate(LOW, dt, PUSH, mu=EARTH_MU)) < 1e-11


@pytest.mark.parametrize(("model", "field"), [(POINT, {"mu": EARTH_MU}), (EARTH, FIELD)])
@pytest.mark.parametrize("dt", [0.1, 60.0, -60.0, 3000.0])
def test_process_noise_against_its_differential_equation(model, field, dt):
    q, expected = model.process_noise(LOW, dt), oracle.process_noise(LOW, dt, 1e-9, **field)
    assert (q == q.T).all()
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        q / np.outer(scale, scale), expected / np.outer(scale, scale), rtol=0, atol=1e-11
    )
    assert np.linalg.eigvalsh(q / np.outer(scale, scale)).min() > 0


def test_revolutions_are_left_out():
    """A thousand revolutions and an eighth; and the derivative knows how many there were."""
    a = 7e6
    n = np.sqrt(EARTH_MU / a**3)
    circle = np.array([a, 0, 0, 0, n * a, 0])
    angle = 2 * np.pi * 1000 + np.pi / 4
    moved = POINT.propagate(circle, angle / n)
    expected = [np.cos(angle), np.sin(angle), 0, -np.sin(angle), np.cos(angle), 0]
    # The angle itself holds 2000 pi to 1e-12.
    np.testing.assert_allclose(moved / ([a] * 3 + [n * a] * 3), expected, rtol=0, atol=2e-12)
    phi = POINT.transition(circle, angle / n)
    # Faster by dv: longer by da = 2 dv/n, behind by 3/2 n da t along the way.
    np.testing.assert_allclose(phi[:3, 4] @ [-expected[1], expected[0], 0], -3 * angle / n, rtol=1e-3)


def test_a_day_with_j2():
    """Energy to 2e-12; the node turns at the secular rate and a little faster at the osculating elements."""
    a, inclination = EARTH_RADIUS + 780e3, np.radians(98.5)
    v = np.sqrt(EARTH_MU / a)
    state = np.array([a, 0, 0, 0, v * np.cos(inclination), v * np.sin(inclination)])
    times = np.linspace(0.0, 86400.0, 1441)
    path = EARTH.trajectory(state, times)
    r, z = np.linalg.norm(path[:, :3], axis=1), path[:, 2]
    potential = EARTH_MU / r * (1 - EARTH_J2 * (EARTH_RADIUS / r) ** 2 * (1.5 * (z / r) ** 2 - 0.5))
    energy = (path[:, 3:] ** 2).sum(axis=1) / 2 - potential
    assert np.abs(energy / energy[0] - 1).max() < 2e-12
    normal = np.cross(path[:, :3], path[:, 3:])
    node = np.unwrap(np.arctan2(normal[:, 0], -normal[:, 1]))
    rate = np.degrees(np.polyfit(times / 86400, node, 1)[0])
    secular = -1.5 * EARTH_J2 * (EARTH_RADIUS / a) ** 2 * v / a * np.cos(inclination)
    assert abs(np.degrees(secular) * 86400 - 0.984) < 1e-3
    assert abs(rate - 0.988) < 2e-3
    # In one stride the same as in 1440.
    assert relative(EARTH.propagate(state, 86400.0), path[-1]) < 1e-11


def test_the_pole_is_the_z_axis():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    both = np.kron(np.eye(2), turn)
    about_z = EARTH.propagate(both @ LOW, 600.0)
    np.testing.assert_allclose(about_z, both @ EARTH.propagate(LOW, 600.0), rtol=1e-12)
    over = np.kron(np.eye(2), np.roll(np.eye(3), 1, axis=0))
    moved = EARTH.propagate(over @ LOW, 600.0) - over @ EARTH.propagate(LOW, 600.0)
    assert np.linalg.norm(moved[:3]) > 100


def test_distant_suns():
    """Any size of numbers: an orbit about the Sun over ten years, and one of a grain about a rock."""
    sun, rock = ln.dynamics.TwoBody(SUN_MU), ln.dynamics.TwoBody(1e-3)
    v = np.sqrt(SUN_MU / AU)
    state = np.array([AU, 0, 0, 0, 1.2 * v, 0.1 * v])
    dt = 3.2e8
    assert relative(sun.propagate(state, dt), oracle.propagate(state, dt, mu=SUN_MU)) < 1e-10
    state = np.array([3.0, 0, 0, 0, 0.015, 0.002])
    assert relative(rock.propagate(state, 900.0), oracle.propagate(state, 900.0, mu=1e-3)) < 1e-11


@given(st.integers(0, 2**32 - 1))
def test_broadcasting_is_a_loop(seed):
    rng = np.random.default_rng(seed)
    states = LOW + rng.normal(size=(2, 1, 6)) * 10
    steps = rng.uniform(-900, 900, 3)
    for model, push in [(POINT, np.zeros(3)), (EARTH, rng.normal(size=(3, 3)) * 1e-3)]:
        moved = model.propagate(states, steps, push)
        noise = model.process_noise(states, steps)
        assert moved.shape == (2, 3, 6)
        assert noise.shape == (2, 3, 6, 6)
        for i in range(2):
            for k in range(3):
                u = np.broadcast_to(push, (3, 3))[k]
                assert (moved[i, k] == model.propagate(states[i, 0], steps[k], u)).all()
                assert (noise[i, k] == model.process_noise(states[i, 0], steps[k])).all()


def test_models_are_values():
    assert pickle.loads(pickle.dumps(EARTH)) == EARTH
    assert hash(EARTH) == hash(ln.dynamics.TwoBody(EARTH_MU, 1e-9, EARTH_J2, EARTH_RADIUS))
    assert POINT.j2 is None


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.dynamics.TwoBody(0.0), "mu"),
        (lambda: ln.dynamics.TwoBody(np.nan), "mu"),
        (lambda: ln.dynamics.TwoBody(EARTH_MU, -1.0), "acceleration_psd"),
        (lambda: ln.dynamics.TwoBody(EARTH_MU, j2=1e-3), "radius"),
        (lambda: ln.dynamics.TwoBody(EARTH_MU, radius=6e6), "j2"),
        (lambda: ln.dynamics.TwoBody(EARTH_MU, j2=1e-3, radius=-1.0), "radius"),
        (lambda: POINT.propagate(np.zeros(6), 60.0), "state, dt or control"),
        (lambda: EARTH.propagate([1.0, 0, 0, 0, 0, 0], 60.0), "state, dt or control"),
        (lambda: EARTH.propagate(LOW, 60.0, time=np.nan), "time"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

"""The difference of two orbits against two orbits, and against the linear model where that holds."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import losnav as ln
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS

FLAT = {"j2": EARTH_J2, "radius": EARTH_RADIUS}
EARTH = ln.dynamics.TwoBody(EARTH_MU, **FLAT)
RADIUS = EARTH_RADIUS + 780e3
RATE = float(ln.orbits.mean_motion(EARTH_MU, RADIUS))
TARGET = np.array([3.1e6, -3.9e6, 5.1e6, 5.4e3, 5.2e3, 0.6e3])
RELATIVE = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
PUSH = np.array([1e-3, -2e-3, 5e-4])
CIRCLE = np.array([RADIUS, 0, 0, 0, 0, RATE * RADIUS])


def chaser_of(relative, planet=EARTH, target=TARGET):
    return ln.orbits.chaser_state(relative, target, planet.acceleration(target[:3]))


def apart(chaser, target, planet=EARTH):
    return ln.orbits.relative_state(chaser, target, planet.acceleration(target[..., :3]))


@pytest.mark.parametrize("planet", [EARTH, ln.dynamics.TwoBody(EARTH_MU)], ids=["J2", "point"])
@pytest.mark.parametrize("size", [1e-3, 1.0, 300.0])
@pytest.mark.parametrize("dt", [60.0, -600.0, 6000.0])
def test_two_orbits(planet, size, dt):
    """Centimetres to 160 km; the comparison itself loses what positions of 7e6 m do not hold."""
    start = size * RELATIVE
    chaser = chaser_of(start, planet)
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, j2=planet.j2, radius=planet.radius)
    expected = apart(planet.propagate(chaser, dt), planet.propagate(TARGET, dt), planet)
    got = model.propagate(start, dt)
    np.testing.assert_allclose(got[:3], expected[:3], rtol=1e-10, atol=2e-5)
    np.testing.assert_allclose(got[3:], expected[3:], rtol=1e-10, atol=2e-8)


def test_control_is_held_in_the_targets_frame():
    chaser = chaser_of(RELATIVE)
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, **FLAT)
    # The same push in many short steps of the chaser's own orbit, turned with the target's frame.
    steps, both = 1200, np.stack([chaser, TARGET])
    for _ in range(steps):
        halfway = EARTH.propagate(both[1], 0.25)
        dcm = ln.orbits.lvlh_from_inertial(halfway[:3], halfway[3:])
        both = EARTH.propagate(both, 0.5, np.stack([dcm.T @ PUSH, np.zeros(3)]))
    expected = apart(*both)
    got = model.propagate(RELATIVE, 0.5 * steps, PUSH)
    # What the model leaves out: the push also moves the chaser's orbit by 400 m, 1e-4 of the path.
    drift = np.linalg.norm(expected[:3] - model.propagate(RELATIVE, 0.5 * steps)[:3])
    assert 300 < drift < 600
    np.testing.assert_allclose(got[:3], expected[:3], rtol=0, atol=3e-4 * drift)
    np.testing.assert_allclose(got[3:], expected[3:], rtol=0, atol=1e-6 * drift)


def test_transition_is_the_derivative():
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser_of(RELATIVE), **FLAT)
    phi = model.transition(RELATIVE, 2000.0, PUSH)
    step = np.diag([1.0] * 3 + [1e-3] * 3)
    up, down = (model.propagate(RELATIVE + s * step, 2000.0, PUSH) for s in (1, -1))
    numeric = ((up - down) / 2).T / np.diag(step)
    unit = np.array([2000.0] * 3 + [1.0] * 3)
    scale = np.outer(1 / unit, unit)
    np.testing.assert_allclose(phi * scale, numeric * scale, rtol=0, atol=1e-9 * np.abs(phi * scale).max())


def test_clohessy_wiltshire_is_the_limit():
    """About a circle and a point mass: the difference shrinks with the separation."""
    unit = np.array([1000.0] * 3 + [1.0] * 3)
    scale = np.outer(1 / unit, unit)
    linear = ln.dynamics.ClohessyWiltshire(RATE, 1e-9)
    errors = []
    for size in (1e-2, 1.0):
        start = size * RELATIVE
        chaser = ln.orbits.chaser_state(start, CIRCLE)
        model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, acceleration_psd=1e-9)
        errors.append(np.abs((model.transition(start, 1e3) - linear.transition(start, 1e3)) * scale).max())
        q, expected = model.process_noise(start, 1e3), linear.process_noise(start, 1e3)
        deviation = np.sqrt(np.diag(expected))
        assert np.abs((q - expected) / np.outer(deviation, deviation)).max() < 2e-3 * size
        moved = model.propagate(start, 1e3, 1e-3 * size * PUSH)
        held = linear.propagate(start, 1e3, 1e-3 * size * PUSH)
        np.testing.assert_allclose(moved, held, rtol=0, atol=1e-3 * size * np.abs(start).max())
    assert errors[0] < 5e-6
    assert 50 < errors[1] / errors[0] < 200


def test_open_loop_over_an_orbit():
    """Clohessy-Wiltshire against the truth with J2: metres after an orbit; this one: nothing."""
    target = EARTH.propagate(CIRCLE, 0.0)
    chaser = chaser_of(RELATIVE, target=target)
    times = np.linspace(0, 6000.0, 101)
    truth = apart(EARTH.trajectory(chaser, times), EARTH.trajectory(target, times))
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, **FLAT)
    assert np.abs(model.trajectory(RELATIVE, times) - truth).max() < 2e-5
    linear = ln.dynamics.ClohessyWiltshire(RATE).trajectory(RELATIVE, times)
    assert 3 < np.linalg.norm((linear - truth)[:, :3], axis=1).max() < 20
    # A fix 15 m and 0.07 m/s off costs centimetres.
    rng = np.random.default_rng(5)
    off = chaser + rng.normal(size=6) * ([15.0] * 3 + [0.067] * 3)
    wrong = ln.dynamics.RelativeTwoBody(EARTH_MU, off, **FLAT).trajectory(RELATIVE, times)
    assert np.linalg.norm((wrong - truth)[:, :3], axis=1).max() < 0.3


def test_the_last_fix_counts():
    chaser = chaser_of(RELATIVE)
    times = np.array([0.0, 100.0, 250.0])
    fixes = EARTH.trajectory(chaser, times)
    one = ln.dynamics.RelativeTwoBody(EARTH_MU, chaser, **FLAT)
    many = ln.dynamics.RelativeTwoBody(EARTH_MU, fixes, times, **FLAT)
    for start in (-50.0, 0.0, 99.0, 100.0, 900.0):
        np.testing.assert_allclose(
            many.propagate(RELATIVE, 60.0, time=start), one.propagate(RELATIVE, 60.0, time=start), rtol=1e-9
        )
    # A fix is looked at from its epoch on, not before.
    shifted = fixes.copy()
    shifted[1] = EARTH.propagate(chaser, 700.0)
    jump = ln.dynamics.RelativeTwoBody(EARTH_MU, shifted, times, **FLAT)
    early, late = (jump.propagate(RELATIVE, 60.0, time=t) for t in (99.9, 100.0))
    np.testing.assert_allclose(early, one.propagate(RELATIVE, 60.0, time=99.9), rtol=1e-12)
    np.testing.assert_allclose(late, one.propagate(RELATIVE, 60.0, time=700.0), rtol=1e-9)
    batch = jump.propagate(RELATIVE, 60.0, time=[99.9, 100.0])
    assert (batch == np.stack([early, late])).all()
    walk = jump.trajectory(RELATIVE, [40.0, 100.0, 160.0])
    np.testing.assert_allclose(
        walk[2], jump.propagate(jump.propagate(RELATIVE, 60.0, time=40.0), 60.0, time=100.0), rtol=1e-14
    )


def test_at_the_target_itself():
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET, acceleration_psd=1e-9, **FLAT)
    assert (np.abs(model.propagate(np.zeros(6), 600.0)) == 0).all()
    assert np.isfinite(model.transition(np.zeros(6), 600.0)).all()
    assert np.isfinite(model.process_noise(np.zeros(6), 600.0)).all()
    assert np.abs(model.propagate(np.zeros(6), 600.0, PUSH)[:3]).max() > 100


def test_models_are_values():
    model = ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET, 5.0, 1e-9, **FLAT)
    again = pickle.loads(pickle.dumps(model))
    assert (again.propagate(RELATIVE, 60.0, time=10.0) == model.propagate(RELATIVE, 60.0, time=10.0)).all()
    assert (model.mu, model.times.tolist(), model.j2) == (EARTH_MU, [5.0], EARTH_J2)
    with pytest.raises(AttributeError):
        model.mu = 1.0
    with pytest.raises(ValueError, match="read-only"):
        model.chaser[0, 0] = 1.0


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.dynamics.RelativeTwoBody(0.0, TARGET), "mu"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET[:3]), "chaser"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, np.zeros((2, 2, 6))), "chaser"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, [TARGET, TARGET]), "times"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, [TARGET, TARGET], [1.0, 1.0]), "times"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, np.zeros((0, 6)), []), "times"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET, acceleration_psd=-1.0), "acceleration_psd"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET, j2=1e-3), "radius"),
        (lambda: ln.dynamics.RelativeTwoBody(EARTH_MU, TARGET).propagate(RELATIVE, 1.0, time=np.inf), "time"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

"""Orbital frames, relative states: derivatives along true orbits, inverses, published approximations."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from tests.oracle.attitude import cross_matrix

EARTH = ln.dynamics.TwoBody(EARTH_MU, j2=EARTH_J2, radius=EARTH_RADIUS)
RADIUS = EARTH_RADIUS + 780e3
RATE = 1.04248275e-3
TARGET = np.array([3.1e6, -3.9e6, 5.1e6, 5.4e3, 5.2e3, 0.6e3])
RELATIVE = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])


def circular(angle, inclination):
    """A circular orbit at argument ``angle`` of latitude."""
    along = np.array(
        [-np.sin(angle), np.cos(angle) * np.cos(inclination), np.cos(angle) * np.sin(inclination)]
    )
    out = np.array([np.cos(angle), np.sin(angle) * np.cos(inclination), np.sin(angle) * np.sin(inclination)])
    return np.concatenate([RADIUS * out, np.sqrt(EARTH_MU / RADIUS) * along])


def test_axes():
    x, y, z = ln.orbits.lvlh_from_inertial(TARGET[:3], TARGET[3:])
    np.testing.assert_allclose(z, -TARGET[:3] / np.linalg.norm(TARGET[:3]), atol=1e-15)
    h = np.cross(TARGET[:3], TARGET[3:])
    np.testing.assert_allclose(y, -h / np.linalg.norm(h), atol=1e-15)
    np.testing.assert_allclose(np.cross(y, z), x, atol=1e-15)
    assert x @ TARGET[3:] > 0.9 * np.linalg.norm(TARGET[3:])


@pytest.mark.parametrize("seed", range(5))
def test_the_rate_is_that_of_the_axes(seed):
    """dC/dt = -[w x] C along an orbit with J2, by central differences."""
    state = EARTH.propagate(TARGET, 1000.0 * seed)
    w = ln.orbits.lvlh_rate(state[:3], state[3:], EARTH.acceleration(state[:3]))
    h = 0.05
    before, after = (ln.orbits.lvlh_from_inertial(x[:3], x[3:]) for x in EARTH.propagate(state, [-h, h]))
    dcm = ln.orbits.lvlh_from_inertial(state[:3], state[3:])
    np.testing.assert_allclose((after - before) / (2 * h), -cross_matrix(w) @ dcm, rtol=0, atol=1e-12)
    # The part J2 adds is there, 1e-3 of the rate at its largest.
    assert 1e-11 < abs(w[2]) < 2e-3 * abs(w[1])
    assert (ln.orbits.lvlh_rate(state[:3], state[3:]) == [0.0, w[1], 0.0]).all()


def test_the_velocity_is_the_derivative_of_the_position():
    """In the rotating frame, along two orbits with J2, by central differences."""
    acceleration = EARTH.acceleration(TARGET[:3])
    chaser = ln.orbits.chaser_state(RELATIVE, TARGET, acceleration)
    h = 0.2
    both = [EARTH.propagate(x, [-h, h]) for x in (chaser, TARGET)]
    positions = ln.orbits.relative_state(*both)[:, :3]
    np.testing.assert_allclose((positions[1] - positions[0]) / (2 * h), RELATIVE[3:], rtol=0, atol=2e-7)
    without = ln.orbits.relative_state(chaser, TARGET) - RELATIVE
    assert 5e-5 < np.linalg.norm(without[3:]) < 1e-3


@given(st.integers(0, 2**32 - 1))
def test_inverses(seed):
    rng = np.random.default_rng(seed)
    relative = rng.normal(size=(3, 6)) * 10 ** rng.uniform(0, 5) * ([1.0] * 3 + [1e-3] * 3)
    chaser = ln.orbits.chaser_state(relative, TARGET)
    # Differences of positions of 7e6 m and velocities of 7e3 m/s.
    np.testing.assert_allclose(ln.orbits.relative_state(chaser, TARGET), relative, rtol=1e-12, atol=1e-8)
    found = ln.orbits.target_state(relative, chaser)
    np.testing.assert_allclose(found, np.broadcast_to(TARGET, (3, 6)), rtol=0, atol=1e-8)
    curved = ln.orbits.curvilinear_from_lvlh(relative, RADIUS)
    back = ln.orbits.lvlh_from_curvilinear(curved, RADIUS)
    size = np.abs(relative).reshape(3, 2, 3).max(axis=-1).repeat(3, axis=-1)
    np.testing.assert_allclose(back / size, relative / size, rtol=0, atol=1e-13)


def test_curvilinear_rates_are_derivatives(rng):
    for _ in range(20):
        state = rng.normal(size=6) * ([4e5] * 3 + [100.0] * 3)
        h = 1.0
        moved = [
            ln.orbits.curvilinear_from_lvlh(np.concatenate([state[:3] + s * state[3:], state[3:]]), RADIUS)
            for s in (-h, h)
        ]
        rate = (moved[1] - moved[0])[:3] / (2 * h)
        np.testing.assert_allclose(
            rate, ln.orbits.curvilinear_from_lvlh(state, RADIUS)[3:], rtol=0, atol=1e-5
        )


def test_curvilinear_agrees_with_the_tangent_nearby():
    small = RELATIVE * 1e-3
    np.testing.assert_allclose(
        ln.orbits.curvilinear_from_lvlh(small, RADIUS), small, rtol=0, atol=1e-7 * 0.52**2
    )


@pytest.mark.parametrize("latitude", [0.0, 1.0, 2.5])
def test_the_frames_of_two_neighbours(latitude):
    """0.080 degrees apart at 10 km; to first order the rotation vector (y/R, -x/R, vy/wR)."""
    target = circular(latitude, np.radians(98.5))

    def exact(relative):
        chaser = ln.orbits.chaser_state(relative, target)
        frames = [ln.orbits.lvlh_from_inertial(x[:3], x[3:]) for x in (chaser, target)]
        return frames[0] @ frames[1].T

    rng = np.random.default_rng(3)
    for _ in range(50):
        direction = rng.normal(size=3)
        far = np.concatenate([1e4 * direction / np.linalg.norm(direction), np.zeros(3)])
        angle = np.linalg.norm(ln.attitude.rotation_error(exact(far), np.eye(3)))
        assert np.degrees(angle) < 0.0802
        near = 4.8e3 * np.concatenate([direction / np.linalg.norm(direction), RATE * rng.normal(size=3) / 3])
        repaired = ln.orbits.target_to_chaser_lvlh(near, RADIUS, RATE)
        np.testing.assert_allclose(repaired @ repaired.T, np.eye(3), rtol=0, atol=1e-14)
        error = np.linalg.norm(ln.attitude.rotation_error(exact(near), repaired))
        assert error < 2e-6
    # On the track itself the first order is nearly all there is.
    along = np.array([-4.8e3, 0, 0, 0, 0, 0])
    error = np.linalg.norm(
        ln.attitude.rotation_error(exact(along), ln.orbits.target_to_chaser_lvlh(along, RADIUS, RATE))
    )
    assert error < 2.5e-8


def test_gravity_of_the_model_is_its_motion():
    h = 0.5
    before, after = EARTH.propagate(TARGET, [-h, h])
    np.testing.assert_allclose(
        (after - before)[3:] / (2 * h), EARTH.acceleration(TARGET[:3]), rtol=0, atol=1e-6
    )
    point = ln.dynamics.TwoBody(EARTH_MU)
    assert 1e-4 < np.linalg.norm(point.acceleration(TARGET[:3]) - EARTH.acceleration(TARGET[:3])) < 2e-2


def test_broadcasting(rng):
    relative = RELATIVE + rng.normal(size=(4, 1, 6))
    target = TARGET + rng.normal(size=(3, 6))
    chaser = ln.orbits.chaser_state(relative, target)
    assert chaser.shape == (4, 3, 6)
    assert ln.orbits.target_state(relative, chaser).shape == (4, 3, 6)
    assert (
        ln.orbits.relative_state(chaser, target)[2, 1] == ln.orbits.relative_state(chaser[2, 1], target[1])
    ).all()
    assert ln.orbits.target_to_chaser_lvlh(relative, RADIUS, [RATE, RATE, RATE]).shape == (4, 3, 3, 3)
    assert ln.orbits.lvlh_rate(target[:, :3], target[:, 3:], np.zeros((4, 1, 3))).shape == (4, 3, 3)
    assert ln.orbits.curvilinear_from_lvlh(relative, [RADIUS, 2 * RADIUS]).shape == (4, 2, 6)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.orbits.lvlh_from_inertial([7e6, 0, 0], [1.0, 0, 0]), "velocity"),
        (lambda: ln.orbits.lvlh_rate([7e6, 0, 0], [1.0, 0, 0]), "velocity"),
        (lambda: ln.orbits.lvlh_from_inertial([7e6, 0], [1.0, 0, 0]), "position"),
        (lambda: ln.orbits.relative_state(TARGET, TARGET[:3]), "target"),
        (lambda: ln.orbits.chaser_state(RELATIVE * np.nan, TARGET), "relative"),
        (lambda: ln.orbits.target_state(RELATIVE * 1e5, TARGET), "relative|velocity"),
        (lambda: ln.orbits.mean_motion(EARTH_MU, -1.0), "semi_major_axis"),
        (lambda: ln.orbits.curvilinear_from_lvlh(RELATIVE, 0.0), "radius"),
        (lambda: ln.orbits.target_to_chaser_lvlh(RELATIVE, RADIUS, 0.0), "mean_motion"),
        (lambda: EARTH.acceleration([0.0, 0, 0]), "position"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^({argument})"):
        call()

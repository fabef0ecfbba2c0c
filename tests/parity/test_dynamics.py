"""Clohessy-Wiltshire against matrix exponentials of its equations, written here a second time."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

import losnav as ln
from tests.conftest import SAME_FORMULA

MEAN_MOTION = 1.04248275e-3
PERIOD = 2 * np.pi / MEAN_MOTION
STATE = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
PUSH = np.array([1e-3, -2e-3, 5e-4])

# Mean motion and time step, by the angle between them: none, tiny, both sides of the series switches, long.
ANGLES = [0.0, 1e-9, 1e-6, 1e-3, 0.0625, 0.49, 0.51, 0.99, 1.01, 3.0, 6.2]
CASES = [(MEAN_MOTION, angle / MEAN_MOTION) for angle in ANGLES] + [(0.0, 60.0), (2e-7, 60.0), (0.3, 2.0)]
CASES += [(w, -t) for w, t in CASES if t]


def rates(w):
    """x' = A x + G u."""
    a = np.zeros((6, 6))
    a[:3, 3:] = np.eye(3)
    a[3, 5] = 2 * w
    a[4, 1] = -(w**2)
    a[5, 2], a[5, 3] = 3 * w**2, -2 * w
    return a, np.vstack([np.zeros((3, 3)), np.eye(3)])


def units(dt):
    """Scale of each component when time is counted in steps: makes entries of one matrix comparable."""
    return np.array([abs(dt) or 1.0] * 3 + [1.0] * 3)


def exponential(w, dt):
    """Phi and the response to a held control, in one exponential."""
    a, g = rates(w)
    d = units(dt)
    block = np.zeros((9, 9))
    block[:6, :6] = a * np.outer(1 / d, d)
    block[:6, 6:] = g / d[:, np.newaxis]
    whole = expm(block * dt)
    return d[:, np.newaxis] * whole[:6, :6] / d, d[:, np.newaxis] * whole[:6, 6:]


def van_loan(w, dt, psd):
    """Q by Van Loan's exponential; backwards it is the noise of the reversed equation."""
    a, g = rates(w)
    d = units(dt)
    a, g = a * np.outer(1 / d, d) * np.sign(dt), g / d[:, np.newaxis]
    block = np.zeros((12, 12))
    block[:6, :6], block[:6, 6:], block[6:, 6:] = -a, g @ g.T, a.T
    whole = expm(block * abs(dt))
    return psd * np.outer(d, d) * (whole[6:, 6:].T @ whole[:6, 6:])


def assert_close(got, expected, left, right):
    """Entries with time counted in steps, relative to the largest."""
    got, expected = (a * np.outer(1 / left, right) for a in (got, expected))
    scale = np.abs(expected).max()
    np.testing.assert_allclose(got, expected, rtol=0, atol=SAME_FORMULA * (scale or 1.0))


@pytest.mark.parametrize(("w", "dt"), CASES)
def test_transition_and_response(w, dt):
    model = ln.dynamics.ClohessyWiltshire(w)
    phi, response = exponential(w, dt)
    d = units(dt)
    assert_close(model.transition(STATE, dt), phi, d, d)
    columns = np.column_stack([model.propagate(np.zeros(6), dt, u) for u in np.eye(3)])
    assert_close(columns, response, d, np.ones(3))
    expected = phi @ STATE + response @ PUSH
    np.testing.assert_allclose(
        model.propagate(STATE, dt, PUSH),
        expected,
        rtol=SAME_FORMULA,
        atol=SAME_FORMULA * np.abs(expected).max(),
    )


@pytest.mark.parametrize(("w", "dt"), [case for case in CASES if case[1]])
def test_process_noise(w, dt):
    q = ln.dynamics.ClohessyWiltshire(w, 1e-9).process_noise(STATE, dt)
    assert_close(q, van_loan(w, dt, 1e-9), units(dt), 1 / units(dt))
    assert (q == q.T).all()
    d = np.sqrt(np.diag(q))
    assert np.linalg.eigvalsh(q / np.outer(d, d)).min() > 0


def test_small_coupling_keeps_its_digits():
    """Of order w^3 dt^6: a closed form loses it entirely. Expected: two terms of its series."""
    dt = 0.1
    q = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1.0).process_noise(STATE, dt)
    angle = MEAN_MOTION * dt
    # x-z: (2 - 2c)(3 theta - 3s) = theta^5/2 - theta^7 (1/24 + 1/40) + ...
    leading = (angle**6 / 12 - angle**8 / 120) / MEAN_MOTION**3
    np.testing.assert_allclose(q[0, 2], leading, rtol=1e-11)
    # vx-vz: 6 s (1 - c) = 3 theta^3 - ...
    np.testing.assert_allclose(q[3, 5], 0.75 * angle**4 / MEAN_MOTION, rtol=angle**2)


def test_the_printed_sign_of_entry_1_6_is_wrong():
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION)
    phi = model.transition(STATE, 600.0)
    assert phi[0, 5] > 0
    np.testing.assert_allclose(
        model.transition(STATE, 250.0) @ model.transition(STATE, 350.0), phi, rtol=1e-12, atol=1e-9
    )


def test_invariants():
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION)
    assert abs(np.linalg.det(model.transition(STATE, 4000.0)) - 1) < 1e-9
    closed = np.array([0.0, 50.0, 100.0, 2 * MEAN_MOTION * 100, 0.0, 0.3])
    np.testing.assert_allclose(model.propagate(closed, PERIOD), closed, atol=1e-9)
    drift = model.propagate(STATE, PERIOD)[0] - STATE[0]
    np.testing.assert_allclose(drift, (6 * MEAN_MOTION * STATE[2] - 3 * STATE[3]) * PERIOD, rtol=1e-12)


@given(st.integers(0, 2**32 - 1))
def test_broadcasting_is_a_loop(seed):
    rng = np.random.default_rng(seed)
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9)
    states, steps, push = rng.normal(size=(3, 1, 6)), rng.uniform(-900, 900, 4), rng.normal(size=(4, 3))
    moved = model.propagate(states, steps, push)
    assert moved.shape == (3, 4, 6)
    assert model.transition(states, steps).shape == (3, 4, 6, 6)
    noise = model.process_noise(states, steps)
    for i in range(3):
        for k in range(4):
            assert (moved[i, k] == model.propagate(states[i, 0], steps[k], push[k])).all()
            assert (noise[i, k] == model.process_noise(states[i, 0], steps[k])).all()


def test_large_batches_in_parallel_are_the_same(rng):
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9)
    states = rng.normal(size=(30_000, 6))
    moved = model.propagate(states, 60.0)
    np.testing.assert_allclose(moved, states @ model.transition(STATE, 60.0).T, rtol=0, atol=1e-10)
    assert (model.transition(states, 60.0) == model.transition(STATE, 60.0)).all()


def test_trajectory_is_propagation_after_propagation(rng):
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION)
    times = np.array([10.0, 70.0, 70.0, 300.0, 150.0])
    push = rng.normal(size=(4, 3)) * 1e-3
    states = model.trajectory(STATE, times, push)
    assert (states[0] == STATE).all()
    for k in range(4):
        step = times[k + 1] - times[k]
        np.testing.assert_allclose(states[k + 1], model.propagate(states[k], step, push[k]), rtol=1e-14)
    held = model.trajectory(np.stack([STATE, 2 * STATE]), times, PUSH)
    assert held.shape == (2, 5, 6)
    np.testing.assert_allclose(held[1, -1], model.propagate(2 * STATE, 140.0, PUSH), rtol=1e-12)
    assert model.trajectory(STATE, [5.0]).shape == (1, 6)


def test_models_are_values():
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9)
    assert pickle.loads(pickle.dumps(model)) == model
    assert model == ln.dynamics.ClohessyWiltshire(mean_motion=MEAN_MOTION, acceleration_psd=1e-9)
    assert hash(model) == hash(ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9))
    with pytest.raises(AttributeError):
        model.mean_motion = 1.0


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda m: ln.dynamics.ClohessyWiltshire(-1e-3), "mean_motion"),
        (lambda m: ln.dynamics.ClohessyWiltshire(np.nan), "mean_motion"),
        (lambda m: ln.dynamics.ClohessyWiltshire([1e-3, 1e-3]), "mean_motion"),
        (lambda m: ln.dynamics.ClohessyWiltshire(1e-3, -1.0), "acceleration_psd"),
        (lambda m: m.propagate(STATE[:5], 1.0), "state"),
        (lambda m: m.propagate([*STATE[:5], np.inf], 1.0), r"state\[5\]"),
        (lambda m: m.propagate(STATE, np.nan), "dt"),
        (lambda m: m.propagate(STATE, 1.0, [1.0, 2.0]), "control"),
        (lambda m: m.propagate(np.zeros((2, 6)), np.zeros(3)), "leading dimensions"),
        (lambda m: m.trajectory(STATE, 5.0), "times"),
        (lambda m: m.trajectory(STATE, []), "times"),
        (lambda m: m.trajectory(STATE, [0.0, 1.0, 2.0], np.zeros((5, 3))), "control"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call(ln.dynamics.ClohessyWiltshire(MEAN_MOTION))

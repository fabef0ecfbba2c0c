"""Orbits among third bodies against SciPy's integrator of equations written a second time."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import AU, SUN_MU
from losnav.ephemeris import PLANET_MU, approximate_planet
from tests.oracle import orbits as oracle

DAY = 86400.0
TIMES = np.arange(-200.0, 1201.0, 5.0) * DAY
NAMES = ("jupiter", "earth", "venus")
PATHS = {
    name: ln.Ephemeris.sampled(lambda t, name=name: approximate_planet(name, t), TIMES) for name in NAMES
}
BODIES = [ln.dynamics.ThirdBody(PLANET_MU[name], PATHS[name]) for name in NAMES]
AMONG = ln.dynamics.TwoBody(SUN_MU, 1e-12, third_bodies=BODIES)
ALONE = ln.dynamics.TwoBody(SUN_MU, 1e-12)
TRUE = [(PLANET_MU[name], lambda t, name=name: approximate_planet(name, t)[:3]) for name in NAMES]
# Two integrators of order 8 at 1e-13 a step, some tens of steps.
SAME_PATH = 1e-11


def relative(got, expected):
    error, size = (np.linalg.norm(a.reshape(-1, 2, 3), axis=-1) for a in (got - expected, expected))
    return (error / size).max()


def any_orbit(rng):
    """A heliocentric state between Mercury and Jupiter, a step of up to half a year, when it starts."""
    r, v = rng.normal(size=(2, 3))
    r *= AU * rng.uniform(0.4, 4) / np.linalg.norm(r)
    across = np.cross(r, v)
    v = np.cross(across, r) / np.linalg.norm(np.cross(across, r)) + 0.3 * rng.normal(size=3)
    v *= np.sqrt(SUN_MU / np.linalg.norm(r)) * rng.uniform(0.8, 1.3) / np.linalg.norm(v)
    return np.concatenate([r, v]), rng.uniform(-150, 150) * DAY, rng.uniform(0, 1000) * DAY


@settings(max_examples=20)  # SciPy takes half a second each
@given(st.integers(0, 2**32 - 1))
def test_propagation_against_scipy(seed):
    state, dt, time = any_orbit(np.random.default_rng(seed))
    push = np.array([1e-6, -2e-6, 5e-7])
    for control in (np.zeros(3), push):
        expected = oracle.propagate_among(state, dt, TRUE, time=time, mu=SUN_MU, control=control)
        assert relative(AMONG.propagate(state, dt, control, time=time), expected) < SAME_PATH


def test_the_transition_is_the_derivative(rng):
    for _ in range(5):
        state, dt, time = any_orbit(rng)
        phi = AMONG.transition(state, dt, time=time)
        unit = np.array([1e5] * 3 + [1e5 / 1e6] * 3)
        for column in range(6):
            step = np.zeros(6)
            step[column] = unit[column]
            ends = [AMONG.propagate(state + s * step, dt, time=time) for s in (1.0, -1.0)]
            slope = (ends[0] - ends[1]) / 2 / unit[column]
            scale = np.abs(phi[:, column])
            size = np.array([scale[:3].max()] * 3 + [scale[3:].max()] * 3)
            assert (np.abs(phi[:, column] - slope) < 1e-6 * size).all()


def test_a_trajectory_is_its_steps():
    times = np.array([0.0, 10.0, 3.0, 40.0]) * DAY
    state = np.array([2e11, 0, 0, 0, 2.4e4, 1e3])
    path = AMONG.trajectory(state, times)
    here = state
    for k in range(3):
        here = AMONG.propagate(here, times[k + 1] - times[k], time=times[k])
        assert (path[k + 1] == here).all()
    both = AMONG.propagate([state, state], 10 * DAY, time=[0.0, 100 * DAY])
    assert (both[0] == path[1]).all()
    assert np.abs(both[1] - both[0])[:3].max() > 1e3


def test_acceleration_is_that_of_the_oracle(rng):
    state, _, time = any_orbit(rng)
    there = [(mu, place(time)) for mu, place in TRUE]
    expected = oracle.pulled(state[:3], there, SUN_MU)
    np.testing.assert_allclose(AMONG.acceleration(state[:3], time=time), expected, rtol=1e-12)
    moved = AMONG.propagate([state, state], [10.0, -10.0], time=time)
    np.testing.assert_allclose((moved[0] - moved[1])[3:] / 20.0, expected, rtol=1e-6)


def test_cancellation_far_away():
    """A step of one second beside a planet 30 AU away: its tide of 1e-13 m/s^2 in digits, not in rounding."""
    place = np.array([30 * AU, 0.0, 0.0])
    still = ln.Ephemeris([0.0, 1e9], [place, place], np.zeros((2, 3)))
    model = ln.dynamics.TwoBody(1.0, third_bodies=[ln.dynamics.ThirdBody(6.8e15, still)])
    r = 1e9 * np.array([0.6, 0.0, 0.8])
    end = model.propagate([*r, 1.0, 0, 0], 1e5)
    tide = 6.8e15 / (30 * AU) ** 3 * (3 * r[0] * np.array([1.0, 0, 0]) - r)
    np.testing.assert_allclose(end[3:] - [1.0, 0, 0], tide * 1e5, rtol=1e-3, atol=1e-20)


def test_the_filter_runs_them_itself(rng):
    """Arcs in the engine are the steps of the same model told through Python, forward and back."""

    class Mine:
        time_varying = True

        def __init__(self):
            self.propagate, self.transition = AMONG.propagate, AMONG.transition
            self.process_noise = AMONG.process_noise

    state = np.array([2e11, 0, 0, 0, 2.4e4, 1e3])
    p = np.diag([1e8**2] * 3 + [10.0**2] * 3)
    sun = ln.sensors.SunDirection(5e-5)
    for span in (2 * DAY, -2 * DAY):
        times = 300 * DAY + np.arange(1, 31) * span
        truth = AMONG.trajectory(state, np.r_[300 * DAY, times])[1:]
        z = sun.simulate(truth, 4)
        logs = []
        for model in (AMONG, Mine()):
            ekf = ln.ExtendedKalmanFilter(model, state * 1.0001, p, time=300 * DAY)
            logs.append(ekf.run(times, [(sun, z)]))
        sigma = np.sqrt(np.diagonal(logs[0].covariance, axis1=1, axis2=2))
        assert (np.abs(logs[0].state - logs[1].state) < 1e-6 * sigma).all()
        back, other = (log.smooth() for log in logs)
        assert (np.abs(back.state - other.state) < 1e-5 * sigma).all()
        ekf = ln.ExtendedKalmanFilter(AMONG, state * 1.0001, p, time=300 * DAY)
        for k in range(5):
            ekf.predict(span)
            ekf.update(sun, z[k])
        assert (ekf.state == logs[0].state[4]).all()


def test_without_bodies_it_is_the_plain_model():
    assert ln.dynamics.TwoBody(SUN_MU, third_bodies=[]) == ln.dynamics.TwoBody(SUN_MU)
    assert not ALONE.time_varying
    assert AMONG.time_varying
    assert len(ln.dynamics.TwoBody(SUN_MU, third_bodies=BODIES[0]).third_bodies) == 1


def test_models_are_values():
    again = pickle.loads(pickle.dumps(AMONG))
    state = np.array([2e11, 0, 0, 0, 2.4e4, 1e3])
    assert (again.propagate(state, DAY, time=5.0) == AMONG.propagate(state, DAY, time=5.0)).all()


STATE = np.array([2e11, 0, 0, 0, 2.4e4, 1e3])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: AMONG.propagate(STATE, DAY, time=TIMES[-1]), "time: expected epochs within the ephemeris"),
        (lambda: AMONG.transition(STATE, -DAY, time=TIMES[0]), "time: expected epochs within"),
        (lambda: AMONG.trajectory(STATE, [0.0, 1e9]), "times: expected epochs within"),
        (lambda: AMONG.acceleration(STATE[:3], time=1e9), "time: expected epochs within"),
        (
            lambda: ln.dynamics.TwoBody(SUN_MU, third_bodies=[PATHS["jupiter"]]),
            r"third_bodies\[0\]: expected",
        ),
        (lambda: ln.dynamics.ThirdBody(-1.0, PATHS["jupiter"]), "mu: expected"),
        (lambda: ln.dynamics.ThirdBody(1.0, [1.0, 2.0]), "ephemeris: expected"),
        (
            lambda: ln.ExtendedKalmanFilter(AMONG, STATE, np.eye(6), time=TIMES[-1]).predict(DAY),
            "dt: expected epochs within",
        ),
        (
            lambda: ln.ExtendedKalmanFilter(AMONG, STATE, np.eye(6)).step(
                1e9, ln.sensors.SunDirection(1e-4), [1.0, 0, 0]
            ),
            "dt: expected epochs within",
        ),
        (
            lambda: ln.ExtendedKalmanFilter(AMONG, STATE, np.eye(6)).run(
                [DAY, 1e9], [(ln.sensors.SunDirection(1e-4), np.zeros((2, 3)))]
            ),
            "times: expected epochs within",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ln.InvalidInputError, match=f"^{message}"):
        call()

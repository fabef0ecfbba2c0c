"""Inertial navigation against the oracle, an inertial frame, conserved energy and Van Loan's integral."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import losnav as ln
from losnav.gravity import eros
from tests.conftest import SAME_FORMULA
from tests.oracle import gravity as oracle_gravity
from tests.oracle import strapdown as oracle

RATE = eros.ROTATION_RATE
SEEDS = st.integers(0, 2**32)
PARTS = ("position", "velocity", "quaternion", "accelerometer_bias", "gyroscope_bias", "acceleration")
WANDER = ln.dynamics.GaussMarkov(4e-3, 300.0)
IMU = ln.dynamics.Imu(1e-4, 3e-6, 1e-6, 1e-8)


def models(rate=RATE, longitude=0.3, **options):
    """The library's and the oracle's, over the tip of Eros."""
    site = ln.dynamics.Site.on_body(np.radians(2.0), longitude, 15116.0, rate)
    field = eros.five_terms(brillouin_radius=0.0)
    model = ln.dynamics.Strapdown(site, field, IMU, **options)
    coefficients = [field.c[n, m] for n, m in ((2, 0), (2, 2), (4, 0), (4, 2), (4, 4))]

    def pull(x):
        return oracle_gravity.five_terms(field.mu, field.radius, coefficients, x)[1]

    twin = oracle.Landing(site.site_from_fixed, site.center, site.angular_velocity, pull)
    return model, twin


def start(rng):
    q = rng.normal(size=4)
    return ln.NavState(
        np.array([400.0, -300.0, 2000.0]) + 100 * rng.normal(size=3),
        np.array([-1.0, 0.7, -5.0]) + rng.normal(size=3),
        q / np.linalg.norm(q),
        1e-3 * rng.normal(size=3),
        1e-4 * rng.normal(size=3),
        acceleration=1e-3 * rng.normal(size=3),
    )


def sample(rng):
    return 5e-3 * rng.normal(size=3), 0.02 * rng.normal(size=3)


def tuple_of(state):
    """As the oracle has it."""
    x, y, z, w = state.quaternion
    return (
        state.position,
        state.velocity,
        np.array([w, x, y, z]),
        state.accelerometer_bias,
        state.gyroscope_bias,
        state.acceleration,
    )


def assert_same(state, twin, position=1e-9, velocity=1e-12, turn=1e-13):
    r, v, (w, x, y, z), *_ = twin
    np.testing.assert_allclose(state.position, r, rtol=0, atol=position)
    np.testing.assert_allclose(state.velocity, v, rtol=0, atol=velocity)
    dcm = ln.attitude.dcm_from_quaternion([x, y, z, w])
    assert np.linalg.norm(ln.attitude.rotation_error(dcm, state.dcm)) < turn


@settings(max_examples=30)
@given(seed=SEEDS, dt=st.sampled_from([0.1, 0.01, -0.1, 1.0]), fast=st.booleans())
def test_step_against_the_oracle(seed, dt, fast):
    rng = np.random.default_rng(seed)
    model, twin = models(RATE * (100 if fast else 1), acceleration=WANDER)
    state, (force, rate) = start(rng), sample(rng)
    end = twin.step(tuple_of(state), dt, force, rate, WANDER.time_constant)
    moved = model.propagate(state, dt, (force, rate))
    # The third stage takes gravity from the gradient of the second: micrometres away, in a second decimetres.
    assert_same(moved, end, velocity=1e-12 if abs(dt) < 1.0 else 1e-8)
    for name, value in zip(PARTS[3:], end[3:], strict=True):
        np.testing.assert_allclose(getattr(moved, name), value, rtol=SAME_FORMULA)


def test_attitude_is_exact_for_a_constant_rate(rng):
    """One step of ten minutes is six thousand of a tenth of a second."""
    model, twin = models()
    state, (force, rate) = start(rng), sample(rng)
    end = twin.step(tuple_of(state), 600.0, force, rate)[2]
    once = model.propagate(state, 600.0, (force, rate))
    often = model.trajectory(state, [0.0, 600.0], (force, rate), longest_step=0.1)[-1]
    w, x, y, z = end
    dcm = ln.attitude.dcm_from_quaternion([x, y, z, w])
    assert np.linalg.norm(ln.attitude.rotation_error(dcm, once.dcm)) < 1e-14
    # Six thousand products, each rounded.
    assert np.linalg.norm(ln.attitude.rotation_error(once.dcm, often.dcm)) < 1e-12


def test_without_acceleration_in_the_state_it_stays(rng):
    model, _ = models()
    state = start(rng)
    moved = model.propagate(state, 10.0, sample(rng))
    np.testing.assert_array_equal(moved.acceleration, state.acceleration)


def test_jacobi_integral_of_free_flight():
    """2000 s past the tip of Eros."""
    model, _ = models()
    state = ln.NavState([400.0, -300.0, 2000.0], [-1.0, 0.7, 0.5], [0.0, 0.0, 0.0, 1.0])
    path = model.trajectory(state, np.linspace(0.0, 2000.0, 201), longest_step=1.0)
    energy = model.jacobi_integral(path)
    assert np.abs(energy - energy[0]).max() < 1e-13 * abs(energy[0])
    # And it is not a quantity that anything would conserve.
    assert np.ptp(np.sum(path.velocity**2, axis=-1)) > 0.1


def inertial_flight(model, state, force, rate, time):
    """The same flight in axes that do not turn: gravity, thrust, and an attitude in inertial space."""
    site = model.site
    spin = np.array([0.0, 0.0, RATE])

    def axes(t):
        c, s = np.cos(RATE * t), np.sin(RATE * t)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def rates(t, x):
        turned = axes(t)
        pull = turned @ model.gravity.acceleration(turned.T @ x[:3])
        q = x[6:10]
        push = oracle.rotation(q / np.linalg.norm(q)) @ force
        turn = 0.5 * oracle.product(q, np.concatenate([[0.0], rate]))
        return np.concatenate([x[3:6], pull + push, turn])

    r = site.to_fixed(state.position)
    v = site.site_from_fixed.T @ state.velocity + np.cross(spin, r)
    fixed_from_site = ln.attitude.quaternion_from_dcm(site.site_from_fixed)
    x, y, z, w = fixed_from_site
    q = oracle.product(np.array([w, x, y, z]), tuple_of(state)[2])
    end = solve_ivp(
        rates, (0.0, time), np.concatenate([r, v, q]), method="DOP853", rtol=1e-13, atol=1e-13, max_step=5.0
    ).y[:, -1]
    turned = axes(time)
    position = site.from_fixed(turned.T @ end[:3])
    velocity = site.site_from_fixed @ (turned.T @ end[3:6] - np.cross(spin, turned.T @ end[:3]))
    dcm = (site.site_from_fixed @ turned.T @ oracle.rotation(end[6:10] / np.linalg.norm(end[6:10]))).T
    return position, velocity, dcm


def test_inertial_frame_cross_check():
    """600 s of thrust and turns at 10 Hz: below a nanometre, which is what the reference can tell."""
    model, _ = models()
    force, rate = np.array([2e-3, -1e-3, 3e-3]), np.array([0.01, -0.006, 0.004])
    state = ln.NavState([400.0, -300.0, 2000.0], [-1.0, 0.7, -5.0], [0.3, -0.2, 0.5, np.sqrt(1 - 0.38)])
    position, velocity, dcm = inertial_flight(model, state, force, rate, 600.0)
    end = model.trajectory(state, [0.0, 600.0], (force, rate), longest_step=0.1)[-1]
    assert np.linalg.norm(end.position - position) < 1e-9
    assert np.linalg.norm(end.velocity - velocity) < 1e-12
    assert np.linalg.norm(ln.attitude.rotation_error(dcm, end.dcm)) < 1e-12


def test_centrifugal_acceleration_is_about_the_centre_of_mass():
    """About the site instead it would be wrong by ``w^2 rho``: 1.66e-3 m/s^2, 37 % of gravity at the tip."""
    model, _ = models(longitude=0.0)
    site = model.site
    still = model.free_acceleration([0.0, 0.0, 30.0], np.zeros(3))
    pull = site.site_from_fixed @ model.gravity.acceleration(site.to_fixed([0.0, 0.0, 30.0]))
    size = np.linalg.norm(still - pull)
    assert size == pytest.approx(RATE**2 * 15116.0, rel=5e-3)
    assert size == pytest.approx(1.66e-3, abs=5e-6)
    assert size / np.linalg.norm(pull) == pytest.approx(0.37, abs=5e-3)


# --- how errors move ------------------------------------------------------------------------------


def columns(n):
    """Of the eighteen errors those a model has."""
    return {
        9: np.arange(9),
        12: np.r_[0:9, 15:18],
        15: np.arange(15),
        18: np.arange(18),
    }[n]


SIZES = {
    9: {"biases": False},
    12: {"biases": False, "acceleration": WANDER},
    15: {},
    18: {"acceleration": WANDER},
}


@pytest.mark.parametrize("n", SIZES)
@settings(max_examples=12)
@given(seed=SEEDS, dt=st.sampled_from([0.1, 0.02, -0.1]))
def test_transition_by_complex_step(n, seed, dt):
    """All columns of the oracle's own step, differentiated.

    What is left is of third order in the step: where a bias moves the position, the thrust of the middle
    stands for that of the first third.
    """
    rng = np.random.default_rng(seed)
    model, twin = models(**SIZES[n])
    state, (force, rate) = start(rng), sample(rng)
    tau = WANDER.time_constant if model.acceleration else np.inf
    x, h = tuple_of(state), 1e-30
    end = twin.step(x, dt, force, rate, tau)
    exact = np.empty((18, 18))
    for k in range(18):
        moved = twin.step(oracle.added(x, 1j * h * np.eye(18)[k]), dt, force, rate, tau)
        exact[:, k] = oracle.difference(moved, end).imag / h
    phi = model.transition(state, dt, (force, rate))
    kept = columns(n)
    assert phi.shape == (n, n)
    left = np.linalg.norm(rate - state.gyroscope_bias) * abs(dt) ** 3 / 6
    np.testing.assert_allclose(phi, exact[np.ix_(kept, kept)], rtol=0, atol=left + 1e-9)
    # What is exact in closed form.
    np.testing.assert_allclose(phi[6:9, 6:9], exact[6:9, 6:9], rtol=0, atol=1e-13)


@pytest.mark.parametrize("n", SIZES)
@settings(max_examples=12)
@given(seed=SEEDS, dt=st.sampled_from([0.1, 1.0]))
def test_process_noise_against_van_loan(n, seed, dt):
    """The integral of ``exp(Fs) G G' exp(F's)`` with the error equation of the middle of the step."""
    rng = np.random.default_rng(seed)
    model, twin = models(acceleration_psd=3e-9, **SIZES[n])
    state, (force, rate) = start(rng), sample(rng)
    tau = WANDER.time_constant if model.acceleration else np.inf
    middle = twin.step(tuple_of(state), dt / 2, force, rate, tau)
    gradient = model.gravity.gradient(model.site.to_fixed(middle[0]))
    f, g = twin.errors(middle, force, rate, gradient, tau), oracle.noise_inputs(middle[2])
    densities = np.repeat(
        [
            IMU.velocity_random_walk**2 + 3e-9,
            IMU.angle_random_walk**2,
            IMU.accelerometer_bias_walk**2,
            IMU.gyroscope_bias_walk**2,
            2 * WANDER.sigma**2 / tau,
        ],
        3,
    )
    kept = columns(n)
    f, g = f[np.ix_(kept, kept)], g[kept]
    loan = expm(np.block([[-f, (g * densities) @ g.T], [np.zeros((n, n)), f.T]]) * dt)
    expected = loan[n:, n:].T @ loan[:n, n:]
    found = model.process_noise(state, dt, (force, rate))
    np.testing.assert_array_equal(found, found.T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # What Q leaves out is of first order in the step over the shortest time there is: 300 s of the
    # acceleration, a turn of the body in a minute.
    np.testing.assert_allclose(found / scale, expected / scale, rtol=0, atol=5e-3 * dt)
    assert np.linalg.eigvalsh(found / np.sqrt(np.outer(np.diag(found), np.diag(found)))).min() > -1e-12


def test_sizes_of_the_error_state():
    for n, options in SIZES.items():
        assert models(**options)[0].state_size == n


# --- batches --------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 3, 17, 600])
def test_batches_are_single_states(rng, count):
    model, _ = models(acceleration=WANDER)
    states = ln.NavState.stack([start(rng) for _ in range(count)])
    force, rate = 5e-3 * rng.normal(size=(count, 3)), 0.02 * rng.normal(size=(count, 3))
    dt = rng.uniform(0.01, 0.2, count)
    moved, phi = model.propagate(states, dt, (force, rate)), model.transition(states, dt, (force, rate))
    q = model.process_noise(states, dt, np.concatenate([force, rate], axis=-1))
    for k in {0, count // 2, count - 1}:
        one = (force[k], rate[k])
        np.testing.assert_allclose(
            moved[k].minus(model.propagate(states[k], dt[k], one), 18), 0.0, atol=1e-12
        )
        np.testing.assert_allclose(phi[k], model.transition(states[k], dt[k], one), atol=1e-14)
        np.testing.assert_allclose(q[k], model.process_noise(states[k], dt[k], one), rtol=1e-12)


def test_trajectory_is_step_after_step(rng):
    model, _ = models(acceleration=WANDER)
    states = ln.NavState.stack([start(rng) for _ in range(5)])
    times = np.array([0.0, 0.1, 0.2, 0.2, 0.5])
    controls = np.concatenate([5e-3 * rng.normal(size=(5, 4, 3)), 0.02 * rng.normal(size=(5, 4, 3))], axis=-1)
    path = model.trajectory(states, times, controls)
    assert path.shape == (5, 5)
    state = states
    for k, dt in enumerate(np.diff(times)):
        state = model.propagate(state, dt, controls[:, k])
        np.testing.assert_allclose(path[:, k + 1].minus(state, 18), 0.0, atol=1e-12)
    # One run, one sample for all steps, and back again.
    single = model.trajectory(states[0], times, controls[0, 0])
    assert single.shape == (5,)
    back = model.trajectory(single[-1], times[::-1], controls[0, 0])[-1]
    np.testing.assert_allclose(back.minus(states[0], 18), 0.0, atol=1e-9)


def test_steps_are_cut_in_equal_parts(rng):
    model, _ = models()
    state, control = start(rng), sample(rng)
    fine = model.trajectory(state, np.linspace(0.0, 1.0, 11), control)[-1]
    cut = model.trajectory(state, [0.0, 1.0], control, longest_step=0.1)[-1]
    np.testing.assert_allclose(fine.minus(cut, 18), 0.0, atol=1e-12)


def test_a_frame_that_does_not_turn_with_uniform_gravity():
    """Half a second of fall in a laboratory."""
    lab = ln.dynamics.Strapdown(
        ln.dynamics.Site.inertial(), ln.gravity.Uniform([0.0, 0.0, -9.81]), ln.dynamics.Imu.mems()
    )
    start_ = ln.NavState([0.0, 0.0, 2.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
    end = lab.propagate(start_, 0.5)
    np.testing.assert_allclose(end.position, [0.5, 0.0, 2.0 - 9.81 / 8], rtol=1e-15)
    held = lab.propagate(start_, 0.5, ([0.0, 0.0, 9.81], [0.0, 0.0, 0.0]))
    np.testing.assert_allclose(held.velocity, [1.0, 0.0, 0.0], atol=1e-15)

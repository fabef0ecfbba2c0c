"""The filter oracle against itself: one answer by several roads."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from tests.conftest import BAND, SAME_FORMULA
from tests.oracle import arcs, bierman, kalman
from tests.oracle.attitude import dcm_from_mrp
from tests.oracle.filter_models import (
    LineOfSight,
    RangeBearing,
    Swirl,
    Wavy,
    clohessy_wiltshire,
    complex_step,
)

MEAN_MOTION = 1.04248275e-3
TRUTH = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
START = np.array([-510.0, 0, 10, 0, 0, 0])
PRIOR = np.diag([100.0] * 3 + [0.0025] * 3)
CAMERA = RangeBearing(0.2, 6e-4, dcm_from_mrp(np.array([0.1, -0.2, 0.3])))
# A smoother and a batch of some hundred unknowns, each a chain of ill-conditioned solves; in sigmas.
SMOOTHER = 1e-8


def spd(rng, n, scale=1.0):
    a = rng.standard_normal((n, n))
    return scale * (a @ a.T / n + 0.1 * np.eye(n))


def swirl(rng, n, m=2):
    return Swirl(rng.standard_normal((n, n)) / n, 0.1, rng.standard_normal((n, m)), spd(rng, n, 0.01))


def wavy(rng, n, m, c=0.05):
    return Wavy(rng.standard_normal((m, n)), c, spd(rng, m, 0.1))


def simulated(model, sensor, times, rng, start=TRUTH):
    """True states and measurements of one arc."""
    x, at, states, seen = start, 0.0, [], []
    root = np.linalg.cholesky(sensor.noise())
    for t in times:
        noise = np.linalg.cholesky(model.process_noise(x, t - at))
        x = model.propagate(x, t - at) + noise @ rng.standard_normal(len(x))
        at = t
        states.append(x)
        seen.append(sensor.predict(x) + root @ rng.standard_normal(len(root)))
    return np.array(states), np.array(seen)


def in_sigmas(difference, covariances):
    return np.abs(difference / np.sqrt(np.einsum("kii->ki", covariances))).max()


# --- models ---------------------------------------------------------------------------------------------


def test_jacobian_of_range_and_angles_is_the_printed_one():
    """Equation (8): d rho/dL = L/rho, d alpha/dL = (-L2, L1, 0)/d2, d beta/dL = (-L1 L3, -L2 L3, d2)/..."""
    x = np.array([3.0, -4.0, 1.5, 0, 0, 0])
    a, b, c = toward = -CAMERA.dcm @ x[:3]
    rho, flat = np.linalg.norm(toward), a * a + b * b
    by_line = np.array(
        [toward / rho, [-b / flat, a / flat, 0], np.array([-a * c, -b * c, flat]) / (rho**2 * np.sqrt(flat))]
    )
    expected = np.hstack([-by_line @ CAMERA.dcm, np.zeros((3, 3))])
    np.testing.assert_allclose(CAMERA.jacobian(x), expected, rtol=0, atol=SAME_FORMULA)


def test_backward_noise_undoes_nothing_and_is_positive(rng):
    model = clohessy_wiltshire(MEAN_MOTION, 1e-9)
    for dt in (-60.0, 60.0):
        q = model.process_noise(START, dt)
        d = np.sqrt(np.diag(q))
        assert np.linalg.eigvalsh(q / np.outer(d, d)).min() > 0
    there = model.propagate(TRUTH, 60.0)
    np.testing.assert_allclose(model.propagate(there, -60.0), TRUTH, rtol=0, atol=1e-10)


# --- one update -----------------------------------------------------------------------------------------


def test_update_is_the_normal_equations(rng):
    """Information form, no gain in sight."""
    sensor, p, x = wavy(rng, 5, 3), spd(rng, 5), rng.standard_normal(5)
    z = sensor.predict(x) + 0.3 * rng.standard_normal(3)
    done = kalman.update(sensor, x, p, z)
    h, weight = sensor.jacobian(x), np.linalg.inv(sensor.noise())
    information = np.linalg.inv(p) + h.T @ weight @ h
    np.testing.assert_allclose(done.covariance, np.linalg.inv(information), rtol=0, atol=SAME_FORMULA)
    step = np.linalg.solve(information, h.T @ weight @ (z - sensor.predict(x)))
    np.testing.assert_allclose(done.state, x + step, rtol=0, atol=SAME_FORMULA)


def test_rows_one_after_another_are_the_block(rng):
    """At one linearisation, with independent rows: y_k - H_k delta."""
    h, p, r = rng.standard_normal((4, 6)), spd(rng, 6), rng.uniform(0.1, 1, 4)
    y = rng.standard_normal(4)
    k = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(r))
    delta, covariance = np.zeros(6), p
    for i in range(4):
        gain = covariance @ h[i] / (h[i] @ covariance @ h[i] + r[i])
        delta = delta + gain * (y[i] - h[i] @ delta)
        covariance = kalman.joseph(covariance, h[i : i + 1], gain[:, np.newaxis], np.diag(r[i : i + 1]))
    np.testing.assert_allclose(delta, k @ y, rtol=0, atol=SAME_FORMULA)
    np.testing.assert_allclose(covariance, kalman.joseph(p, h, k, np.diag(r)), rtol=0, atol=SAME_FORMULA)


def test_iterated_update_is_the_maximum_a_posteriori(rng):
    """SciPy's minimum of the one-epoch cost, prior 20 times as wide as the angles allow."""
    x = np.array([20.0, 5.0, -3.0, 0.1, 0.0, 0.0])
    p = np.diag([16.0, 16, 16, 0.01, 0.01, 0.01])
    z = CAMERA.predict(x + np.array([4.0, -3, 2, 0.1, 0, 0]))
    done = kalman.update(CAMERA, x, p, z, kalman.Options(iterations=40))
    root, noise = np.linalg.cholesky(p), np.linalg.cholesky(CAMERA.noise())

    def residual(v):
        return np.concatenate(
            [
                np.linalg.solve(root, v - x),
                np.linalg.solve(noise, CAMERA.residual(z, CAMERA.predict(v))),
            ]
        )

    best = least_squares(residual, x, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    assert np.abs((done.state - best) / np.sqrt(np.diag(p))).max() < 1e-7
    single = kalman.update(CAMERA, x, p, z)
    assert np.abs((single.state - best) / np.sqrt(np.diag(p))).max() > 1e-2
    # The covariance is the inverse Hessian of Gauss-Newton there.
    h = CAMERA.jacobian(done.state)
    information = np.linalg.inv(p) + h.T @ np.linalg.inv(CAMERA.noise()) @ h
    np.testing.assert_allclose(done.covariance @ information, np.eye(6), rtol=0, atol=1e-6)


def test_a_direction_counts_two(rng):
    sensor = LineOfSight(10 * rng.standard_normal((4, 3)), 1e-3, dcm_from_mrp(np.array([0.1, 0.2, -0.1])))
    x = np.array([1.0, -2.0, 30.0, 0, 0, 0])
    z = sensor.predict(x + 0.01)
    done = kalman.update(sensor, x, 1e-2 * np.eye(6), z)
    assert done.dof == 8
    # The same with all twelve rows: nothing is lost along the directions but their second order.
    h, r = sensor.jacobian(x), sensor.noise()
    k = 1e-2 * h.T @ np.linalg.inv(1e-2 * h @ h.T + r)
    np.testing.assert_allclose(done.state, x + k @ (z - sensor.predict(x)), rtol=0, atol=1e-12)
    np.testing.assert_allclose(done.covariance, kalman.joseph(1e-2 * np.eye(6), h, k, r), rtol=0, atol=1e-12)
    y = z - sensor.predict(x)
    assert done.nis == pytest.approx(y @ np.linalg.solve(1e-2 * h @ h.T + r, y), rel=1e-4)


def test_underweighting_is_more_noise_and_leaves_the_gate_alone(rng):
    sensor, p, x = wavy(rng, 5, 3), spd(rng, 5), rng.standard_normal(5)
    z = sensor.predict(x) + rng.standard_normal(3)
    done = kalman.update(sensor, x, p, z, kalman.Options(underweighting=0.2))
    h = sensor.jacobian(x)
    louder = Wavy(sensor.h, sensor.c, sensor.r + 0.2 * h @ p @ h.T)
    other = kalman.update(louder, x, p, z)
    np.testing.assert_allclose(done.state, other.state, rtol=0, atol=SAME_FORMULA)
    np.testing.assert_allclose(done.covariance, other.covariance, rtol=0, atol=SAME_FORMULA)
    assert done.nis == kalman.update(sensor, x, p, z).nis > other.nis


def test_angles_wrap():
    camera = RangeBearing(0.2, 1e-3, np.eye(3))
    x = np.array([10.0, 1e-4, 0.0, 0, 0, 0])
    assert camera.predict(x)[1] < -3.14
    z = np.array([10.0, np.pi - 1e-5, 0.0])
    done = kalman.update(camera, x, np.eye(6), z)
    assert np.linalg.norm(done.state - x) < 1e-3


# --- considered components ------------------------------------------------------------------------------


def test_considered_components_keep_their_prior(rng):
    sensor, p, x = wavy(rng, 6, 3), spd(rng, 6), rng.standard_normal(6)
    z = sensor.predict(x) + 0.1
    best = kalman.update(sensor, x, p, z)
    done = kalman.update(sensor, x, p, z, kalman.Options(consider=(1, 4)))
    held, free = [1, 4], [0, 2, 3, 5]
    assert (done.state[held] == x[held]).all()
    np.testing.assert_allclose(done.state[free], best.state[free], rtol=0, atol=SAME_FORMULA)
    expected = best.covariance.copy()
    expected[np.ix_(held, held)] = p[np.ix_(held, held)]
    np.testing.assert_allclose(done.covariance, expected, rtol=0, atol=SAME_FORMULA)


@pytest.mark.parametrize("consider", [(), (4, 5)])
def test_covariance_is_that_of_the_augmented_errors_with_frozen_gains(rng, consider):
    """Every source of error followed by itself through the whole arc, no covariance recursion."""
    model, n = swirl(rng, 6), 6
    prior, x = spd(rng, n), rng.standard_normal(n)
    options = kalman.Options(consider=consider, underweighting=0.1)
    filter_ = kalman.ExtendedKalmanFilter(model, x, prior, options)
    steps = []
    for k in range(15):
        q = model.process_noise(filter_.state, 0.3)
        phi = filter_.predict(0.3)
        sensor = wavy(rng, n, 2 + k % 2)
        done = filter_.update(sensor, sensor.predict(filter_.state) + 0.1)
        # R' is what the gain was computed for, and Joseph's form claims the error for that noise.
        h = done.jacobian
        before = arcs.errors_by_source(
            prior, [*steps, (phi, q, np.zeros((1, n)), np.zeros((n, 1)), np.eye(1))]
        )
        p = h @ before @ h.T
        steps.append((phi, q, h, done.gain, sensor.noise() + 0.1 * p))
    brute = arcs.errors_by_source(prior, steps)
    np.testing.assert_allclose(filter_.covariance, brute, rtol=0, atol=1e-11 * np.abs(brute).max())


# --- gate -----------------------------------------------------------------------------------------------


def test_gate_and_lock_out(rng):
    sensor = Wavy(np.eye(2), 0.0, np.eye(2))
    good, bad = np.zeros(2), np.full(2, 50.0)
    still = Swirl(np.zeros((2, 2)), 0.0, np.zeros((2, 1)), 1e-3 * np.eye(2))

    def accepted(relock, sequence):
        filter_ = kalman.ExtendedKalmanFilter(
            still, good, np.eye(2), kalman.Options(gate=0.999, relock_after=relock)
        )
        return [filter_.update(sensor, z).accepted for z in sequence]

    assert accepted(3, [bad] * 4) == [False, False, False, True]
    assert accepted(None, [bad] * 6) == [False] * 6
    assert accepted(1, [bad, bad]) == [False, True]
    assert accepted(0, [bad]) == [True]
    assert accepted(2, [bad, good, bad, bad, bad]) == [False, True, False, False, True]
    nothing = np.full(2, np.nan)
    assert accepted(2, [bad, nothing, bad, nothing, bad]) == [False, False, False, False, True]


def test_gate_bounds():
    assert kalman.gate_bound(None, 3) == np.inf
    assert kalman.gate_bound(0.99, 3) == pytest.approx(11.3449, abs=1e-4)
    assert kalman.gate_bound(25.0, 3) == 25.0
    assert kalman.gate_bound(1.0, 3) == 1.0


# --- arcs -----------------------------------------------------------------------------------------------


def linear_arc(rng, epochs=60):
    model = clohessy_wiltshire(MEAN_MOTION, 1e-9)
    sensor = Wavy(np.hstack([np.eye(3), np.zeros((3, 3))]), 0.0, np.diag([0.04, 0.09, 0.25]))
    times = 60.0 * np.arange(1, epochs + 1)
    truth, seen = simulated(model, sensor, times, rng)
    seen[10:14] = np.nan
    return model, sensor, times, truth, seen


def test_smoother_is_batch_least_squares(rng):
    model, sensor, times, _, seen = linear_arc(rng)
    log = kalman.ExtendedKalmanFilter(model, START, PRIOR).run(times, [(sensor, seen)])
    x, p = kalman.smooth(log)
    best, covariance = arcs.batch(arcs.Arc(model, (START, PRIOR), times, [(sensor, seen)]))
    assert in_sigmas(x - best, covariance) < SMOOTHER
    scale = np.sqrt(np.einsum("kii,kjj->kij", covariance, covariance))
    assert np.abs((p - covariance) / scale).max() < SMOOTHER
    np.testing.assert_allclose(log.state[-1], best[-1], rtol=0, atol=1e-8)
    assert (np.einsum("kii->ki", p) <= np.einsum("kii->ki", np.array(log.covariance)) * (1 + 1e-12)).all()


@pytest.mark.parametrize("back", [False, True])
def test_smoother_of_a_nonlinear_arc_is_the_batch_of_its_linearisations(rng, back):
    model = clohessy_wiltshire(MEAN_MOTION, 1e-9)
    times = np.cumsum(rng.uniform(20, 100, 40)) * (-1 if back else 1)
    _, seen = simulated(model, CAMERA, times, rng)
    log = kalman.ExtendedKalmanFilter(model, START, PRIOR).run(times, [(CAMERA, seen)])
    x, _ = kalman.smooth(log)
    arc = arcs.Arc(model, (START, PRIOR), times, [(CAMERA, seen)])
    best, covariance = arcs.linear_batch(arc, log)
    assert in_sigmas(x - best, covariance) < SMOOTHER
    # And not far from the maximum a posteriori, which linearises at the answer.
    converged, _ = arcs.batch(arc)
    assert 1e-6 < in_sigmas(x[5:] - converged[5:], covariance[5:]) < 1.0


def test_controls_and_nonlinear_dynamics_in_the_batch(rng):
    model = swirl(rng, 4)
    sensor = wavy(rng, 4, 2, c=0.0)
    times, controls = 0.2 * np.arange(1, 21), rng.standard_normal((20, 2))
    prior = rng.standard_normal(4), spd(rng, 4)
    seen = rng.standard_normal((20, 2))
    log = kalman.ExtendedKalmanFilter(model, *prior).run(times, [(sensor, seen)], controls)
    x, _ = kalman.smooth(log)
    best, covariance = arcs.linear_batch(
        arcs.Arc(model, prior, times, [(sensor, seen)], controls=controls), log
    )
    assert in_sigmas(x - best, covariance) < SMOOTHER


def test_filter_is_consistent_on_its_own_model():
    """NEES and NIS of 60 runs in their exact bands."""
    runs, nees, nis = 60, [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        model, sensor, times, _, _ = linear_arc(rng, 2)
        start = START + np.sqrt(np.diag(PRIOR)) * rng.standard_normal(6)
        times = 60.0 * np.arange(1, 31)
        truth, seen = simulated(model, sensor, times, rng, start)
        log = kalman.ExtendedKalmanFilter(model, START, PRIOR).run(times, [(sensor, seen)])
        error = truth[-1] - log.state[-1]
        nees.append(error @ np.linalg.solve(log.covariance[-1], error))
        nis += [done[0].nis for done in log.updates]
    for values, dof in ((nees, 6), (nis, 3)):
        low, high = chi2.ppf([BAND / 2, 1 - BAND / 2], dof * len(values))
        assert low < sum(values) < high


# --- factors ----------------------------------------------------------------------------------------------


def test_factors_round_trip(rng):
    p = spd(rng, 6)
    u, d = bierman.factor(p.tolist())
    np.testing.assert_allclose(bierman.compose(u, d), p, rtol=0, atol=1e-14)
    assert (np.tril(np.array(u), -1) == 0).all()


def test_factors_are_joseph(rng):
    """A nonlinear filter's own Phi, Q, H, scalar by scalar, in factors."""
    model, prior = swirl(rng, 5), spd(rng, 5)
    filter_ = kalman.ExtendedKalmanFilter(model, rng.standard_normal(5), prior)
    steps = []
    for _ in range(10):
        q = model.process_noise(filter_.state, 0.2)
        phi = filter_.predict(0.2)
        r = rng.uniform(0.1, 1.0, 2)
        sensor = Wavy(rng.standard_normal((2, 5)), 0.1, np.diag(r))
        h = sensor.jacobian(filter_.state)
        filter_.update(sensor, sensor.predict(filter_.state) + 0.1)
        steps.append((phi, q, list(zip(h, r, strict=True))))
    got = np.array(bierman.filter_covariance(prior, steps))
    np.testing.assert_allclose(got, filter_.covariance, rtol=0, atol=SAME_FORMULA)


def test_sixty_digits_are_sixty_digits(rng):
    """Joseph and the factors agree to 1e-45 there, and doubles lose where they must."""
    p = bierman.long(spd(rng, 4))
    u, d = bierman.factor(p)
    for _ in range(30):
        h, r = bierman.long(rng.standard_normal(4)), bierman.mpmath.mpf("1e-8")
        p = bierman.joseph_scalar(p, h, r)
        u, d, _ = bierman.bierman(u, d, h, r)
    difference = max(
        abs(a - b)
        for ra, rb in zip(p, bierman.compose(u, d), strict=True)
        for a, b in zip(ra, rb, strict=True)
    )
    assert 0 < difference < bierman.mpmath.mpf("1e-45")


def test_single_precision_keeps_factors_alive_where_joseph_dies(rng):
    """A prior 1e8 times the measurement noise in variance: factors stay positive, P does not."""
    f = np.float32
    p = [[f(1e4 * (i == j)) for j in range(3)] for i in range(3)]
    u, d = bierman.factor(p)
    died = False
    reference = bierman.long(np.array(p, float))
    for k in range(30):
        h = np.array([1.0, 1.0 + 1e-3 * np.sin(k), 1e-2 * np.cos(k)], f)
        p = bierman.joseph_scalar(p, list(h), f(1e-4))
        u, d, _ = bierman.bierman(u, d, list(h), f(1e-4))
        reference = bierman.joseph_scalar(reference, bierman.long(h), bierman.mpmath.mpf(float(f(1e-4))))
        died |= np.linalg.eigvalsh(bierman.short(p)).min() < 0
        assert min(d) > 0
    assert died
    exact, factors = bierman.short(reference), bierman.short(bierman.compose(u, d))
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert np.abs((factors - exact) / scale).max() < 1e-2


def test_complex_step_is_a_derivative():
    np.testing.assert_allclose(
        complex_step(lambda x: np.array([x[0] * x[1]]), np.array([2.0, 3.0])), [[3, 2]]
    )

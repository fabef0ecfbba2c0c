"""The filters by Monte Carlo: consistent on their own model, alive where naive filters die."""

from __future__ import annotations

import numpy as np
import pytest

import losnav as ln
from tests.conftest import BAND
from tests.oracle import bierman
from tests.statistics.bands import nees_band

MEAN_MOTION = 1.04248275e-3
ORBIT = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-9)
CAMERA = ln.sensors.RangeBearing(0.2, 6e-4)
TRUTH = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])
# A prior small enough for one linearisation to do: the angles see 1 m at 500 m.
NARROW = np.diag([1.0] * 3 + [0.0004] * 3)
# The one of the approach study, with which the plain start is slightly optimistic.
WIDE = np.diag([100.0] * 3 + [0.0025] * 3)
DCM = np.eye(3)


def arcs(seed, *, runs=200, epochs=60, prior=NARROW, sensor=CAMERA, model=ORBIT, dt=60.0):
    """True states (runs, T, 6) with process noise, and noisy measurements; the mean starts at TRUTH."""
    rng = np.random.default_rng(seed)
    x = TRUTH + rng.standard_normal((runs, 6)) @ np.linalg.cholesky(prior).T
    root = np.linalg.cholesky(model.process_noise(TRUTH, dt))
    states = []
    for _ in range(epochs):
        x = model.propagate(x, dt) + rng.standard_normal((runs, 6)) @ root.T
        states.append(x)
    truth = np.stack(states, axis=1)
    times = dt * np.arange(1, epochs + 1)
    return times, truth, sensor.simulate(truth, rng, dcm=DCM), rng


def ekf(prior=NARROW, model=ORBIT, **options):
    return ln.ExtendedKalmanFilter(model, TRUTH, prior, **options)


def filters():
    return {
        "joseph": ekf,
        "ud": lambda: ekf(form="ud"),
        "iterated": lambda: ekf(iterations=3),
        "unscented": lambda: ln.UnscentedKalmanFilter(ORBIT, TRUTH, NARROW),
    }


# --- consistency on the own model ----------------------------------------------------------------------


@pytest.mark.parametrize("name", filters())
def test_nees_and_nis_in_their_bands(name):
    times, truth, z, _ = arcs(1)
    log = filters()[name]().run(times, [(CAMERA, z)], dcm=DCM)
    nees, nis = ln.consistency.nees(log, truth), ln.consistency.nis(log)
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()
    assert ln.consistency.autocorrelation(log).white
    assert nees.fraction_inside > 0.85
    assert nis.fraction_inside > 0.85
    low, high = nees_band(6, 200)
    assert low < nees.average[-1] < high
    assert nis.expected_mean == 3


def test_directions_count_two_each():
    marks = np.array([[0.0, 0, 50], [40, 0, 0], [0, -30, 10]])
    sensor = ln.sensors.LineOfSight(marks, 1e-3)
    times, truth, z, _ = arcs(2, sensor=sensor)
    log = ekf().run(times, [(sensor, z)], dcm=DCM)
    nis = ln.consistency.nis(log)
    assert nis.expected_mean == 6
    assert nis.consistent, nis.summary()
    assert ln.consistency.nees(log, truth).consistent


def test_smoother_is_consistent_and_better():
    times, truth, z, _ = arcs(3)
    log = ekf().run(times, [(CAMERA, z)], dcm=DCM)
    smooth = log.smooth()
    low, high = nees_band(6, 200, outside=BAND / 6)
    for k in range(0, 60, 10):
        error = truth[:, k] - smooth.state[:, k]
        value = np.einsum("ri,rij,rj->r", error, np.linalg.inv(smooth.covariance[:, k]), error)
        assert low < value.mean() < high

    def rms(states):
        return np.sqrt(np.square(truth - states).mean(axis=0))

    # Never worse but by chance where nothing is gained (the last epochs), and clearly better in the middle.
    assert (rms(smooth.state) <= rms(log.state) * 1.02).all()
    assert (rms(smooth.state)[30] < 0.8 * rms(log.state)[30]).all()
    variances = [np.einsum("rkii->rki", each.covariance) for each in (smooth, log)]
    assert (variances[0] <= variances[1] * (1 + 1e-9)).all()


# --- outliers -------------------------------------------------------------------------------------------


def with_outliers(seed=4):
    """2 % of the measurements off by 30 sigma in every component, either way."""
    times, truth, z, rng = arcs(seed, prior=WIDE)
    hit = rng.random(z.shape[:-1]) < 0.02
    sign = rng.choice([-1.0, 1.0], size=z.shape)
    z = z + hit[..., np.newaxis] * sign * 30 * np.array([0.2, 6e-4, 6e-4])
    return times, truth, z, hit


def lost(log, truth):
    """Runs whose last position is more than ten of its standard deviations (at least) off."""
    error = np.linalg.norm((truth - log.state)[:, -1, :3], axis=-1)
    deviation = np.sqrt(np.einsum("rii->r", log.covariance[:, -1, :3, :3]))
    return error > 10 * deviation


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_gate_with_lock_out_protection_loses_nobody(form):
    times, truth, z, hit = with_outliers()
    options = {"gate": 0.9999, "form": form, "iterations": 3}
    logs = {
        "none": ekf(WIDE, form=form, iterations=3).run(times, [(CAMERA, z)], dcm=DCM),
        "alone": ekf(WIDE, relock_after=None, **options).run(times, [(CAMERA, z)], dcm=DCM),
        "relock": ekf(WIDE, relock_after=3, **options).run(times, [(CAMERA, z)], dcm=DCM),
    }
    gone = {name: int(lost(log, truth).sum()) for name, log in logs.items()}
    assert gone["relock"] == 0
    # At this seed 11 of 200: an outlier got through while the covariance was wide, and locked the truth out.
    assert gone["alone"] == 11
    # 3 rms over the second half: 2.8 m without a gate, 0.73 m with it, 420 m with those it lost.
    rms = {
        name: 3 * np.sqrt(np.square((truth - log.state)[:, 30:, :3]).sum(axis=-1).mean())
        for name, log in logs.items()
    }
    assert rms["relock"] < 0.6 * rms["none"]
    assert rms["relock"] < 0.6 * rms["alone"]
    rejected = ~logs["relock"].accepted[..., 0]
    # Those that pass come while the covariance is wide, or as the one taken regardless.
    assert rejected[hit].mean() > 0.9
    assert rejected[~hit].mean() < 0.02


# --- large priors -----------------------------------------------------------------------------------------


def test_large_priors_need_more_than_one_linearisation():
    """60 m of prior where one look sees 0.3 m: the plain filter believes its first update.

    NEES after it, 300 runs: plain 3300, iterated 5.8, underweighted 3.5 (beta = 0.2: safe, pessimistic for
    a dozen epochs), unscented 370.
    """
    prior = np.diag([60.0**2] * 3 + [0.05**2] * 3)
    times, truth, z, _ = arcs(5, runs=300, epochs=30, prior=prior)
    values = {}
    for name, options in {
        "plain": {},
        "iterated": {"iterations": 10},
        "underweighted": {"underweighting": 0.2},
    }.items():
        log = ekf(prior, **options).run(times, [(CAMERA, z)], dcm=DCM)
        values[name] = ln.consistency.nees(log, truth)
    log = ln.UnscentedKalmanFilter(ORBIT, TRUTH, prior).run(times, [(CAMERA, z)], dcm=DCM)
    values["unscented"] = ln.consistency.nees(log, truth)
    low, high = nees_band(6, 300)
    assert values["plain"].average[0] > 1000
    assert low < values["iterated"].average[0] < high
    assert values["iterated"].consistent
    assert values["underweighted"].average.max() < high
    assert values["underweighted"].average[-1] > 0.8 * 6
    assert high < values["unscented"].average[0] < 0.2 * values["plain"].average[0]


# --- consider ---------------------------------------------------------------------------------------------


# Quiet enough for the measurements of many epochs to be averaged, which a bias is not.
QUIET = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-11)


class BiasedOrbit:
    """[r v b]: relative motion and two constant angles between camera and what is known of it."""

    def propagate(self, state, dt, control=None):
        return np.concatenate([QUIET.propagate(state[:6], dt, control), state[6:]])

    def transition(self, state, dt, control=None):
        phi = np.eye(8)
        phi[:6, :6] = QUIET.transition(state[:6], dt)
        return phi

    def process_noise(self, state, dt):
        q = np.zeros((8, 8))
        q[:6, :6] = QUIET.process_noise(state[:6], dt)
        return q


class BiasedCamera:
    """Azimuth and elevation off by ``b``."""

    def predict(self, state, **context):
        return CAMERA.predict(state[:6], dcm=DCM) + np.concatenate([[0.0], state[6:]])

    def jacobian(self, state, **context):
        return np.hstack([CAMERA.jacobian(state[:6], dcm=DCM), [[0, 0], [1, 0], [0, 1]]])

    def noise(self, state=None, **context):
        return CAMERA.noise()

    def residual(self, z, predicted):
        return CAMERA.residual(z, predicted)


BORESIGHT = np.radians(0.02)
RUNS_CONSIDERED = 60


def considered(options, bias_sigma=BORESIGHT, seed=6):
    """NEES of [r v] at the end of runs whose camera is off by a constant drawn anew for each."""
    times, truth, z, rng = arcs(seed, runs=RUNS_CONSIDERED, epochs=40, model=QUIET)
    bias = BORESIGHT * rng.standard_normal((RUNS_CONSIDERED, 1, 2))
    z = z + np.concatenate([np.zeros((RUNS_CONSIDERED, 1, 1)), bias], axis=-1)
    prior = np.zeros((8, 8))
    prior[:6, :6] = NARROW
    prior[6:, 6:] = bias_sigma**2 * np.eye(2)
    filter_ = ln.ExtendedKalmanFilter(BiasedOrbit(), np.append(TRUTH, [0.0, 0.0]), prior, **options)
    log = filter_.run(times, [(BiasedCamera(), z)])
    padded = np.concatenate([truth, np.broadcast_to(bias, (*truth.shape[:-1], 2))], axis=-1)
    return ln.consistency.nees(log, padded, components=slice(0, 6)), log


@pytest.mark.slow
def test_consider_filter_knows_what_a_boresight_bias_costs():
    """0.02 degrees, constant: the plain filter is overconfident, the consider filter is not, and does not
    estimate the bias."""
    plain, _ = considered({}, bias_sigma=1e-9)
    schmidt, log = considered({"consider": (6, 7)})
    low, high = nees_band(6, RUNS_CONSIDERED)
    assert plain.average[-1] > 2 * high
    assert low < schmidt.average[-1] < high
    assert (log.state[..., 6:] == 0).all()
    np.testing.assert_allclose(log.covariance[..., 6, 6], BORESIGHT**2, rtol=1e-12)


# --- endurance --------------------------------------------------------------------------------------------


def positive_definite(p):
    d = np.sqrt(np.diag(p))
    return bool((p == p.T).all() and np.linalg.eigvalsh(p / np.outer(d, d)).min() > 0)


@pytest.mark.slow
@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_a_million_updates(form):
    """Every hundredth is looked at: symmetric to the bit, positive definite; the end is the steady state."""
    filter_ = ekf(form=form)
    block = 50_000
    z = CAMERA.predict(TRUTH, dcm=DCM)
    still = np.broadcast_to(z, (block, 3))
    for k in range(20):
        times = filter_.time + np.arange(1, block + 1) * 1.0
        log = filter_.run(times, [(CAMERA, still)], dcm=DCM)
        assert log.accepted.all()
        assert positive_definite(filter_.covariance)
        some = log.covariance[:: 100 if k else 1]
        assert (some == np.swapaxes(some, -1, -2)).all()
        d = np.sqrt(np.einsum("kii->ki", some))
        assert np.linalg.eigvalsh(some / (d[:, :, None] * d[:, None, :])).min() > 0
    assert filter_.time == 1e6


@pytest.mark.slow
@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_a_million_updates_without_process_noise(form):
    """The covariance shrinks for ever: 10^6 looks, none forgotten."""
    model = ln.dynamics.ClohessyWiltshire(0.0)
    lidar = ln.sensors.Range(1.0)
    start = np.array([1e4, 0, 0, 0, 0, 0.0])
    filter_ = ln.ExtendedKalmanFilter(model, start, np.eye(6) * 1e4, form=form)
    block = 100_000
    for _ in range(10):
        filter_.run(np.full(block, filter_.time), [(lidar, np.full((block, 1), 1e4))])
    assert filter_.covariance[0, 0] == pytest.approx(1.0 / (1e6 + 1e-4), rel=1e-6)
    assert positive_definite(filter_.covariance)


DECADES = [("joseph", 1e6, 1.0), ("ud", 1e6, 1.0), ("ud", 1e7, 0.1)]


@pytest.mark.parametrize(("form", "prior_metres", "sigma_range"), DECADES)
def test_units_fourteen_decades_apart(form, prior_metres, sigma_range):
    """Variances of position and velocity 14 decades apart.

    In the last case the first look also shrinks a variance by 16 decades, more than doubles have digits: only
    the factors live.
    """
    prior = np.diag([prior_metres**2] * 3 + [(1e-7 * prior_metres) ** 2] * 3)
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-12)
    start = np.array([4e7, 1e7, -2e7, 1.0, 2.0, 3.0])
    filter_ = ln.ExtendedKalmanFilter(model, start, prior, form=form)
    camera = ln.sensors.RangeBearing(sigma_range, 1e-6)
    # Near the start, for the linearisation to hold; the covariance does not know it.
    truth = start + np.array([10.0, -10.0, 10.0, 0.1, 0.1, 0.1])
    for _ in range(200):
        truth = model.propagate(truth, 30.0)
        step = filter_.step(30.0, camera, camera.predict(truth, dcm=DCM), dcm=DCM)
        assert step.accepted
        assert positive_definite(filter_.covariance)
    deviation = np.sqrt(np.diag(filter_.covariance))
    assert (np.abs(truth - filter_.state) < 6 * deviation).all()


# --- sixty digits -----------------------------------------------------------------------------------------


def test_factors_against_sixty_digits():
    """Range and angles of 1e-9 noise on a prior of 1e4: Joseph keeps few digits, the factors more."""
    model = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, 1e-12)
    sensor = ln.sensors.RangeBearing(1e-6, 1e-9)
    prior = np.diag([1e4**2] * 3 + [1e2**2] * 3)
    both = {form: ln.ExtendedKalmanFilter(model, TRUTH, prior, form=form) for form in ("joseph", "ud")}
    truth = TRUTH
    # The reference follows the linearisations of the filter in factors.
    exact = bierman.long(prior)
    u, d = bierman.factor(exact)
    errors = {form: [] for form in both}
    for _ in range(15):
        truth = model.propagate(truth, 10.0)
        z = sensor.predict(truth, dcm=DCM)
        phi, q = model.transition(truth, 10.0), model.process_noise(truth, 10.0)
        for filter_ in both.values():
            filter_.predict(10.0)
        g, weights = bierman.factor(bierman.long(q))
        u, d = bierman.thornton(u, d, bierman.long(phi), g, weights)
        h = bierman.long(sensor.jacobian(both["ud"].state, dcm=DCM))
        r = bierman.long(np.diag(sensor.noise()))
        for k in range(3):
            u, d, _ = bierman.bierman(u, d, h[k], r[k])
        for filter_ in both.values():
            filter_.update(sensor, z, dcm=DCM)
        reference = bierman.short(bierman.compose(u, d))
        scale = np.sqrt(np.outer(np.diag(reference), np.diag(reference)))
        for form, filter_ in both.items():
            errors[form].append(np.abs((filter_.covariance - reference) / scale).max())
    # Relative to the standard deviations: 70 for Joseph's form, 6e-7 for the factors.
    assert max(errors["ud"]) < 1e-5
    assert max(errors["joseph"]) > 1.0

"""The consistency tests themselves: false alarms at the stated rate, detection of what they are for.

Filters here are linear Kalman filters in plain NumPy, all runs at once: their errors and innovations follow
the laws exactly, correlated over time as a filter's are.
"""

import types

import numpy as np
import pytest
from scipy.stats import binom, chi2

import losnav as ln
from tests.conftest import BAND

RUNS, EPOCHS = 20, 80
PHI = np.array([[1.0, 1.0], [0.0, 1.0]])
Q = 1e-3 * np.array([[1 / 3, 1 / 2], [1 / 2, 1.0]])
R = np.array([[0.25]])


def arc(rng, runs=RUNS, epochs=EPOCHS, q_factor=1.0, bias=0.0):
    """Log and truth of a position-velocity filter that claims ``q_factor`` Q and knows of no ``bias``."""
    p = np.diag([1.0, 0.1])
    error = rng.standard_normal((runs, 2)) @ np.linalg.cholesky(p).T
    states, covariances, innovations, nis = [], [], [], []
    for _ in range(epochs):
        p = PHI @ p @ PHI.T + q_factor * Q
        error = error @ PHI.T + rng.standard_normal((runs, 2)) @ np.linalg.cholesky(Q).T
        s = p[:1, :1] + R
        k = p[:, :1] / s
        y = error[:, :1] + np.sqrt(R[0, 0]) * rng.standard_normal((runs, 1)) + bias
        error = error - y @ k.T
        p = p - k @ s @ k.T
        states.append(-error)
        covariances.append(np.tile(p, (runs, 1, 1)))
        innovations.append(y)
        nis.append(y**2 / s)
    log = types.SimpleNamespace(
        time=np.arange(epochs, dtype=float),
        state=np.stack(states, axis=1),
        covariance=np.stack(covariances, axis=1),
        innovation=[np.stack(innovations, axis=1)],
        nis=np.stack(nis, axis=1),
        accepted=np.ones((runs, epochs, 1), bool),
        dof=np.array([1]),
    )
    return log, np.zeros((epochs, 2))


def rate_band(probability, trials):
    return binom.ppf([BAND / 2, 1 - BAND / 2], trials, probability)


def test_false_alarms_come_at_the_stated_rate():
    """400 campaigns; the error's correlation over 6 epochs would call four in ten wrong if ignored."""
    campaigns, level = 400, 0.95
    alarms = np.zeros(3)
    inside = []
    for seed in range(campaigns):
        log, truth = arc(np.random.default_rng(seed))
        nees = ln.consistency.nees(log, truth, overall_confidence=level)
        nis = ln.consistency.nis(log, overall_confidence=level)
        white = ln.consistency.autocorrelation(log, overall_confidence=level)
        alarms += [not nees.consistent, not nis.consistent, not white.white]
        inside.append(nis.fraction_inside)
        assert nees.correlation_time > 2.0
    low, high = rate_band(1 - level, campaigns)
    # NEES and whiteness are tested by approximations of their laws, good to a factor of two in the rate.
    assert 0.5 * low < alarms[0] < 1.6 * high
    assert low < alarms[1] < high
    assert 0.5 * low < alarms[2] < 1.6 * high
    total = campaigns * EPOCHS
    assert rate_band(level, total)[0] < np.sum(inside) * EPOCHS < rate_band(level, total)[1]


def test_bounds_are_the_exact_quantiles(rng):
    log, truth = arc(rng)
    nees, nis = ln.consistency.nees(log, truth), ln.consistency.nis(log)
    for test, dof in ((nees, 2 * RUNS), (nis, RUNS)):
        low, high = chi2.ppf([0.025, 0.975], dof) / RUNS
        np.testing.assert_allclose(test.lower, low, rtol=1e-12)
        np.testing.assert_allclose(test.upper, high, rtol=1e-12)
    low, high = chi2.ppf([5e-4, 1 - 5e-4], RUNS * EPOCHS) / (RUNS * EPOCHS)
    np.testing.assert_allclose(nis.bounds, (low, high), rtol=1e-12)
    assert nees.bounds[1] - nees.bounds[0] > 1.5 * (high - low) * np.sqrt(2)
    errors = truth - log.state
    expected = np.einsum("rti,rtij,rtj->rt", errors, np.linalg.inv(log.covariance), errors)
    np.testing.assert_allclose(nees.value, expected, rtol=1e-10)


def test_a_single_run():
    log, truth = arc(np.random.default_rng(3), runs=1, epochs=300)
    for name in ("state", "covariance", "nis", "accepted"):
        setattr(log, name, getattr(log, name)[0])
    log.innovation = [log.innovation[0][0]]
    assert ln.consistency.nees(log, truth).consistent
    assert ln.consistency.nees(log, truth).runs == 1
    assert ln.consistency.nis(log).consistent
    assert ln.consistency.autocorrelation(log).white


@pytest.mark.parametrize(("q_factor", "verdict"), [(0.05, "optimistic"), (20.0, "pessimistic")])
def test_wrong_process_noise_is_found(q_factor, verdict):
    log, truth = arc(np.random.default_rng(1), q_factor=q_factor)
    nees, nis = ln.consistency.nees(log, truth), ln.consistency.nis(log)
    assert nees.verdict == nis.verdict == verdict
    assert not ln.consistency.autocorrelation(log).white
    assert (nees.factor > 1) == (verdict == "optimistic")
    assert verdict.upper() in nees.summary()
    assert nees.fraction_inside < 0.5


def test_a_bias_hides_from_nis_but_not_from_nees():
    """It settles in the state: the innovations of later epochs hardly show it."""
    log, truth = arc(np.random.default_rng(2), bias=1.0)
    assert ln.consistency.nees(log, truth).verdict == "optimistic"
    late = types.SimpleNamespace(**vars(log))
    late.time, late.nis, late.accepted = log.time[20:], log.nis[:, 20:], log.accepted[:, 20:]
    assert ln.consistency.nis(late).consistent


def test_outliers_count_and_are_told_apart(rng):
    log, _ = arc(rng)
    log.nis[:, ::50] = 900.0
    log.accepted[:, ::50] = False
    log.nis[:, 5::50] = np.nan
    log.accepted[:, 5::50] = False
    test = ln.consistency.nis(log)
    assert test.verdict == "optimistic"
    assert f"{2 * RUNS} of {RUNS * (EPOCHS - 2)} measurements rejected" in test.summary()
    kept = test.value[~test.rejected & ~np.isnan(test.value)].mean()
    assert f"{kept:.4g}" in test.summary()
    assert test.expected[5] == 0
    assert not test.inside[5]
    assert ln.consistency.autocorrelation(log).white


def test_several_sensors(rng):
    log, _ = arc(rng)
    other, _ = arc(rng, q_factor=0.02)
    log.nis = np.concatenate([log.nis, other.nis], axis=-1)
    log.accepted = np.ones(log.nis.shape, bool)
    log.dof = np.array([1, 1])
    log.innovation = [log.innovation[0], other.innovation[0]]
    both = ln.consistency.nis(log)
    assert both.verdict == "optimistic"
    assert [s.verdict for s in both.sensors] == ["consistent", "optimistic"]
    assert both.expected_mean == 2
    assert ln.consistency.nis(log, sensor=0).consistent
    assert "sensor 1: OPTIMISTIC" in both.summary()
    assert ln.consistency.autocorrelation(log, sensor=0).white
    assert not ln.consistency.autocorrelation(log, sensor=1).white


def test_components_and_units_do_not_matter(rng):
    """14 decades between the variances change nothing; a part of the state has its own test."""
    log, truth = arc(rng)
    whole = ln.consistency.nees(log, truth)
    unit = np.array([1e-3, 1e4])
    scaled = types.SimpleNamespace(
        time=log.time, state=log.state * unit, covariance=log.covariance * np.outer(unit, unit)
    )
    np.testing.assert_allclose(ln.consistency.nees(scaled, truth * unit).value, whole.value, rtol=1e-9)
    part = ln.consistency.nees(log, truth, components=[0])
    np.testing.assert_allclose(part.value, log.state[..., 0] ** 2 / log.covariance[..., 0, 0], rtol=1e-12)
    assert part.expected_mean == 1
    again = ln.consistency.nees(log, truth, components=slice(0, 1), difference=lambda a, b: a - b)
    assert (again.value == part.value).all()


def test_void_component_of_a_direction(rng):
    """A unit vector along z: its third component is of second order, never white, and no measurement."""
    small = 1e-3 * rng.standard_normal((10, 100, 2))
    y = np.concatenate([small, -0.5 * np.square(small).sum(axis=-1, keepdims=True)], axis=-1)
    log = types.SimpleNamespace(innovation=[y], accepted=np.ones((10, 100, 1), bool), dof=np.array([2]))
    test = ln.consistency.autocorrelation(log)
    assert test.white
    assert np.isnan(test.value[:, 2]).all()
    log.dof = np.array([3])
    assert not ln.consistency.autocorrelation(log).white


def test_figures(tmp_path, rng):
    log, truth = arc(rng)
    for k, test in enumerate(
        [ln.consistency.nees(log, truth), ln.consistency.nis(log), ln.consistency.autocorrelation(log)]
    ):
        written = test.plot(tmp_path / f"{k}.png")
        assert written.read_bytes()[:4] == b"\x89PNG"
        assert test.plot().axes


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda log, truth: ln.consistency.nees(log, truth[:-1]), "truth"),
        (lambda log, truth: ln.consistency.nees(log, np.zeros((3, *truth.shape))), "truth"),
        (lambda log, truth: ln.consistency.nees(log, truth * np.nan), "truth"),
        (lambda log, truth: ln.consistency.nees(log, truth, confidence=1.0), "confidence"),
        (lambda log, truth: ln.consistency.nees(log, truth, overall_confidence=0.0), "overall_confidence"),
        (lambda log, truth: ln.consistency.nis(log, sensor=1), "sensor"),
        (lambda log, truth: ln.consistency.nis(log, dof=[1, 1, 1]), "dof"),
        (lambda log, truth: ln.consistency.autocorrelation(log, sensor=3), "sensor"),
        (lambda log, truth: ln.consistency.autocorrelation(log, max_lag=EPOCHS), "max_lag"),
    ],
)
def test_what_is_refused(call, argument, rng):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call(*arc(rng))


def test_covariances_must_be_positive_definite(rng):
    log, truth = arc(rng)
    log.covariance[3, 5, 0, 0] = 0.0
    with pytest.raises(ln.NumericalError, match="covariance"):
        ln.consistency.nees(log, truth)

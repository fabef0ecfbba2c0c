"""Heliocentric filters by Monte Carlo: consistent on both arcs, lost where one linearisation is too few, and
blind to aberration as far as innovations go."""

from __future__ import annotations

import numpy as np
import pytest

import losnav as ln
from losnav.constants import SUN_MU
from tests.statistics.bands import nees_band

ORBIT = ln.dynamics.TwoBody(SUN_MU)
SUN = ln.sensors.SunDirection(5e-5)
APPARENT = ln.sensors.SunDirection(5e-5, aberration=True)
# Of the whole arc, s; a quarter of the published rate is enough to see what happens.
SPAN, STEP = 1.8e7, 7200.0
# 1-sigma of the first guess, 6e5 km and 0.05 km/s as norms.
GUESS = np.array([6e8] * 3 + [50.0] * 3) / np.sqrt(3)


def kepler_state(a, e, *angles):
    """``[r v]`` from elements, degrees: inclination, node, argument of perihelion, true anomaly."""
    i, node, argument, f = np.deg2rad(angles)
    p = a * (1 - e * e)

    def along(t):
        return np.array(
            [
                np.cos(node) * np.cos(t) - np.sin(node) * np.sin(t) * np.cos(i),
                np.sin(node) * np.cos(t) + np.cos(node) * np.sin(t) * np.cos(i),
                np.sin(t) * np.sin(i),
            ]
        )

    x, y = along(argument), along(argument + np.pi / 2)
    r = p / (1 + e * np.cos(f)) * (np.cos(f) * x + np.sin(f) * y)
    return np.concatenate([r, np.sqrt(SUN_MU / p) * (-np.sin(f) * x + (e + np.cos(f)) * y)])


START = kepler_state(2e11, 0.25, 23.0, 1.16, 108.89, 104.48)


def arcs(direction, runs, *, seen=SUN, scale=1.0, step=STEP, seed=1):
    """Times, the truth, measurements of every run, and a start of every run with its covariance."""
    times = direction * step * np.arange(1, round(SPAN / step) + 1)
    truth = ORBIT.trajectory(START, np.r_[0.0, times])[1:]
    rng = np.random.default_rng(seed)
    z = seen.simulate(np.broadcast_to(truth, (runs, *truth.shape)), rng)
    first = START + rng.standard_normal((runs, 6)) * GUESS * scale
    return times, truth, z, first, np.diag((GUESS * scale) ** 2)


def filtered(case, sensor=SUN, **options):
    times, truth, z, first, p = case
    log = ln.ExtendedKalmanFilter(ORBIT, first, p, **options).run(times, [(sensor, z)])
    return log, ln.consistency.nees(log, truth), ln.consistency.nis(log)


def deviation(log):
    return np.sqrt(np.trace(log.covariance[..., -1, :3, :3].reshape(-1, 3, 3)[0]))


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize(("direction", "position"), [(1, 2503e3), (-1, 610.4e3)])
def test_both_arcs_are_consistent_and_as_good_as_published_bounds(direction, position, form):
    """Every 1800 s as published: 2503 km forward, 610 km backward; 100 000 steps a direction, in metres."""
    log, nees, nis = filtered(arcs(direction, 10, step=1800.0), form=form)
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()
    assert nis.expected_mean == 2
    assert ln.consistency.autocorrelation(log).white
    assert deviation(log) == pytest.approx(position, rel=2e-3)
    low, high = nees_band(6, 10)
    assert low < nees.average[-1] < high


def test_process_noise_per_step_is_expressible():
    """Of 1e-15 I per step, km and km/s, as an acceleration density: nothing anybody would notice."""
    times, _, z, first, p = arcs(1, 2, step=1800.0)
    psd = 1e-15 * 1e6 / 1800.0  # (m/s)^2 a step over its length
    noisy = ln.ExtendedKalmanFilter(ln.dynamics.TwoBody(SUN_MU, psd), first, p).run(times, [(SUN, z)])
    quiet = ln.ExtendedKalmanFilter(ORBIT, first, p).run(times, [(SUN, z)])
    np.testing.assert_allclose(
        psd * 1800.0 / 1e6, ln.dynamics.TwoBody(SUN_MU, psd).process_noise(START, 1800.0)[3, 3] / 1e6
    )
    assert 1.0 < deviation(noisy) / deviation(quiet) < 1.02


@pytest.fixture(scope="module")
def far():
    """Twenty times the first guess: 1.2e7 km."""
    return arcs(1, 20, scale=20.0)


def test_one_linearisation_is_lost_and_says_so(far):
    _, nees, _ = filtered(far)
    assert not nees.consistent
    assert nees.mean > 500
    assert "OPTIMISTIC: errors are" in nees.summary()


@pytest.mark.parametrize("form", ["joseph", "ud"])
def test_four_linearisations_are_consistent(far, form):
    log, nees, nis = filtered(far, iterations=4, form=form)
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()
    error = np.sqrt((nees.average / 6).mean())
    assert 0.8 < error < 1.2
    assert deviation(log) < 6e6


def test_aberration_left_out_is_invisible_to_the_innovations():
    """1.7e4 km of bias, seventy times the NEES of the band, and the NIS has nothing to say."""
    case = arcs(1, 20, seen=APPARENT)
    log, nees, nis = filtered(case)
    bias = np.linalg.norm((log.state[:, -1] - case[1][-1]).mean(axis=0)[:3])
    assert bias == pytest.approx(1.68e7, rel=0.1)
    assert nees.mean > 500
    assert "OPTIMISTIC" in nees.summary()
    assert nis.consistent, nis.summary()
    assert nis.mean == pytest.approx(2.0, abs=0.01)
    assert ln.consistency.autocorrelation(log).white


def test_aberration_in_the_model_repairs_it():
    _, nees, nis = filtered(arcs(1, 20, seen=APPARENT), APPARENT)
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()


def test_doppler_and_planets_add_what_they_should():
    """With Doppler to the Sun of 1 m/s, and the Earth to 5e-6 rad: each better by factors, all consistent."""
    times, truth, z, first, p = arcs(1, 20)
    day = 86400.0
    path = ln.Ephemeris.sampled(
        lambda t: ln.ephemeris.approximate_planet("earth", t), np.arange(-1.0, 211.0, 2.0) * day
    )
    rng = np.random.default_rng(7)
    many = np.broadcast_to(truth, (*z.shape[:-1], 6))
    earth, doppler = ln.sensors.BodyDirection(path, 5e-6), ln.sensors.RangeRate(1.0)
    more = {
        "doppler": [(doppler, doppler.simulate(many, rng))],
        "earth": [(earth, earth.simulate(many, rng, time=times))],
    }
    alone = filtered((times, truth, z, first, p))[0]
    for name, factor in (("doppler", 4.0), ("earth", 8.0)):
        ekf = ln.ExtendedKalmanFilter(ORBIT, first, p, iterations=3)
        log = ekf.run(times, [(SUN, z), *more[name]])
        nees = ln.consistency.nees(log, truth)
        assert nees.consistent, nees.summary()
        assert ln.consistency.nis(log).consistent
        assert deviation(alone) / deviation(log) > factor

"""Ephemerides: accuracy between samples, approximate planets, JPL kernels, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import losnav as ln
from losnav.ephemeris import PLANET_MU, approximate_planet

DAY = 86400.0


def around(t):
    """An ellipse in closed form would do; a circle with a wobble has every derivative."""
    n = 2e-7
    place = np.stack([np.cos(n * t), np.sin(n * t), 0.1 * np.sin(2 * n * t)], axis=-1)
    rate = n * np.stack([-np.sin(n * t), np.cos(n * t), 0.2 * np.cos(2 * n * t)], axis=-1)
    return 1.5e11 * place, 1.5e11 * rate


@pytest.mark.parametrize(("days", "positions", "limit"), [(2, 1e-3, 0.02), (5, 0.5, 60.0), (10, 80.0, 3e4)])
def test_between_samples(days, positions, limit):
    """With velocities and without: errors in metres, and what the ephemeris estimates of them."""
    times = np.arange(0.0, 400.0, days) * DAY
    there = np.linspace(0.0, times[-1], 4001)
    for with_velocities, bound in ((True, positions), (False, limit)):
        p, v = around(times)
        path = ln.Ephemeris(times, p, v if with_velocities else None)
        error = np.linalg.norm(path(there)[:, :3] - around(there)[0], axis=1).max()
        assert error < bound
        assert error < path.interpolation_error
        speed = np.linalg.norm(path(there)[:, 3:] - around(there)[1], axis=1).max()
        assert speed < 10 * max(bound, 1e-2) / (days * DAY)


def test_uneven_samples_and_few():
    rng = np.random.default_rng(3)
    times = np.cumsum(rng.uniform(1, 6, size=60)) * DAY
    path = ln.Ephemeris(times, *around(times))
    there = np.linspace(times[0], times[-1], 1001)
    assert np.abs(path(there)[:, :3] - around(there)[0]).max() < 0.2
    for few in (2, 3, 4):
        path = ln.Ephemeris(times[:few], *around(times[:few]))
        there = np.linspace(times[0], times[few - 1], 101)
        error = np.linalg.norm(path(there)[:, :3] - around(there)[0], axis=1).max()
        assert error <= 2 * path.interpolation_error
    for time, place, speed in zip(times[:4], *around(times[:4]), strict=True):
        np.testing.assert_allclose(path(time), [*place, *speed], rtol=1e-12, atol=1e-4)


def test_functions_of_any_kind_are_sampled():
    times = np.arange(0.0, 100.0, 5.0) * DAY
    direct = ln.Ephemeris(times, *around(times))
    for function in (around, lambda t: np.concatenate(around(t), axis=-1)):
        assert (ln.Ephemeris.sampled(function, times)(3e6) == direct(3e6)).all()
    only = ln.Ephemeris.sampled(lambda t: around(t)[0], times)
    assert 0 < np.abs(only(3e6) - direct(3e6)).max() < 1.0
    again = pickle.loads(pickle.dumps(direct))
    assert (again(3e6) == direct(3e6)).all()
    assert (direct.start, direct.end) == (0.0, 95 * DAY)
    assert direct([[1e5, 2e5]]).shape == (1, 2, 6)
    assert direct(np.zeros(0)).shape == (0, 6)


@pytest.mark.parametrize("name", sorted(PLANET_MU))
def test_approximate_planets_move_as_they_say(name):
    """Velocity is the derivative of position, and nearly that of Kepler; equatorial is ecliptic turned."""
    time, h = np.array([-5e8, 0.0, 6.6e8]), 1000.0
    ends = [approximate_planet(name, time + k * h)[:, :3] for k in (-2, -1, 1, 2)]
    slope = (8 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12 * h)
    state = approximate_planet(name, time)
    np.testing.assert_allclose(state[:, 3:], slope, rtol=0, atol=1e-5)
    mu = ln.constants.SUN_MU + PLANET_MU[name]
    pull = -mu * state[:, :3] / np.linalg.norm(state[:, :3], axis=1, keepdims=True) ** 3
    bend = (approximate_planet(name, time + h)[:, 3:] - approximate_planet(name, time - h)[:, 3:]) / (2 * h)
    assert (np.linalg.norm(bend - pull, axis=1) < 3e-3 * np.linalg.norm(pull, axis=1)).all()
    turned = approximate_planet(name, time, axes="equatorial")
    np.testing.assert_allclose(np.linalg.norm(turned[:, :3], axis=1), np.linalg.norm(state[:, :3], axis=1))
    np.testing.assert_array_equal(turned[:, 0], state[:, 0])


def test_a_kernel_of_jpl():
    """Against another reading of the same kernel, where one is installed."""
    spk = pytest.importorskip("jplephem.spk", reason="jplephem is not installed")
    data = pytest.importorskip("skyfield_data", reason="no kernel: skyfield-data is not installed")
    from pathlib import Path

    file = Path(data.__file__).parent / "data" / "de421.bsp"
    times = (np.arange(0.0, 60.0, 4.0) + 7300.0) * DAY
    mars = ln.ephemeris.from_jpl(file, 4, times)
    with spk.SPK.open(str(file)) as kernel:
        assert (ln.ephemeris.from_jpl(kernel, 4, times)(times[3]) == mars(times[3])).all()
        date = 2451545.0 + (times[5] + 1e5) / DAY
        place = (kernel[0, 4].compute(date) - kernel[0, 10].compute(date)) * 1e3
        np.testing.assert_allclose(mars(times[5] + 1e5)[:3], place, rtol=0, atol=1.0)
        earth = ln.ephemeris.from_jpl(kernel, 399, times, center=4)
        place = kernel[0, 3].compute(date) + kernel[3, 399].compute(date) - kernel[0, 4].compute(date)
        np.testing.assert_allclose(earth(times[5] + 1e5)[:3], place * 1e3, rtol=0, atol=200.0)
        with pytest.raises(ln.InvalidInputError, match="target"):
            ln.ephemeris.from_jpl(kernel, 12345, times)
        with pytest.raises(ln.InvalidInputError, match="times"):
            ln.ephemeris.from_jpl(kernel, 4, times + 1e11)


def test_without_jplephem_the_way_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "jplephem.spk", None)
    with pytest.raises(ImportError, match=r"losnav\[jpl\]"):
        ln.ephemeris.from_jpl("de440s.bsp", 4, [0.0, 1.0])


P = np.ones((3, 3))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ln.Ephemeris([0.0], [[1.0, 2, 3]], [[0.0, 0, 0]]), "times: expected shape"),
        (lambda: ln.Ephemeris([0.0, 1, 2], P), "times: expected shape"),
        (lambda: ln.Ephemeris([0.0, 2, 1], P, P), "times: expected increasing"),
        (lambda: ln.Ephemeris([0.0, 1, 2], P[:2], P), "positions"),
        (lambda: ln.Ephemeris([0.0, 1, 2], P, P[:2]), "velocities"),
        (lambda: ln.Ephemeris([0.0, 1, np.nan], P, P), r"times\[2\]"),
        (lambda: ln.Ephemeris.sampled(lambda t: t, [0.0, 1, 2]), r"function\(times\)"),
        (
            lambda: ln.Ephemeris([0.0, 1, 2], P, P)(2.5),
            "time: expected epochs within .*, 0 to 2 s",
        ),
        (lambda: ln.Ephemeris([0.0, 1, 2], P, P)([0.5, -1.0]), "time: .* got -1 to 0.5 s"),
        (lambda: approximate_planet("pluto", 0.0), "name: expected one of mercury"),
        (lambda: approximate_planet("mars", 0.0, axes="lunar"), "axes: expected"),
        (lambda: approximate_planet("mars", np.inf), "time"),
        (
            lambda: approximate_planet("mars", [0.0, 2e9]),
            "time: expected epochs from 1800 to 2050, got years 2000",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ln.InvalidInputError, match=f"^{message}"):
        call()

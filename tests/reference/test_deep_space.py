"""Mars and Ceres as JPL has them: who knows only the Sun is wrong and says so; planets and aberration repair.

Directions as they are seen (light time and aberration) from JPL ephemerides; noise is ours, 5e-5 rad.
"""

from __future__ import annotations

import runpy

import numpy as np
import pytest

import losnav as ln
from losnav.constants import SUN_MU
from losnav.ephemeris import PLANET_MU, approximate_planet
from tests.conftest import REPOSITORY

RUNS, SIGMA, DAY = 20, 5e-5, 86400.0
PLANETS = ("mercury", "venus", "earth", "mars", "jupiter", "saturn", "uranus", "neptune")
# What a heliocentric state leaves of the barycentre's motion in aberration, rad.
FRAME = 1e-9


@pytest.fixture(scope="module")
def file(data_folder):
    path = data_folder / "deep_space.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


def recorded(file, body):
    """Times past J2000, states in m and m/s, directions geometric and as seen."""
    return (
        file[f"{body}_t"],
        1e3 * file[f"{body}_rv"],
        file[f"{body}_sun_los"],
        file[f"{body}_sun_los_apparent"],
    )


def pulls(names, times):
    span = np.arange(times[0] - 4 * DAY, times[-1] + 8 * DAY, 2 * DAY)
    return [
        ln.dynamics.ThirdBody(
            PLANET_MU[name],
            ln.Ephemeris.sampled(lambda t, name=name: approximate_planet(name, t, axes="equatorial"), span),
        )
        for name in names
    ]


def followed(file, body, planets=(), aberration=True):
    """Filters on the directions as seen, each with noise and a first guess of its own."""
    times, truth, _, seen = recorded(file, body)
    rng = np.random.default_rng(0)
    noise = SIGMA * rng.standard_normal((RUNS, *seen.shape))
    z = seen + noise - np.einsum("rti,ti->rt", noise, seen)[..., np.newaxis] * seen
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    model = ln.dynamics.TwoBody(SUN_MU + PLANET_MU.get(body, 0.0), third_bodies=pulls(planets, times))
    guess = np.array([1e8] * 3 + [50.0] * 3)
    first = truth[0] + rng.standard_normal((RUNS, 6)) * guess
    ekf = ln.ExtendedKalmanFilter(model, first, np.diag(guess**2), iterations=3, time=float(times[0]))
    log = ekf.run(times[1:], [(ln.sensors.SunDirection(SIGMA, aberration=aberration), z[:, 1:])])
    error = np.linalg.norm((log.state - truth[1:])[:, -1, :3], axis=1).mean()
    return error, ln.consistency.nees(log, truth[1:]), ln.consistency.nis(log)


@pytest.mark.parametrize("body", ["mars", "ceres"])
def test_directions_are_jpls(file, body):
    _, states, geometric, seen = recorded(file, body)
    sun = ln.sensors.SunDirection(SIGMA)
    np.testing.assert_allclose(sun.predict(states), geometric, rtol=0, atol=1e-15)
    apparent = ln.sensors.SunDirection(SIGMA, aberration=True).predict(states)
    assert np.abs(seen - geometric).max() > 4e-5
    np.testing.assert_allclose(apparent, seen, rtol=0, atol=FRAME)


def test_approximate_planets_are_approximate(file):
    """Mars within the 40 arcsec and 25 000 km its elements are good for, or nearly."""
    times, truth, *_ = recorded(file, "mars")
    error = np.linalg.norm((approximate_planet("mars", times, axes="equatorial") - truth)[:, :3], axis=1)
    assert 1e7 < error.max() < 5e7


def test_mars_with_the_sun_alone_is_inconsistent_and_says_so(file):
    error, nees, nis = followed(file, "mars")
    assert error > 1.5e7
    assert nees.mean > 5000
    assert "OPTIMISTIC" in nees.summary()
    # Even the innovations notice, which needs no truth.
    assert not nis.consistent
    assert "OPTIMISTIC" in nis.summary()


def test_jupiter_satisfies_the_innovations_only(file):
    error, nees, nis = followed(file, "mars", ("jupiter",))
    assert nis.consistent, nis.summary()
    assert nees.average[-1] > 50
    assert error < 5e6


def test_all_planets_repair_mars(file):
    """Mean elements are enough as a pull: 1100 km, as its covariance says, after two years."""
    error, nees, nis = followed(file, "mars", [name for name in PLANETS if name != "mars"])
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()
    assert error < 1.3e6


def test_mars_without_aberration_is_wrong_unnoticed(file):
    error, nees, nis = followed(file, "mars", [name for name in PLANETS if name != "mars"], aberration=False)
    assert error > 1.5e7
    assert nees.mean > 500
    assert "OPTIMISTIC" in nees.summary()
    assert nis.consistent, nis.summary()


def test_the_example_reads_a_file_of_ones_own(file, tmp_path, capsys):
    rows = np.column_stack([file["mars_t"], file["mars_rv"]])[::2]
    np.savetxt(tmp_path / "mars.csv", rows, delimiter=",", header="t,x,y,z,vx,vy,vz", comments="")
    example = runpy.run_path(str(REPOSITORY / "examples" / "own_ephemeris.py"))
    example["main"](str(tmp_path / "mars.csv"), None)
    verdicts = capsys.readouterr().out.splitlines()[-3:]
    assert [line.count("optimistic") for line in verdicts] == [2, 1, 0]


def test_ceres_in_three_months(file):
    """Too short for planets to show, not for aberration: errors six times what the covariance says."""
    _, nees, nis = followed(file, "ceres", PLANETS)
    assert nees.consistent, nees.summary()
    assert nis.consistent, nis.summary()
    _, alone, _ = followed(file, "ceres")
    assert alone.consistent, alone.summary()
    _, blind, unnoticed = followed(file, "ceres", PLANETS, aberration=False)
    assert blind.mean > 100
    assert "OPTIMISTIC" in blind.summary()
    assert unnoticed.consistent, unnoticed.summary()

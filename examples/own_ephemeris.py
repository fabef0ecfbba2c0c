"""Navigate a recorded body by the Sun alone, with the models one may have, and see which can be trusted.

    python examples/own_ephemeris.py FILE.csv [KERNEL.bsp]

FILE.csv has a header line and the columns ``t, x, y, z, vx, vy, vz``: seconds past J2000 (TDB), km and km/s
from the Sun along the axes of the ICRF: what JPL Horizons writes as vectors, for an asteroid, a planet or a
spacecraft that coasts. Directions to the Sun as the body sees them are simulated, every epoch, with 5e-5 rad
of noise. With a JPL kernel (and ``pip install losnav[jpl]``) the planets that pull are taken from it, without
one from mean elements. The table has, for each model, what the filter says of itself (NIS) and what the file
says of it (NEES).
"""

import sys

import numpy as np

import losnav as ln
from losnav.constants import SUN_MU
from losnav.ephemeris import PLANET_MU, approximate_planet, from_jpl
from losnav.scenarios import Table

DAY, SIGMA, RUNS = 86400.0, 5e-5, 20
# NAIF numbers of the planets with their moons.
NUMBERS = {name: k + 1 for k, name in enumerate(PLANET_MU)}


def planets(times, kernel):
    """All that pull; what is the recorded body itself is left out by its distance."""
    span = np.arange(times[0] - 4 * DAY, times[-1] + 8 * DAY, 2 * DAY)
    for name, mu in PLANET_MU.items():
        if kernel:
            path = from_jpl(kernel, NUMBERS[name], span)
        else:
            path = ln.Ephemeris.sampled(lambda t, name=name: approximate_planet(name, t, "equatorial"), span)
        yield name, ln.dynamics.ThirdBody(mu, path)


def main(file: str, kernel: str | None) -> None:
    table = np.loadtxt(file, delimiter=",", skiprows=1)
    times, truth = table[:, 0], 1e3 * table[:, 1:7]
    mu, pulling = SUN_MU, []
    for name, body in planets(times, kernel):
        distance = np.linalg.norm((body.ephemeris(times) - truth)[:, :3], axis=1).min()
        if distance < 1e9:  # a million kilometres: it is the planet
            mu += PLANET_MU[name]
        else:
            pulling.append(body)
    seen = ln.sensors.SunDirection(SIGMA, aberration=True)
    rng = np.random.default_rng(1)
    z = seen.simulate(np.broadcast_to(truth, (RUNS, *truth.shape)), rng)
    guess = np.array([1e8] * 3 + [50.0] * 3)
    first = truth[0] + guess * rng.standard_normal((RUNS, 6))
    rows = []
    for what, bodies, aberration in (
        ("the Sun alone", [], True),
        ("all planets, aberration forgotten", pulling, False),
        ("all planets and aberration", pulling, True),
    ):
        model = ln.dynamics.TwoBody(mu, third_bodies=bodies)
        ekf = ln.ExtendedKalmanFilter(model, first, np.diag(guess**2), iterations=3, time=times[0])
        log = ekf.run(times[1:], [(ln.sensors.SunDirection(SIGMA, aberration=aberration), z[:, 1:])])
        nis, nees = ln.consistency.nis(log), ln.consistency.nees(log, truth[1:])
        error = np.linalg.norm((log.state - truth[1:])[:, -1, :3], axis=1).mean() / 1e3
        verdicts = [f"{test.mean:.4g} {test.verdict}" for test in (nis, nees)]
        rows.append((what, *verdicts, f"{error:.0f} km"))
    columns = ("model", "NIS (2)", "NEES (6)", "error at the end")
    print(Table("Where is it, by the Sun alone?", columns, tuple(rows)))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None)

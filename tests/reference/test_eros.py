"""Polyhedral gravity of Eros against another program: accelerations, and four hours of flight.

Conventions: metres, body-fixed axes with z along the spin axis, velocity as seen in these turning axes: those
of losnav, the site frame being here the body-fixed frame itself.
"""

import numpy as np
import pytest

import losnav as ln
from losnav.gravity import eros

# Two codes of the same formula in double precision, two radii out where half of the digits in front cancel.
ACCELERATION = 1e-9
# Four hours of an orbit at 5 m/s in steps of 20 s; 2e-8 m in steps of 5 s.
TRAJECTORY_METRES = 1e-5


@pytest.fixture(scope="module")
def data(data_folder):
    with np.load(data_folder / "eros.npz") as file:
        return dict(file)


@pytest.fixture(scope="module")
def body(data):
    return ln.gravity.Polyhedron.of_mass(data["vertices"], data["faces"], float(data["mu"]))


def off(found, expected):
    return np.linalg.norm(found - expected, axis=-1) / np.linalg.norm(expected, axis=-1)


def test_acceleration(data, body):
    assert off(body.acceleration(data["check_r"]), data["check_acc"]).max() < ACCELERATION


def test_the_body(body):
    """Volume and density as published for Eros: 2518-2526 km^3 of the fine shape, 2.65-2.69 g/cm^3."""
    assert 2.48e12 < body.volume < 2.53e12
    assert 2640.0 < body.density < 2700.0
    assert 17.5e3 < body.brillouin_radius < 17.8e3


def test_trajectory(data, body):
    """Free flight in turning axes: Strapdown without specific force, body axes held in inertial space."""
    still = ln.dynamics.Imu(0.0, 0.0)
    model = ln.dynamics.Strapdown(ln.dynamics.Site(np.eye(3), np.zeros(3), data["omega"]), body, still)
    start = ln.NavState(data["r_body"][0], data["v_body_rot"][0], [0.0, 0.0, 0.0, 1.0])
    path = model.trajectory(start, data["t"], longest_step=20.0)
    assert np.linalg.norm(path.position - data["r_body"], axis=-1).max() < TRAJECTORY_METRES
    assert np.linalg.norm(path.velocity - data["v_body_rot"], axis=-1).max() < 1e-8
    energy = model.jacobi_integral(path)
    assert np.ptp(energy) < 1e-9 * abs(energy[0])


def test_the_series_outside_the_sphere(data, body):
    """Degree 12 of the body's own harmonics is the body to 1e-5 on the trajectory, two radii out."""
    series = body.harmonics(12)
    assert off(series.acceleration(data["r_body"]), body.acceleration(data["r_body"])).max() < 1e-5


def test_the_shape_has_the_measured_field(body):
    """The degree-2 and degree-4 coefficients of constant density are the measured ones to a few per cent."""
    own, measured = body.harmonics(4, radius=eros.RADIUS), eros.near15a(4)
    for n, m, tolerance in [(2, 0, 0.03), (2, 2, 0.03), (4, 0, 0.05), (4, 2, 0.05), (4, 4, 0.05)]:
        assert own.c[n, m] == pytest.approx(measured.c[n, m], rel=tolerance), (n, m)


def surface(body, direction):
    """Where a ray from the centre leaves the body for the last time."""
    unit = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    ranges = np.linspace(1.0, 18e3, 4001)
    inside = body.contains(ranges[:, np.newaxis] * unit)
    low, high = ranges[np.flatnonzero(inside)[-1] :][:2]
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if body.contains(middle * unit) else (low, middle)
    return low * unit


def test_do_not_land_on_harmonics(body):
    """20 m above the surface degree 4 is wrong by tens of per cent at the tips, by multiples at the waist."""
    wrong = {}
    for name, direction in {
        "+x tip": [1.0, 0.0, 0.0],
        "-x tip": [-1.0, 0.0, 0.0],
        "waist +y": [0.0, 1.0, 0.0],
        "waist -y": [0.0, -1.0, 0.0],
    }.items():
        place = surface(body, direction)
        place = place + 20.0 * place / np.linalg.norm(place)
        with pytest.warns(ln.gravity.BrillouinWarning):
            believed = body.harmonics(4).acceleration(place)
        wrong[name] = float(off(believed, body.acceleration(place)))
    assert 0.05 < wrong["+x tip"] < 0.5, wrong
    assert 0.05 < wrong["-x tip"] < 0.6, wrong
    assert min(wrong["waist +y"], wrong["waist -y"]) > 3.0, wrong

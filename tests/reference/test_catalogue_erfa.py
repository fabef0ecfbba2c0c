"""Aberration and stellar motion against ERFA, the free twin of the IAU's SOFA, and against its printed cases.

| losnav                                     | ERFA                                             |
|--------------------------------------------|--------------------------------------------------|
| aberrate(u, v in m/s)                      | ab(u, v / c, distance of the Sun, sqrt(1-v^2/c^2)) |
| pmra rad/s, times cos(dec)                 | pr rad/yr, not times cos(dec)                    |
| parallax rad, radial_velocity m/s, dt s    | px arcsec, rv km/s, pmt Julian years             |
| observer m                                 | pob au                                           |

ERFA's ``ab`` adds the Sun's potential, 0.4 microarcseconds at 1 au; far from the Sun it is special relativity
alone.
"""

import numpy as np
import pytest

import losnav as ln
from losnav.constants import AU, JULIAN_YEAR, SPEED_OF_LIGHT
from tests.oracle import star_tracker as oracle

ARCSEC = oracle.ARCSEC
# Rounding of a formula of some ten operations on unit vectors, rad.
SAME = 1e-15
# pmpx takes the light time across the orbit in a rounded constant, and km/s over au/yr likewise.
SAME_MOTION = 1e-13
# The Sun's potential in erfa.ab at 1 au: 2e-8 of the aberration.
POTENTIAL = 4e-12


def test_constants_are_erfas():
    erfa = pytest.importorskip("erfa", reason="pyerfa is not installed")
    assert (SPEED_OF_LIGHT, AU, JULIAN_YEAR) == (erfa.CMPS, erfa.DAU, erfa.DJY * erfa.DAYSEC)


def test_printed_case_of_aberration():
    """SOFA's own test of iauAb (t_sofa_c.c)."""
    u = np.array([-0.76321968546737951, -0.60869453983060384, -0.21676408580639883])
    v = SPEED_OF_LIGHT * np.array([2.1044018893653786e-5, -8.9108923304429319e-5, -3.8633714797716569e-5])
    printed = [-0.7631631094219556269, -0.6087553082505590832, -0.2167926269368471279]
    assert np.abs(ln.star_tracker.aberrate(u / np.linalg.norm(u), v) - printed).max() < POTENTIAL


def test_printed_case_of_motion():
    """SOFA's own test of iauPmpx (t_sofa_c.c)."""
    ra, dec = 1.234, 0.789
    seen = ln.star_tracker.catalogue_directions(
        ra,
        dec,
        pmra=1e-5 * np.cos(dec) / JULIAN_YEAR,
        pmdec=-2e-5 / JULIAN_YEAR,
        parallax=1e-2 * ARCSEC,
        radial_velocity=10e3,
        dt=8.75 * JULIAN_YEAR,
        observer=AU * np.array([0.9, 0.4, 0.1]),
    )
    printed = [0.2328137623960308438, 0.6651097085397855328, 0.7095257765896359837]
    assert np.abs(seen - printed).max() < 1e-12


def test_aberration_is_erfas(rng):
    erfa = pytest.importorskip("erfa", reason="pyerfa is not installed")
    u = rng.standard_normal((500, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = rng.standard_normal((500, 3)) * 10 ** rng.uniform(-6, -1, (500, 1)) / 3
    expected = erfa.ab(u, v, np.full(500, 1e30), np.sqrt(1 - (v**2).sum(axis=1)))
    assert np.abs(ln.star_tracker.aberrate(u, v * SPEED_OF_LIGHT) - expected).max() < SAME


def test_motion_is_erfas(rng):
    """Stars from still to faster than any known, with parallax, observers anywhere within 2 au."""
    erfa = pytest.importorskip("erfa", reason="pyerfa is not installed")
    n = 500
    ra, dec = rng.uniform(0, 2 * np.pi, n), np.arcsin(rng.uniform(-0.999, 0.999, n))
    pmra, pmdec = ARCSEC * rng.uniform(-12, 12, (2, n))
    parallax, speed = rng.uniform(0, 0.8, n), rng.uniform(-300, 300, n)
    years, place = rng.uniform(-50, 50, n), rng.uniform(-2, 2, (n, 3))
    expected = np.array(
        [
            erfa.pmpx(
                ra[i], dec[i], pmra[i] / np.cos(dec[i]), pmdec[i], parallax[i], speed[i], years[i], place[i]
            )
            for i in range(n)
        ]
    )
    seen = ln.star_tracker.catalogue_directions(
        ra,
        dec,
        pmra=pmra / JULIAN_YEAR,
        pmdec=pmdec / JULIAN_YEAR,
        parallax=parallax * ARCSEC,
        radial_velocity=speed * 1e3,
        dt=years * JULIAN_YEAR,
        observer=place * AU,
    )
    assert np.abs(seen - expected).max() < SAME_MOTION


def test_parity_with_a_boosted_photon(rng):
    """The oracle boosts a photon's momentum with a 4 x 4 Lorentz matrix."""
    for _ in range(200):
        u = rng.standard_normal(3)
        u /= np.linalg.norm(u)
        v = SPEED_OF_LIGHT * 10 ** rng.uniform(-6, -0.3) * oracle.turned(rng.standard_normal(3))[:, 2]
        seen = ln.star_tracker.aberrate(u, v)
        assert np.abs(seen - oracle.aberrated(u, v)).max() < 1e-14
        assert np.abs(ln.star_tracker.remove_aberration(seen, v) - u).max() < 1e-13


def test_size_of_the_effect():
    """Leaving aberration out turns the attitude by 20.5" across the velocity, on or off."""
    rng = np.random.default_rng(2)
    stars = oracle.square_field(rng, 30, np.radians(20))
    earth = np.array([29_784.7, 0.0, 0.0])
    seen = ln.star_tracker.aberrate(stars, earth)
    off = oracle.svd_attitude([np.eye(3)], [seen], [stars], [1.0])
    corrected = oracle.svd_attitude([np.eye(3)], [seen], [ln.star_tracker.aberrate(stars, earth)], [1.0])
    turn = np.linalg.norm(ln.attitude.rotation_error(np.eye(3), off)) / ARCSEC
    assert turn == pytest.approx(20.4, abs=0.3)
    assert np.linalg.norm(ln.attitude.rotation_error(np.eye(3), corrected)) < 1e-13


def test_parallax_of_a_star_one_parsec_away():
    """One arcsecond across an observer's displacement of 1 au, against it."""
    seen = ln.star_tracker.catalogue_directions(0.0, 0.0, parallax=ARCSEC, observer=[0.0, AU, 0.0])
    assert seen[1] / ARCSEC == pytest.approx(-1, abs=1e-9)


def test_catalogue_covariance_is_the_spread_of_catalogues(rng):
    """Catalogue entries drawn from a Gaia-like covariance, moved to the date one by one."""
    mas, year = ARCSEC / 1000, JULIAN_YEAR
    deviation = np.array([0.3, 0.2, 0.5, 0.05 / year, 0.04 / year]) * mas
    root = np.linalg.qr(rng.standard_normal((5, 5)))[0] @ np.diag(rng.uniform(0.5, 1, 5))
    covariance = deviation[:, None] * (root @ root.T) * deviation
    ra, dec, dt = 1.1, 0.7, 12 * year
    place = AU * np.array([0.6, -0.7, 0.3])
    runs = 20_000
    draws = rng.multivariate_normal(np.zeros(5), covariance * 1e20, runs, check_valid="raise") * 1e-10
    moved = ln.star_tracker.catalogue_directions(
        ra + draws[:, 0] / np.cos(dec),
        dec + draws[:, 1],
        pmra=draws[:, 3],
        pmdec=draws[:, 4],
        parallax=100 * mas + draws[:, 2],
        dt=dt,
        observer=place,
    )
    mean = ln.star_tracker.catalogue_directions(ra, dec, parallax=100 * mas, dt=dt, observer=place)
    predicted = ln.star_tracker.catalogue_covariance(ra, dec, covariance, dt=dt, observer=place)
    basis = oracle.turned(mean)[:, :2]
    across = (moved - mean) @ basis
    white = across @ np.linalg.inv(np.linalg.cholesky(basis.T @ predicted @ basis)).T
    # Entries scatter by sqrt(2 / runs) = 1 % on the diagonal, 0.7 % off it; four of them at 4.5 sigma.
    assert np.abs(white.T @ white / runs - np.eye(2)).max() < 4.5 * np.sqrt(2 / runs)

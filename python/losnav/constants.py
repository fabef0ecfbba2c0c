"""Constants of nature, SI, each with its source."""

__all__ = [
    "AU",
    "EARTH_J2",
    "EARTH_MU",
    "EARTH_RADIUS",
    "GRAVITATIONAL_CONSTANT",
    "JULIAN_YEAR",
    "SPEED_OF_LIGHT",
    "SUN_MU",
]

#: Gravitational parameter of the Earth with its atmosphere, m^3/s^2 (IERS Conventions 2010, table 1.1).
EARTH_MU = 3.986004418e14
#: Flattening of the Earth's gravity field (EGM96, tide free, 1.082626683e-3, rounded).
EARTH_J2 = 1.08262668e-3
#: Equatorial radius of the Earth, m (WGS 84).
EARTH_RADIUS = 6378137.0
#: Gravitational parameter of the Sun, m^3/s^2 (JPL DE405).
SUN_MU = 1.32712440018e20
#: Astronomical unit, m, exact (IAU 2012 resolution B2).
AU = 149597870700.0
#: Julian year, s, exact: 365.25 days of 86400 s; epochs of star catalogues (J2000.0, J2016.0) count in it.
JULIAN_YEAR = 31557600.0
#: Speed of light in vacuum, m/s, exact (SI, definition of the metre).
SPEED_OF_LIGHT = 299792458.0
#: Newton's constant, m^3/kg/s^2 (CODATA 2018, 6.67430(15)e-11).
GRAVITATIONAL_CONSTANT = 6.6743e-11

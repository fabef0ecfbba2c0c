"""The planets from mean elements."""

from __future__ import annotations

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite
from losnav.constants import AU
from losnav.errors import InvalidInputError

#: Gravitational parameters of the planets with their moons, m^3/s^2 (JPL DE440; Park et al., AJ 161:105,
#: 2021). "earth" is that of the Earth and the Moon together: for their barycentre.
PLANET_MU = {
    "mercury": 2.2031868551e13,
    "venus": 3.24858592e14,
    "earth": 4.035032356e14,
    "mars": 4.2828375816e13,
    "jupiter": 1.267127641e17,
    "saturn": 3.79405848418e16,
    "uranus": 5.794556400e15,
    "neptune": 6.836527101e15,
}

# Semi-major axis (au), eccentricity, inclination, mean longitude, longitude of perihelion, longitude of the
# node (deg), each followed by its rate per Julian century: E. M. Standish, "Keplerian elements for
# approximate positions of the major planets", JPL, table 1 (1800 to 2050), mean ecliptic and equinox J2000.
_ELEMENTS = {
    "mercury": (
        (0.38709927, 0.20563593, 7.00497902, 252.25032350, 77.45779628, 48.33076593),
        (0.00000037, 0.00001906, -0.00594749, 149472.67411175, 0.16047689, -0.12534081),
    ),
    "venus": (
        (0.72333566, 0.00677672, 3.39467605, 181.97909950, 131.60246718, 76.67984255),
        (0.00000390, -0.00004107, -0.00078890, 58517.81538729, 0.00268329, -0.27769418),
    ),
    "earth": (
        (1.00000261, 0.01671123, -0.00001531, 100.46457166, 102.93768193, 0.0),
        (0.00000562, -0.00004392, -0.01294668, 35999.37244981, 0.32327364, 0.0),
    ),
    "mars": (
        (1.52371034, 0.09339410, 1.84969142, -4.55343205, -23.94362959, 49.55953891),
        (0.00001847, 0.00007882, -0.00813131, 19140.30268499, 0.44441088, -0.29257343),
    ),
    "jupiter": (
        (5.20288700, 0.04838624, 1.30439695, 34.39644051, 14.72847983, 100.47390909),
        (-0.00011607, -0.00013253, -0.00183714, 3034.74612775, 0.21252668, 0.20469106),
    ),
    "saturn": (
        (9.53667594, 0.05386179, 2.48599187, 49.95424423, 92.59887831, 113.66242448),
        (-0.00125060, -0.00050991, 0.00193609, 1222.49362201, -0.41897216, -0.28867794),
    ),
    "uranus": (
        (19.18916464, 0.04725744, 0.77263783, 313.23810451, 170.95427630, 74.01692503),
        (-0.00196176, -0.00004397, -0.00242939, 428.48202785, 0.40805281, 0.04240589),
    ),
    "neptune": (
        (30.06992276, 0.00859048, 1.77004347, -55.12002969, 44.96476227, 131.78422574),
        (0.00026291, 0.00005105, 0.00035372, 218.45945325, -0.32241464, -0.00508664),
    ),
}

# Obliquity of the ecliptic at J2000, rad: 84381.448 arcsec (IAU 1976), what the elements refer to.
_OBLIQUITY = np.deg2rad(84381.448 / 3600.0)
_CENTURY = 36525.0 * 86400.0


def approximate_planet(name: str, time: ArrayLike, axes: str = "ecliptic") -> FloatArray:
    """Heliocentric state of a planet from mean elements: good enough to pull a spacecraft, or to plan.

    Errors over 1800 to 2050 as its author gives them: Mercury to Mars 15 to 40 arcsec, Jupiter 400, Saturn
    600, Uranus 50, Neptune 10: 6000 km for the Earth, up to 1.5e6 km for Saturn. As the pull of a third body
    that is half a percent of it, as a direction to navigate by it is useless: take a kernel
    (:func:`from_jpl`) or a table for :class:`losnav.sensors.BodyDirection`.

    Parameters
    ----------
    name : str
        "mercury", "venus", "earth" (with its moon), "mars", "jupiter", "saturn", "uranus", "neptune".
    time : scalar or (...)
        Seconds past J2000 (2000 January 1, 12:00 TDB); 1800 to 2050.
    axes : {"ecliptic", "equatorial"}
        Ecliptic and equinox of J2000, or its equator: those of the ICRF within 0.02 arcsec.

    Returns
    -------
    (..., 6)
        ``[r v]``, m and m/s; the velocity is the derivative of the position.

    Raises
    ------
    InvalidInputError
        On an unknown name or axes, NaN, infinity or another time.

    Notes
    -----
    E. M. Standish, "Keplerian elements for approximate positions of the major planets", JPL, table 1.

    Examples
    --------
    >>> import losnav as ln
    >>> jupiter = ln.ephemeris.approximate_planet("jupiter", 0.0)
    >>> (jupiter[:3] / ln.constants.AU).round(3).tolist()
    [3.998, 2.946, -0.102]
    """
    if name not in _ELEMENTS:
        raise InvalidInputError(f"name: expected one of {', '.join(_ELEMENTS)}, got {name!r}")
    if axes not in ("ecliptic", "equatorial"):
        raise InvalidInputError(f'axes: expected "ecliptic" or "equatorial", got {axes!r}')
    t = finite(time, "time")[..., np.newaxis] / _CENTURY
    if t.size and (t.min() < -2.0 or t.max() > 0.5):
        years = [f"{2000 + 100 * float(end):.4g}" for end in (t.min(), t.max())]
        raise InvalidInputError(f"time: expected epochs from 1800 to 2050, got years {' to '.join(years)}")
    start, rate = (np.array(numbers) for numbers in _ELEMENTS[name])
    a, e, *angles = np.moveaxis(start + rate * t, -1, 0)
    a_rate, e_rate, *angle_rates = rate / _CENTURY
    i, longitude, perihelion, node = np.deg2rad(angles)
    i_rate, longitude_rate, perihelion_rate, node_rate = np.deg2rad(angle_rates)
    mean = np.remainder(longitude - perihelion + np.pi, 2 * np.pi) - np.pi
    # Newton from the mean anomaly; e is at most 0.21, six steps are to rounding.
    anomaly = mean + e * np.sin(mean)
    for _ in range(6):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    c, s, flat = np.cos(anomaly), np.sin(anomaly), np.sqrt(1 - e**2)
    turn = (longitude_rate - perihelion_rate + s * e_rate) / (1 - e * c)
    # In the plane of the orbit, along and across its axis; then what the elements do to it.
    x, y = c - e, flat * s
    along = AU * (a * (-s * turn - e_rate) + a_rate * x)
    across = AU * (a * (flat * c * turn - e * e_rate / flat * s) + a_rate * y)
    p, q = (_turned(perihelion - node + quarter, node, i) for quarter in (0.0, np.pi / 2))
    position = (AU * a * x)[..., np.newaxis] * p + (AU * a * y)[..., np.newaxis] * q
    spin = (perihelion_rate - node_rate) * np.cross(p, q) + [0.0, 0.0, node_rate]
    spin = spin + i_rate * _turned(np.zeros_like(node), node, i)
    velocity = along[..., np.newaxis] * p + across[..., np.newaxis] * q + np.cross(spin, position)
    if axes == "equatorial":
        k, m = np.cos(_OBLIQUITY), np.sin(_OBLIQUITY)
        equatorial_from_ecliptic = np.array([[1.0, 0.0, 0.0], [0.0, k, -m], [0.0, m, k]])
        position, velocity = position @ equatorial_from_ecliptic.T, velocity @ equatorial_from_ecliptic.T
    return np.concatenate([position, velocity], axis=-1)


def _turned(along: FloatArray, node: FloatArray, inclination: FloatArray) -> FloatArray:
    """Unit vector ``along`` past the node of an orbital plane."""
    c, s, n, m = np.cos(along), np.sin(along), np.cos(node), np.sin(node)
    k = np.cos(inclination)
    return np.stack([n * c - m * s * k, m * c + n * s * k, s * np.sin(inclination)], axis=-1)

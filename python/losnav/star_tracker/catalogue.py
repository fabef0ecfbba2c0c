"""From a catalogue to the directions an observer sees: proper motion, parallax, aberration.

    b(t)  = u0 + (t + r'u0 / c) (p mu_ra* + q mu_dec + u0 v_r plx / AU) - plx r / AU                  (T10)
    u(t)  = b / |b|                                                     astrometric direction
    u'    = [ u / g + (1 + g/(1 + g) v'u / c) v / c ] / (1 + v'u / c),   g = 1/sqrt(1 - v'v/c^2)      (T11)

``p``, ``q`` east and north at the star, ``r`` and ``v`` position and velocity of the observer relative to the
solar system's barycentre. ``r'u0 / c`` is the light's time of travel across the orbit.

Sizes: aberration 20.5" for the Earth's 30 km/s and up to 5" more in low orbit; proper motion up to 10.4" per
year (Barnard's star), above 0.1" per year for most stars within 20 pc; parallax 0.77" at most. A tracker that
claims arcseconds must remove the first and update the second.

Sources: Hipparcos and Tycho Catalogues (ESA SP-1200, 1997), vol. 1, section 1.5.5; Klioner, Astron. J. 125
(2003), for the order of corrections. Leaves out: light deflection by the Sun (0.004" at 90 degrees from it,
1.75" at its limb), orbits of double stars, the light time of a star's own motion.
"""

from __future__ import annotations

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, broadcast, finite, in_range, units, vectors
from losnav._arrays import covariances as checked_covariances
from losnav.constants import AU, SPEED_OF_LIGHT
from losnav.errors import InvalidInputError
from losnav.star_tracker.covariance import symmetric

__all__ = [
    "aberrate",
    "catalogue_covariance",
    "catalogue_directions",
    "remove_aberration",
]


def aberrate(directions: ArrayLike, velocity: ArrayLike) -> FloatArray:
    """Apparent directions for a moving observer: relativistic stellar aberration (T11).

    Parameters
    ----------
    directions : (..., 3)
        Unit vectors to the stars in the rest frame of the solar system's barycentre.
    velocity : (..., 3)
        Of the observer in that frame, m/s: Earth's orbital plus the spacecraft's own.

    Returns
    -------
    (..., 3)
        Unit vectors in axes of the same orientation, moved towards the velocity.

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, a velocity not below that of light, or shapes that do not broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> seen = ln.star_tracker.aberrate([0.0, 0.0, 1.0], [29_780.0, 0.0, 0.0])
    >>> round(float(np.degrees(seen[0]) * 3600), 2)                                # arcsec
    20.49
    """
    u = units(directions, "directions")
    u = u / np.linalg.norm(u, axis=-1, keepdims=True)
    beta = vectors(velocity, "velocity") / SPEED_OF_LIGHT
    # Squares of what is refused anyway may overflow.
    square = (np.minimum(np.abs(beta), 2.0) ** 2).sum(axis=-1, keepdims=True)
    if not (square < 1.0).all():
        raise InvalidInputError("velocity: expected a speed below that of light, in m/s")
    try:
        along = (u * beta).sum(axis=-1, keepdims=True)
    except ValueError as error:
        raise InvalidInputError(
            f"directions, velocity: leading dimensions {u.shape[:-1]} and {beta.shape[:-1]} do not broadcast"
        ) from error
    slow = np.sqrt(1.0 - square)
    seen = (slow * u + (1.0 + along / (1.0 + slow)) * beta) / (1.0 + along)
    return np.asarray(seen / np.linalg.norm(seen, axis=-1, keepdims=True))


def remove_aberration(directions: ArrayLike, velocity: ArrayLike) -> FloatArray:
    """Directions at rest from apparent ones: the exact inverse of :func:`aberrate`.

    Parameters
    ----------
    directions : (..., 3)
        Apparent unit vectors, in axes that do not rotate with the observer.
    velocity : (..., 3)
        Of the observer, m/s, in the same axes.

    Returns
    -------
    (..., 3)
        Unit vectors.

    Raises
    ------
    InvalidInputError
        As :func:`aberrate`.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> velocity = [12_000.0, 25_000.0, 9_000.0]
    >>> seen = ln.star_tracker.aberrate([0.6, 0.0, 0.8], velocity)
    >>> bool(np.abs(ln.star_tracker.remove_aberration(seen, velocity) - [0.6, 0.0, 0.8]).max() < 1e-15)
    True
    """
    return aberrate(directions, -vectors(velocity, "velocity"))


def catalogue_directions(
    ra: ArrayLike,
    dec: ArrayLike,
    *,
    pmra: ArrayLike = 0.0,
    pmdec: ArrayLike = 0.0,
    parallax: ArrayLike = 0.0,
    radial_velocity: ArrayLike = 0.0,
    dt: ArrayLike = 0.0,
    observer: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
) -> FloatArray:
    """Directions of catalogue stars at a date, seen by an observer who moves (T10, T11).

    Parameters
    ----------
    ra, dec : (...)
        Right ascension and declination at the catalogue's epoch, rad.
    pmra, pmdec : (...)
        Proper motion, rad/s; ``pmra`` is ``d(ra)/dt cos(dec)``, as catalogues print it.
    parallax : (...)
        Annual parallax, rad.
    radial_velocity : (...)
        Away from the Sun, m/s; matters only for near, fast stars.
    dt : (...)
        Date less epoch, s (barycentric dynamical time); years times ``losnav.constants.JULIAN_YEAR``.
    observer : (..., 3), optional
        Position relative to the barycentre, m, equatorial axes; without it no parallax.
    velocity : (..., 3), optional
        Of the observer relative to the barycentre, m/s; without it no aberration.

    Returns
    -------
    (..., 3)
        Unit vectors in equatorial axes (ICRS).

    Raises
    ------
    InvalidInputError
        On values that are not finite, a negative parallax, or shapes that do not broadcast.

    Examples
    --------
    Barnard's star (Gaia DR3), sixteen years after J2016.0:

    >>> import numpy as np
    >>> import losnav as ln
    >>> mas = np.radians(1 / 3.6e6)
    >>> per_year = mas / ln.constants.JULIAN_YEAR
    >>> position = np.radians([269.44850252543836, 4.739420051112412])
    >>> motion = {"pmra": -801.551 * per_year, "pmdec": 10362.394 * per_year, "parallax": 546.976 * mas}
    >>> then = ln.star_tracker.catalogue_directions(*position)
    >>> now = ln.star_tracker.catalogue_directions(*position, **motion, dt=16 * ln.constants.JULIAN_YEAR)
    >>> round(float(np.arcsin(np.linalg.norm(np.cross(then, now))) / mas / 1000), 1)          # arcsec
    166.3
    """
    east, north, outward, motion, distance, time = _linear_motion(
        ra, dec, pmra, pmdec, parallax, radial_velocity, dt
    )
    moved = outward
    with np.errstate(over="ignore", invalid="ignore"):
        rate = east * motion[0] + north * motion[1] + outward * motion[2]
        if observer is not None:
            place = vectors(observer, "observer")
            _fits(place, "observer", moved)
            time = time + (place * moved).sum(axis=-1, keepdims=True) / SPEED_OF_LIGHT
            moved = moved - distance * place / AU
        moved = moved + time * rate
        directions = moved / np.linalg.norm(moved, axis=-1, keepdims=True)
    in_range(directions, "motion, dt, observer")
    return np.asarray(directions) if velocity is None else aberrate(directions, velocity)


def catalogue_covariance(
    ra: ArrayLike,
    dec: ArrayLike,
    covariance: ArrayLike,
    *,
    dt: ArrayLike = 0.0,
    observer: ArrayLike | None = None,
) -> FloatArray:
    """Covariance of a catalogue direction at a date from the catalogue's own.

    To first order in the motion: what is left out is the product of the error with the angle moved since the
    epoch, 1e-3 of the error for Barnard's star after 20 years.

    Parameters
    ----------
    ra, dec : (...)
        At the epoch, rad.
    covariance : (..., 5, 5), (..., 4, 4) or (..., 2, 2)
        Of ``[ra cos(dec), dec, parallax, pmra, pmdec]`` as Gaia orders them, of the same without the
        parallax, or of the position alone; rad and rad/s.
    dt : (...)
        Date less epoch, s.
    observer : (..., 3), optional
        Position relative to the barycentre, m; for the parallax's share.

    Returns
    -------
    (..., 3, 3)
        Equatorial axes, rad^2, of rank 2; add it, turned into head axes, to the noise of the measurement.

    Raises
    ------
    InvalidInputError
        On a matrix that is no covariance or of another size, or shapes that do not broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> covariance = np.diag([0.02, 0.02, 0.001, 0.001]) ** 2           # any unit: here mas and mas/yr
    >>> then = ln.star_tracker.catalogue_covariance(0.0, 0.0, covariance, dt=30.0)
    >>> np.sqrt(then.diagonal()).round(4)
    array([0.    , 0.0361, 0.0361])
    """
    spread = finite(covariance, "covariance")
    size = spread.shape[-1] if spread.ndim >= 2 else 0
    if size not in (2, 4, 5):
        raise InvalidInputError(
            f"covariance: expected shape (..., 2, 2), (..., 4, 4) or (..., 5, 5), got {spread.shape}"
        )
    spread = checked_covariances(spread, "covariance", size)
    east, north, outward, _, _, time = _linear_motion(ra, dec, 0.0, 0.0, 0.0, 0.0, dt)
    columns = [east, north]
    if size == 5:
        place = np.zeros(3) if observer is None else vectors(observer, "observer")
        _fits(place, "observer", outward)
        across = place - (place * outward).sum(axis=-1, keepdims=True) * outward
        columns.append(-across / AU)
    if size >= 4:
        columns += [time * east, time * north]
    jacobian = np.stack(np.broadcast_arrays(*columns), axis=-1)
    shape, (j, c) = broadcast(("ra, dec, dt", jacobian, 2), ("covariance", spread, 2))
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        result = symmetric(j @ c @ np.swapaxes(j, -1, -2))
    in_range(result, "covariance, dt, observer")
    return np.asarray(result.reshape((*shape, 3, 3)))


def _linear_motion(
    ra: ArrayLike, dec: ArrayLike, *rest: ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray, list[FloatArray], FloatArray, FloatArray]:
    """East, north, outward ``(..., 3)``; rates along them, parallax and time ``(..., 1)``."""
    names = ("ra", "dec", "pmra", "pmdec", "parallax", "radial_velocity", "dt")
    arrays = [finite(value, name) for name, value in zip(names, (ra, dec, *rest), strict=True)]
    shape, flat = broadcast(*[(name, a, 0) for name, a in zip(names, arrays, strict=True)])
    a, d, east_rate, north_rate, parallax, outward_speed, time = [v.reshape(shape) for v in flat]
    if (parallax < 0.0).any():
        raise InvalidInputError("parallax: expected no negative value; set those of noise to zero")
    ca, sa, cd, sd = np.cos(a), np.sin(a), np.cos(d), np.sin(d)
    east = np.stack([-sa, ca, np.zeros_like(a)], axis=-1)
    north = np.stack([-sd * ca, -sd * sa, cd], axis=-1)
    outward = np.stack([cd * ca, cd * sa, sd], axis=-1)
    with np.errstate(over="ignore"):
        expansion = outward_speed * (parallax / AU)
    rates = [r[..., np.newaxis] for r in (east_rate, north_rate, expansion)]
    return east, north, outward, rates, parallax[..., np.newaxis], time[..., np.newaxis]


def _fits(place: FloatArray, name: str, other: FloatArray) -> None:
    """Refuse leading dimensions that do not broadcast."""
    try:
        np.broadcast_shapes(place.shape[:-1], other.shape[:-1])
    except ValueError as error:
        raise InvalidInputError(
            f"{name}: leading dimensions {place.shape[:-1]} and {other.shape[:-1]} do not broadcast"
        ) from error

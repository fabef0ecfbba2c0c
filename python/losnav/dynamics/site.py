"""Where one lands: the frame everything is navigated in, and how it turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, in_range, rotations, vectors
from losnav.errors import InvalidInputError


@dataclass(frozen=True, eq=False, init=False)
class Site:
    """Landing site on a rotating body, or a frame that does not turn.

    The site frame has its origin at the site, x East, y North, z Up, and is fixed to the body: it turns with
    it. The body-fixed frame has its origin at the centre of mass and z along the spin axis; gravity models
    live there.

    Parameters
    ----------
    site_from_fixed : (3, 3)
        Takes body-fixed components to site components.
    center : (3,)
        From the centre of mass to the site, site axes, m.
    angular_velocity : (3,)
        Rate of the body in inertial space, site axes, rad/s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a matrix that is no rotation.

    Examples
    --------
    The tip of Eros, where the centrifugal acceleration (about the centre of mass) is a third of gravity:

    >>> import losnav as ln
    >>> site = ln.dynamics.Site.on_body(0.0349, 0.0, radius=15116.0, rotation_rate=3.31165e-4)
    >>> site.center
    array([    0.,     0., 15116.])
    >>> site.to_fixed([0.0, 0.0, 2000.0]).round(1)
    array([17105.6,     0. ,   597.2])
    """

    site_from_fixed: FloatArray
    center: FloatArray
    angular_velocity: FloatArray

    def __init__(self, site_from_fixed: ArrayLike, center: ArrayLike, angular_velocity: ArrayLike) -> None:
        turn = rotations(site_from_fixed, "site_from_fixed")
        held = {
            "site_from_fixed": turn,
            "center": vectors(center, "center"),
            "angular_velocity": vectors(angular_velocity, "angular_velocity"),
        }
        for name, value in held.items():
            shape = (3, 3) if value is turn else (3,)
            if value.shape != shape:
                raise InvalidInputError(f"{name}: expected shape {shape}, got {value.shape}")
            kept = value.copy()
            kept.flags.writeable = False
            object.__setattr__(self, name, kept)

    @classmethod
    def on_body(cls, latitude: float, longitude: float, radius: float, rotation_rate: float) -> Site:
        """Site at a place of a body that spins about its z axis.

        Parameters
        ----------
        latitude, longitude : float
            Planetocentric, in the body-fixed frame, rad.
        radius : float
            Distance from the centre of mass, m.
        rotation_rate : float
            rad/s; positive turns x to y.

        Returns
        -------
        Site
            With z along the radius (not along the local vertical of gravity).

        Raises
        ------
        InvalidInputError
            On anything but finite numbers, or a radius that is not positive.
        """
        values = {
            "latitude": latitude,
            "longitude": longitude,
            "radius": radius,
            "rotation_rate": rotation_rate,
        }
        for name, value in values.items():
            number = finite(value, name)
            if number.ndim:
                raise InvalidInputError(f"{name}: expected a number, got shape {number.shape}")
            if name == "radius" and not number > 0.0:
                raise InvalidInputError(f"radius: expected a number > 0, got {radius!r}")
        (sp, cp), (sl, cl) = ((np.sin(a), np.cos(a)) for a in (latitude, longitude))
        turn = [[-sl, cl, 0.0], [-sp * cl, -sp * sl, cp], [cp * cl, cp * sl, sp]]
        return cls(turn, [0.0, 0.0, radius], [0.0, rotation_rate * cp, rotation_rate * sp])

    @classmethod
    def inertial(cls) -> Site:
        """A frame that does not turn, its origin that of the gravity model: a laboratory, or deep space.

        Returns
        -------
        Site
            With the axes of the gravity model.
        """
        return cls(np.eye(3), np.zeros(3), np.zeros(3))

    def to_fixed(self, position: ArrayLike) -> FloatArray:
        """Body-fixed position of a place given in the site frame.

        Parameters
        ----------
        position : (..., 3)
            From the site, site axes, m.

        Returns
        -------
        (..., 3)
            From the centre of mass, body-fixed axes, m.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN or infinity.
        """
        r = vectors(position, "position")
        with np.errstate(over="ignore", invalid="ignore"):
            return in_range((r + self.center) @ self.site_from_fixed, "position")

    def from_fixed(self, position: ArrayLike) -> FloatArray:
        """Place in the site frame of a body-fixed position, the inverse of :meth:`to_fixed`.

        Parameters
        ----------
        position : (..., 3)
            From the centre of mass, body-fixed axes, m.

        Returns
        -------
        (..., 3)
            From the site, site axes, m.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN or infinity.
        """
        r = vectors(position, "position")
        with np.errstate(over="ignore", invalid="ignore"):
            return in_range(r @ self.site_from_fixed.T - self.center, "position")

"""Noise of one star in head axes, boresight +z.

1. :class:`QuestNoise`, ``sigma^2 (I - b b')``: the same angle across every direction (Shuster & Oh 1981).
   The Wahba loss with weights ``1/sigma^2`` is its negative log-likelihood.
2. :class:`PixelNoise`, white noise of the centroids on a flat detector, ``s^2 J J'`` with
   ``J = (I - b b') [e1 e2] b3``: off the axis a pixel subtends less, so a star at 30 degrees is up to 25 %
   better than model 1 says. In a 20-degree field model 1 is a few per cent pessimistic in variance, in a
   60-degree field by a quarter (Cheng, Crassidis & Markley 2006 treat wide fields for the same reason).

Leaves out: noise that grows towards the edge (blur, distortion) and correlation between stars.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from losnav import noise as direction_noise
from losnav._arrays import ArrayLike, FloatArray, positive, units
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import cross_matrices, unit

__all__ = ["PixelNoise", "QuestNoise", "StarNoise"]


@runtime_checkable
class StarNoise(Protocol):
    """What a head asks of a noise model; any object with these methods will do."""

    def covariance(self, body_vectors: ArrayLike) -> FloatArray:
        """Covariance ``(..., 3, 3)`` of measured unit vectors ``(..., 3)``, rad^2, head axes."""

    def sigma(self, body_vectors: ArrayLike) -> FloatArray:
        """Standard deviation ``(...)`` of an isotropic noise with the same total variance, rad per axis."""


@dataclass(frozen=True)
class QuestNoise:
    """The same angular noise across every direction, ``sigma^2 (I - b b')``.

    Parameters
    ----------
    sigma_rad : float
        1-sigma noise per axis, rad.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.star_tracker.QuestNoise(0.5).covariance([0.0, 0.0, 1.0])
    array([[0.25, 0.  , 0.  ],
           [0.  , 0.25, 0.  ],
           [0.  , 0.  , 0.  ]])
    """

    sigma_rad: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma_rad", number(self.sigma_rad, "sigma_rad"))

    def covariance(self, body_vectors: ArrayLike) -> FloatArray:
        """Covariance ``(..., 3, 3)`` of measured unit vectors ``(..., 3)``, rad^2, head axes."""
        return direction_noise.tangent(body_vectors, self.sigma_rad)

    def sigma(self, body_vectors: ArrayLike) -> FloatArray:
        """Standard deviation ``(...)`` per axis, rad: the same for every star."""
        return np.full(units(body_vectors, "body_vectors").shape[:-1], self.sigma_rad)


@dataclass(frozen=True)
class PixelNoise:
    """White noise of the centroids on a flat detector behind a pinhole.

    Parameters
    ----------
    focal_length_px : float
        Focal length, pixels.
    sigma_px : float
        1-sigma noise of each image coordinate, pixels.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> noise = ln.star_tracker.PixelNoise.from_fov(np.radians(20), 1024, 0.1)
    >>> arcsec = np.radians(1 / 3600)
    >>> (noise.sigma([[0.0, 0.0, 1.0], [0.0, np.sin(0.3), np.cos(0.3)]]) / arcsec).round(2)
    array([7.1 , 6.64])
    """

    focal_length_px: float
    sigma_px: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "focal_length_px", number(self.focal_length_px, "focal_length_px"))
        object.__setattr__(self, "sigma_px", number(self.sigma_px, "sigma_px"))

    @classmethod
    def from_fov(cls, fov: float, pixels: float, sigma_px: float) -> PixelNoise:
        """Noise of a detector ``pixels`` wide whose field is ``fov`` rad from edge to edge.

        Parameters
        ----------
        fov : float
            Full field, rad.
        pixels : float
            Width of the detector, pixels.
        sigma_px : float
            1-sigma noise of each image coordinate, pixels.

        Returns
        -------
        PixelNoise

        Raises
        ------
        InvalidInputError
            If ``fov`` is not in (0, pi), or a number is not positive.

        Examples
        --------
        >>> import numpy as np
        >>> import losnav as ln
        >>> round(ln.star_tracker.PixelNoise.from_fov(np.pi / 2, 1000, 0.1).focal_length_px, 6)
        500.0
        """
        width = number(pixels, "pixels")
        return cls(0.5 * width / math.tan(0.5 * field(fov)), sigma_px)

    def covariance(self, body_vectors: ArrayLike) -> FloatArray:
        """Covariance ``(..., 3, 3)`` of measured unit vectors ``(..., 3)``, rad^2, head axes; rank 2."""
        return direction_noise.focal_plane(body_vectors, self.sigma_px / self.focal_length_px)

    def sigma(self, body_vectors: ArrayLike) -> FloatArray:
        """Root mean square ``(...)`` of the noise over the two axes across each direction, rad."""
        return np.asarray(np.sqrt(0.5 * np.trace(self.covariance(body_vectors), axis1=-2, axis2=-1)))


def information_of_directions(body_vectors: FloatArray, covariance: FloatArray) -> FloatArray:
    """``sum [b x]' R^+ [b x]`` over directions ``(..., N, 3)`` with covariances of rank 2."""
    weight = tangent_weights(body_vectors, covariance)
    cross = cross_matrices(unit(body_vectors))
    return np.asarray((np.swapaxes(cross, -1, -2) @ weight @ cross).sum(axis=-3))


def tangent_weights(body_vectors: FloatArray, covariance: FloatArray) -> FloatArray:
    """Inverses of covariances on the tangent planes of their directions, ``(R + s bb')^-1 - bb' / s``."""
    b = unit(body_vectors)
    outer = b[..., :, np.newaxis] * b[..., np.newaxis, :]
    scale = np.trace(covariance, axis1=-2, axis2=-1)[..., np.newaxis, np.newaxis]
    inside = (np.eye(3) - outer) @ covariance @ (np.eye(3) - outer)
    return np.asarray(np.linalg.inv(inside + scale * outer) - outer / scale)


def number(value: ArrayLike, name: str) -> float:
    """One positive number."""
    array = positive(value, name)
    if array.ndim:
        raise InvalidInputError(f"{name}: expected one number, got shape {array.shape}")
    return float(array)


def field(value: ArrayLike) -> float:
    """A full field of view, rad."""
    fov = number(value, "fov")
    if not fov < np.pi:
        raise InvalidInputError(f"fov: expected a field below pi rad, got {fov:g} rad; is it in degrees?")
    return fov

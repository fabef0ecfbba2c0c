"""What stars spread evenly over a detector give a head.

    P = (sigma^2 / N) diag(1, 1, k^2) / E[1 - bx^2],   k = sqrt( E[1 - bx^2] / E[bx^2 + by^2] )    (T12)

``k`` is 14.0, 8.8, 7.0 and 5.8 for square fields of 10, 16, 20 and 24 degrees: the rotation about the
boresight is the weak axis of every narrow field, and the reason for having more than one head.
"""

from __future__ import annotations

import math
from typing import Literal, TypeAlias

import numpy as np

from losnav._arrays import FloatArray
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import unit
from losnav.star_tracker.star_noise import QuestNoise, StarNoise, field, information_of_directions

__all__ = ["Shape", "boresight_ratio", "head_covariance"]

Shape: TypeAlias = Literal["square", "circle"]
# Nodes of the Gauss-Legendre rule over half a detector; 1e-15 up to fields of 150 degrees.
NODES = 64


def boresight_ratio(fov: float, shape: Shape = "square") -> float:
    """How much worse a head knows the rotation about its boresight than across it: k of the module's page.

    Parameters
    ----------
    fov : float
        Full field, rad.
    shape : {"square", "circle"}
        Of the detector, over which the stars are spread evenly.

    Returns
    -------
    float

    Raises
    ------
    InvalidInputError
        If ``fov`` is not in (0, pi) or the shape is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> [round(ln.star_tracker.boresight_ratio(np.radians(f)), 2) for f in (10, 16, 20, 24)]
    [14.03, 8.77, 7.01, 5.84]
    """
    information = _mean_information(field(fov), QuestNoise(1.0), checked_shape(shape))
    return float(np.sqrt(information[0, 0] / information[2, 2]))


def head_covariance(
    fov: float, stars: int, noise: float | StarNoise = 1.0, *, shape: Shape = "square"
) -> FloatArray:
    """Attitude covariance of one head whose stars are spread evenly over its detector.

    The inverse of the mean information: what a typical star field gives, a little optimistic for fewer than
    five stars, whose information varies from field to field.

    Parameters
    ----------
    fov : float
        Full field, rad.
    stars : int
        Number of stars, at least 2.
    noise : float or StarNoise
        1-sigma noise per star and axis, rad, or a noise model.
    shape : {"square", "circle"}
        Of the detector.

    Returns
    -------
    (3, 3)
        Head axes, rad^2; diagonal.

    Raises
    ------
    InvalidInputError
        On bad arguments.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> covariance = ln.star_tracker.head_covariance(np.radians(20), 8, 7.03)
    >>> np.sqrt(np.diag(covariance)).round(2)
    array([ 2.5 ,  2.5 , 17.51])
    """
    number = whole(stars, "stars", 2)
    model = noise if isinstance(noise, StarNoise) else QuestNoise(noise)
    information = number * _mean_information(field(fov), model, checked_shape(shape))
    return np.diag(1.0 / np.diag(information))


def _mean_information(fov: float, model: StarNoise, shape: Shape) -> FloatArray:
    """Information of one star, averaged over the detector."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    edge = math.tan(0.5 * fov)
    if shape == "square":
        # One quadrant stands for all: nodes on [0, edge].
        u, v = np.meshgrid(0.5 * edge * (nodes + 1.0), 0.5 * edge * (nodes + 1.0))
        weight = np.outer(weights, weights)
    else:
        radius = edge * np.sqrt(0.5 * (nodes + 1.0))
        angle = 0.25 * np.pi * (nodes + 1.0)
        u, v = radius[:, np.newaxis] * np.cos(angle), radius[:, np.newaxis] * np.sin(angle)
        weight = np.outer(weights, weights)
    b = unit(np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3))
    each = information_of_directions(b[:, np.newaxis, :], model.covariance(b)[:, np.newaxis])
    mean = np.einsum("n,nij->ij", weight.ravel() / weight.sum(), each)
    return np.asarray(np.diag(np.diag(mean)))


def detector_points(rng: np.random.Generator, count: int, shape: Shape) -> FloatArray:
    """Random points ``(count, 2)`` of a detector that reaches from -1 to 1."""
    if shape == "square":
        return rng.uniform(-1.0, 1.0, (count, 2))
    radius, angle = np.sqrt(rng.uniform(0.0, 1.0, count)), rng.uniform(0.0, 2 * np.pi, count)
    return np.asarray(radius[:, np.newaxis] * np.stack([np.cos(angle), np.sin(angle)], axis=1))


def whole(value: int, name: str, least: int) -> int:
    """A whole number."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise InvalidInputError(f"{name}: expected a whole number of at least {least}, got {value!r}")
    return int(value)


def checked_shape(value: Shape) -> Shape:
    """A shape that is known."""
    if value not in ("square", "circle"):
        raise InvalidInputError(f'shape: expected "square" or "circle", got {value!r}')
    return value

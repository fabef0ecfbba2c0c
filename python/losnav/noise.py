"""Noise of measured directions: covariances for ``covariance=`` of :func:`losnav.solve_pose` and its kin.

Three models of one direction ``b``, in body (camera) axes, rad^2, and what an uncertain map adds:

1. :func:`isotropic`, ``sigma^2 I``: the three components are disturbed independently.
2. :func:`tangent`, ``sigma^2 (I - b b')``: a unit vector disturbed across itself (QUEST; Shuster & Oh 1981).
   Rank 2; to first order the same information as the isotropic one.
3. :func:`focal_plane`: white noise on a flat detector. Off the boresight a pixel subtends less, so the same
   detector measures better there: at 30 degrees a direction is up to 25 % more precise than model 1 says, at
   60 degrees up to four times. The estimate hardly depends on the model, its covariance does.
"""

from __future__ import annotations

import operator

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, covariances, in_range, positive, rotations, units
from losnav.errors import InvalidInputError

__all__ = ["focal_plane", "isotropic", "landmark_uncertainty", "tangent"]

# A direction nearer than this to the detector's plane has no image.
MINIMUM_BORESIGHT = 1e-6


def isotropic(sigma: ArrayLike, n: int | None = None) -> FloatArray:
    """Covariance of directions whose three components are disturbed independently, ``sigma^2 I``.

    Parameters
    ----------
    sigma : scalar, (n,) or (..., n)
        1-sigma noise, rad per axis.
    n : int, optional
        Number of directions; needed with a scalar ``sigma``.

    Returns
    -------
    (n, 3, 3) or (..., n, 3, 3)
        Covariances, rad^2.

    Raises
    ------
    InvalidInputError
        On a ``sigma`` that is not positive and finite, or one that does not fit ``n``.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.noise.isotropic(1e-3, 4).shape
    (4, 3, 3)
    """
    variance = _squared(sigma, "sigma")
    if n is not None:
        count = _count(n)
        if variance.ndim and variance.shape[-1] != count:
            raise InvalidInputError(f"sigma: expected a scalar or shape (..., {count}), got {variance.shape}")
        variance = np.broadcast_to(variance, (*variance.shape[:-1], count))
    elif variance.ndim == 0:
        raise InvalidInputError("n: expected the number of directions, needed with a scalar sigma")
    return variance[..., np.newaxis, np.newaxis] * np.eye(3)


def tangent(los: ArrayLike, sigma: ArrayLike) -> FloatArray:
    """Covariance of unit vectors disturbed across themselves, ``sigma^2 (I - b b')`` (QUEST), rank 2.

    Parameters
    ----------
    los : (..., N, 3)
        Unit directions in body axes; measured ones will do.
    sigma : scalar, (N,) or (..., N)
        1-sigma noise about each axis across the direction, rad.

    Returns
    -------
    (..., N, 3, 3)
        Covariances, rad^2.

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, or a ``sigma`` that is not positive and finite or does not broadcast.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.noise.tangent([0.0, 0.0, 1.0], 0.1).round(12)
    array([[0.01, 0.  , 0.  ],
           [0.  , 0.01, 0.  ],
           [0.  , 0.  , 0.  ]])
    """
    b = _unit(los)
    return _variance(b, sigma, "sigma") * _projector(b)


def focal_plane(los: ArrayLike, sigma_focal: ArrayLike) -> FloatArray:
    """Covariance of directions measured by a flat detector with white noise, rank 2.

    ``R = sigma_focal^2 J J'``, ``J = (I - b b') [e1 e2] |b3|``: the boresight is the z axis, in either sense,
    so cameras that look along +z and along -z are both served.

    Parameters
    ----------
    los : (..., N, 3)
        Unit directions in camera axes; measured ones will do.
    sigma_focal : scalar, (N,) or (..., N)
        1-sigma noise of each image coordinate in units of the focal length: ``sigma_pixel /
        focal_length_px``, or metres over metres. On the boresight it is the noise in rad.

    Returns
    -------
    (..., N, 3, 3)
        Covariances, rad^2.

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, a ``sigma_focal`` that is not positive and finite or does not broadcast,
        or a direction at right angles to the boresight (``|b3| < 1e-6``), which has no image.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> thirty = np.radians(30)
    >>> covariance = ln.noise.focal_plane([0.0, np.sin(thirty), np.cos(thirty)], 1e-3)
    >>> np.sqrt(np.linalg.eigvalsh(covariance)[1:]).round(6)  # rad: 1e-3 cos(30)^2 and 1e-3 cos(30)
    array([0.00075 , 0.000866])
    """
    b = _unit(los)
    flat = ~(np.abs(b[..., 2]) >= MINIMUM_BORESIGHT)
    if flat.any():
        index = tuple(int(i) for i in np.argwhere(flat)[0])
        where = list(index) if index else ""
        raise InvalidInputError(
            f"los{where}: at right angles to the boresight (z axis), where nothing is imaged"
        )
    slope = _projector(b)[..., :2] * np.abs(b[..., 2])[..., np.newaxis, np.newaxis]
    return _variance(b, sigma_focal, "sigma_focal") * (slope @ np.swapaxes(slope, -1, -2))


def landmark_uncertainty(
    los_body: ArrayLike, ranges: ArrayLike, dcm: ArrayLike, landmark_covariance: ArrayLike
) -> FloatArray:
    """What uncertain landmark positions add to the covariance of the directions.

    ``dcm (I - r r') P_L (I - r r') dcm' / range^2``, ``r = dcm' b``: the landmark's error across the line of
    sight, seen from its range. For errors independent from one landmark to the next; a shift common to all of
    them moves the position by as much and cannot be averaged away.

    Parameters
    ----------
    los_body : (..., N, 3)
        Unit directions in body axes.
    ranges : (..., N)
        Distances to the landmarks, m.
    dcm : (..., 3, 3)
        Body from reference.
    landmark_covariance : (3, 3), (N, 3, 3) or (..., N, 3, 3)
        Covariance of the landmark positions in the reference frame, m^2.

    Returns
    -------
    (..., N, 3, 3)
        To be added to one of the noise models, rad^2.

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, ranges that are not positive, matrices that are no rotations or no
        covariances, or shapes that do not broadcast.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.noise.landmark_uncertainty([0.0, 0.0, 1.0], 100.0, np.eye(3), 0.04 * np.eye(3)).round(12)
    array([[4.e-06, 0.e+00, 0.e+00],
           [0.e+00, 4.e-06, 0.e+00],
           [0.e+00, 0.e+00, 0.e+00]])
    """
    b = _unit(los_body, "los_body")
    attitude = rotations(dcm, "dcm")
    if attitude.ndim > 2 and b.ndim > 1:
        # One attitude serves all the directions of a problem.
        attitude = attitude[..., np.newaxis, :, :]
    spread = covariances(landmark_covariance, "landmark_covariance")
    distance = _expanded(positive(ranges, "ranges"), b, "ranges")
    try:
        with np.errstate(over="ignore", under="ignore", divide="ignore", invalid="ignore"):
            root = _projector(b) / distance @ attitude
            added = root @ spread @ np.swapaxes(root, -1, -2)
            # Symmetric to the last bit, as a covariance should be.
            added = 0.5 * added + 0.5 * np.swapaxes(added, -1, -2)
    except ValueError as error:
        shapes = f"{b.shape}, {np.shape(dcm)} and {spread.shape}"
        raise InvalidInputError(
            f"los_body, dcm, landmark_covariance: leading dimensions of {shapes} do not broadcast"
        ) from error
    return in_range(added, "landmark_covariance or ranges")


def _count(n: int) -> int:
    try:
        count = operator.index(n)
    except TypeError as error:
        raise InvalidInputError(f"n: expected a whole number, got {n!r}") from error
    if count < 1:
        raise InvalidInputError(f"n: expected at least 1, got {count}")
    return count


def _unit(los: ArrayLike, name: str = "los") -> FloatArray:
    b = units(los, name)
    return np.asarray(b / np.linalg.norm(b, axis=-1, keepdims=True))


def _projector(b: FloatArray) -> FloatArray:
    """``I - b b'``: what lies across the direction."""
    return np.eye(3) - b[..., :, np.newaxis] * b[..., np.newaxis, :]


def _variance(b: FloatArray, sigma: ArrayLike, name: str) -> FloatArray:
    """``sigma^2`` of each direction, with two axes for its matrix."""
    return _expanded(_squared(sigma, name), b, name)


def _squared(sigma: ArrayLike, name: str) -> FloatArray:
    with np.errstate(over="ignore", under="ignore"):
        square: FloatArray = np.square(positive(sigma, name))
    if not (np.isfinite(square) & (square > 0.0)).all():
        raise InvalidInputError(f"{name}: expected a noise whose square is a number, got one out of range")
    return square


def _expanded(values: FloatArray, b: FloatArray, name: str) -> FloatArray:
    """One number for each direction, with two axes for its matrix."""
    try:
        np.broadcast_shapes(values.shape, b.shape[:-1])
    except ValueError as error:
        raise InvalidInputError(
            f"{name}: expected a scalar or a shape that broadcasts with {b.shape[:-1]}, got {values.shape}"
        ) from error
    return np.asarray(values[..., np.newaxis, np.newaxis])

"""Covariance ellipsoids ``{l : l' P^-1 l <= 1}``: widths, intersections, and what fusion makes of them.

    half-width of the projection on u   w(u) = sqrt(u' P u)            (support function; 1-sigma about u)
    intercept along u                   r(u) = 1 / sqrt(u' P^-1 u)     (radius; 1-sigma, all else known)
    fused radius                        1 / r^2 = sum_n 1 / r_n^2      (equations X21, X22)
    intersection of the heads'          r = min_n r_n

so that along every direction ``intersection / sqrt(N) <= fused <= intersection``: the fused ellipsoid lies
inside the intersection of the heads' ellipsoids and touches it only where the other heads know nothing. It
is not the largest ellipsoid inscribed in it. ``r <= w`` always; they are equal along principal axes.
"""

from __future__ import annotations

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, broadcast, rotations, vectors
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker.covariance import fused_covariance, in_scale, inverse_covariances

__all__ = ["ellipsoid_points", "half_width", "intercept", "intersection_intercept", "sandwich_ratio"]


def half_width(covariance: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Half-width of an ellipsoid's projection on a direction, ``sqrt(u' P u)``: 1-sigma about it.

    Parameters
    ----------
    covariance : (..., 3, 3)
        Positive semidefinite.
    direction : (..., 3)
        Of any length but zero; only its direction counts.

    Returns
    -------
    (...)
        In the unit of the covariance's square root; along a coordinate axis ``sqrt(P_jj)``.

    Raises
    ------
    InvalidInputError
        On a matrix that is no covariance, a zero direction, or shapes that do not broadcast.

    Examples
    --------
    >>> import losnav as ln
    >>> covariance = [[2.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    >>> along_y = [0.0, 1.0, 0.0]
    >>> projection = ln.star_tracker.half_width(covariance, along_y)
    >>> cut = ln.star_tracker.intercept(covariance, along_y)
    >>> round(float(projection), 3), round(float(cut), 3)       # a tilted ellipsoid: not the same
    (1.0, 0.707)
    """
    return np.sqrt(
        _quadratic(in_scale(checked_covariances(covariance, "covariance"), "covariance", 2), direction)
    )


def intercept(covariance: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Radius of an ellipsoid along a direction, ``1 / sqrt(u' P^-1 u)``: 1-sigma if all else were known.

    Parameters
    ----------
    covariance : (..., 3, 3)
        Positive definite.
    direction : (..., 3)
        Of any length but zero.

    Returns
    -------
    (...)
        In the unit of the covariance's square root.

    Raises
    ------
    InvalidInputError
        As :func:`half_width`, or on a singular covariance.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> float(ln.star_tracker.intercept(np.diag([1.0, 1.0, 4.0]), [0.0, 0.0, 2.0]))
    2.0
    """
    return 1.0 / np.sqrt(_quadratic(inverse_covariances(covariance, "covariance"), direction))


def intersection_intercept(covariances: ArrayLike, mountings: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Radius of the intersection of the heads' ellipsoids along a direction of the fusion frame.

    Parameters
    ----------
    covariances : (N, 3, 3)
        Attitude covariance of each head in its own axes, rad^2, positive definite.
    mountings : (N, 3, 3)
        Fusion from head.
    direction : (..., 3)
        In fusion axes.

    Returns
    -------
    (...)
        Smallest of the heads' intercepts, rad.

    Raises
    ------
    InvalidInputError
        On bad arguments.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> heads = [np.diag([1.0, 1.0, 49.0]), np.diag([4.0, 4.0, 9.0])]
    >>> float(ln.star_tracker.intersection_intercept(heads, [np.eye(3)] * 2, [0.0, 0.0, 1.0]))
    3.0
    """
    f = inverse_covariances(covariances, "covariances")
    s = rotations(mountings, "mountings")
    if f.ndim != 3 or s.shape != f.shape:
        raise InvalidInputError(
            f"covariances, mountings: expected two arrays (N, 3, 3), got {f.shape} and {s.shape}"
        )
    u = _directions(direction)
    inverse_squares = np.einsum("nij,...i,...j->...n", s @ f @ np.swapaxes(s, -1, -2), u, u)
    return np.asarray(1.0 / np.sqrt(inverse_squares.max(axis=-1)))


def sandwich_ratio(covariances: ArrayLike, mountings: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Radius of the fused ellipsoid over that of the intersection: between ``1/sqrt(N)`` and 1.

    Parameters
    ----------
    covariances, mountings, direction
        As for :func:`intersection_intercept`.

    Returns
    -------
    (...)

    Raises
    ------
    InvalidInputError
        On bad arguments.

    Examples
    --------
    Equal heads side by side gain the square root of their number everywhere:

    >>> import numpy as np
    >>> import losnav as ln
    >>> same = [np.diag([1.0, 1.0, 49.0])] * 4
    >>> ln.star_tracker.sandwich_ratio(same, [np.eye(3)] * 4, np.eye(3)).round(12)
    array([0.5, 0.5, 0.5])
    """
    fused = fused_covariance(covariances, mountings)
    return intercept(fused, direction) / intersection_intercept(covariances, mountings, direction)


def ellipsoid_points(covariance: ArrayLike, directions: ArrayLike, scale: float = 1.0) -> FloatArray:
    """Points of the surface ``l' P^-1 l = scale^2``, one along each direction.

    Parameters
    ----------
    covariance : (3, 3)
        Positive definite.
    directions : (..., 3)
        Of any length but zero.
    scale : float
        Number of sigmas.

    Returns
    -------
    (..., 3)
        In the unit of the covariance's square root.

    Raises
    ------
    InvalidInputError
        On bad arguments.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.star_tracker.ellipsoid_points(np.diag([1.0, 1.0, 4.0]), np.eye(3))
    array([[1., 0., 0.],
           [0., 1., 0.],
           [0., 0., 2.]])
    """
    u = _directions(directions)
    return scale * intercept(covariance, u)[..., np.newaxis] * u


def _directions(value: ArrayLike) -> FloatArray:
    array = vectors(value, "direction")
    largest = np.abs(array).max(axis=-1, keepdims=True)
    if not (largest > 0.0).all():
        raise InvalidInputError("direction: expected a vector that is not zero")
    array = array / largest
    return np.asarray(array / np.linalg.norm(array, axis=-1, keepdims=True))


def _quadratic(matrix: FloatArray, direction: ArrayLike) -> FloatArray:
    """``u' M u`` for unit ``u``."""
    shape, (m, u) = broadcast(("covariance", matrix, 2), ("direction", _directions(direction), 1))
    return np.asarray(np.einsum("bij,bi,bj->b", m, u, u).reshape(shape))

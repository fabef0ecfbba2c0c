"""What an arc of measurements says of the state it started from: Gramian, and indices of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, matrices, positive, vectors
from losnav.errors import InvalidInputError
from losnav.observability.arc import rows_of, survey, triangular
from losnav.observability.matrix import plain

__all__ = ["estimation_condition", "gramian", "horizon_weighted", "unobservability_index"]

# Rows stacked before they are condensed: memory of a long arc stays that of its states.
_CHUNK = 4096


def gramian(
    dynamics: Any,
    sensor: Any,
    state: Any,
    times: ArrayLike,
    *,
    controls: Any = None,
    scale: ArrayLike | None = None,
    root: bool = False,
    start: float | None = None,
    **context: Any,
) -> FloatArray:
    """Fisher information of an arc about the state it starts from: the observability Gramian (equation I1).

    Parameters
    ----------
    dynamics : model
        From :mod:`losnav.dynamics` or your own, as for a filter; process noise plays no part here.
    sensor : sensor or sequence
        A sensor, or several; for one that does not measure at every epoch a pair ``(sensor, seen)``, with
        ``seen`` bools ``(T,)`` or ``(T, M)``, or measurements ``(T, M)`` with NaN where there are none.
    state : (..., N) or a state object
        True state at ``times[0]``.
    times : (T,)
        Epochs of the measurements, s; decreasing ones go back in time.
    controls : (C,), (T - 1, C) or (T, C), optional
        As for ``ExtendedKalmanFilter.run``: entry ``k`` of ``T`` acts over the step that ends at
        ``times[k]``.
    scale : (N,), optional
        Size of one unit of each component; the result is then per such units.
    root : bool
        Return the upper triangular ``A`` with ``A' A`` the Gramian instead: its singular values have twice
        the digits. It is what :func:`analyze` should be given.
    start : float, optional
        Epoch of ``state`` if that is not ``times[0]``.
    **context
        What the sensors are told besides the state: ``dcm=`` ``(3, 3)`` or ``(T, 3, 3)``, and so on.

    Returns
    -------
    (..., N, N)
        ``sum_k Phi_k' H_k' R_k^-1 H_k Phi_k``, symmetric positive semidefinite; its inverse is the covariance
        of the best unbiased estimate of the state at the start.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a model or sensor that lacks a method.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.1e-3)
    >>> bearing = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], sigma=1e-4)
    >>> state = np.array([-1000.0, 0.0, 200.0, 0.1, 0.0, 0.3])
    >>> times = np.arange(0.0, 3000.0, 60.0)
    >>> information = ln.observability.gramian(orbit, bearing, state, times, root=True, dcm=np.eye(3))
    >>> weak = ln.observability.analyze(information, scale=[1e3, 1e3, 1e3, 1.0, 1.0, 1.0], tolerance=1e-8)
    >>> weak.rank  # angles alone do not tell how far
    5
    """
    path, sensors, told = survey(dynamics, sensor, state, times, controls, start, context)
    upper = _condensed(path.transition, rows_of(path, sensors, told))
    if scale is not None:
        upper = upper * _sizes(scale, path.size)
    return upper if root else np.swapaxes(upper, -1, -2) @ upper


def _condensed(transition: FloatArray, rows: FloatArray) -> FloatArray:
    """Rows of all epochs carried back to the first, as one triangular matrix."""
    size, epochs = rows.shape[-1], rows.shape[-3]
    lead = np.broadcast_shapes(rows.shape[:-3], transition.shape[:-3])
    phi = np.broadcast_to(np.eye(size), (*lead, size, size))
    upper = np.zeros((*lead, size, size))
    for first in range(0, epochs, _CHUNK):
        carried = []
        for k in range(first, min(first + _CHUNK, epochs)):
            if k:
                phi = transition[..., k - 1, :, :] @ phi
            carried.append(rows[..., k, :, :] @ phi)
        upper = triangular(np.concatenate([upper, *carried], axis=-2))
    return upper


def horizon_weighted(
    matrix: ArrayLike, horizon: float, order: int, scale: ArrayLike | None = None
) -> FloatArray:
    """A Lie matrix whose rows say how much a measurement changes over a time (equation I6).

    The row of derivative ``k`` is multiplied by ``T^k/k!``: its share in the Taylor series of the measurement
    at ``T``. Rows of all orders are then in the unit of the measurement and can be compared, whatever the
    unit of time. Smallest singular value, ``analyze(...).singular_values[-1]``: how much the weakest
    direction changes what is measured within ``T``.

    Parameters
    ----------
    matrix : (..., M (order + 1), N)
        Measurement, first derivative, ...: from ``lie_matrix(..., scale="SI")``, or in units of its own.
    horizon : float
        The time ``T``, s, or in the matrix's unit of time.
    order : int
        Highest derivative in the matrix.
    scale : (N,), optional
        Size of one unit of each component, for columns that can be compared.

    Returns
    -------
    (..., M (order + 1), N)
        The weighted matrix.

    Raises
    ------
    InvalidInputError
        If the rows are no multiple of ``order + 1``, or the horizon is not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.observability.horizon_weighted([[1.0, 0.0], [0.0, 1.0]], horizon=60.0, order=1)
    array([[ 1.,  0.],
           [ 0., 60.]])
    """
    lie = matrices(matrix, "matrix", *np.shape(matrix)[-2:])
    span = float(positive(horizon, "horizon"))
    if order < 0 or lie.shape[-2] % (order + 1):
        raise InvalidInputError(
            f"order: expected rows in {order + 1} equal parts, got {lie.shape[-2]} rows of the matrix"
        )
    weights = [span**k / math.factorial(k) for k in range(order + 1)]
    weighted = np.repeat(weights, lie.shape[-2] // (order + 1))[:, np.newaxis] * lie
    return np.asarray(weighted if scale is None else weighted * _sizes(scale, lie.shape[-1]))


def unobservability_index(gramian: ArrayLike, scale: ArrayLike | None = None) -> Any:
    """Reciprocal of the smallest eigenvalue of a Gramian (Krener & Ide, CDC 2009).

    Parameters
    ----------
    gramian : (..., N, N)
        From :func:`gramian` or :func:`empirical_gramian`.
    scale : (N,), optional
        Size of one unit of each component; without it the index depends on the units of the state.

    Returns
    -------
    float or (...)
        Variance of the direction known worst, in such units; infinite if it cannot be known.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN or infinity.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.observability.unobservability_index(np.diag([4.0, 0.25]))
    4.0
    """
    with np.errstate(divide="ignore"):
        return plain(1.0 / _spectrum(gramian, scale)[..., 0])


def estimation_condition(gramian: ArrayLike, scale: ArrayLike | None = None) -> Any:
    """Largest over smallest eigenvalue of a Gramian (Krener & Ide, CDC 2009).

    Parameters
    ----------
    gramian, scale
        As for :func:`unobservability_index`.

    Returns
    -------
    float or (...)
        From 1 on; infinite if a direction cannot be known.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN or infinity.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.observability.estimation_condition(np.diag([4.0, 0.25]))
    16.0
    """
    values = _spectrum(gramian, scale)
    with np.errstate(divide="ignore", invalid="ignore"):
        return plain(np.where(values[..., 0] > 0.0, values[..., -1] / values[..., 0], np.inf))


def _spectrum(gramian: ArrayLike, scale: ArrayLike | None) -> FloatArray:
    """Eigenvalues, smallest first; rounding errors of a singular matrix are zero."""
    shape = np.shape(gramian)
    array = matrices(gramian, "gramian", *(shape[-1:] * 2 or (1, 1)))
    if scale is not None:
        sizes = _sizes(scale, array.shape[-1])
        array = array * sizes * sizes[:, np.newaxis]
    values = np.linalg.eigvalsh(array)
    floor = array.shape[-1] * np.finfo(float).eps * values[..., -1:]
    return np.where(values > floor, values, 0.0)


def _sizes(scale: ArrayLike, size: int) -> FloatArray:
    sizes = vectors(scale, "scale", size)
    if sizes.ndim != 1 or not (sizes > 0.0).all():
        raise InvalidInputError(f"scale: expected {size} positive numbers, got {sizes}")
    return sizes

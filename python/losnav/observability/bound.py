"""Posterior Cramér-Rao bound along an arc.

Source: Tichavsky, Muravchik & Nehorai, IEEE Trans. Signal Processing 46(5), 1998, 1386-1396, for additive
Gaussian noise about a given path. Kept as a triangular root of the information (Bierman 1977, chapter 6):

1. Units in which the transitions are balanced; rows have unit noise, so everything is of order one.
2. Start: root of the inverse prior; rows of zeros where there is none.
3. Step: with ``x' = F x + L w`` and ``w`` of unit covariance, the rows ``[w; R x]`` become ``[[I, 0],
   [-R F^-1 L, R F^-1]]`` of ``[w x']``; rows of the measurements are put below; QR leaves ``w`` out.
4. Bound: ``(R' R)^-1`` where the root has full rank.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, as_float64, covariances
from losnav.errors import InvalidInputError
from losnav.observability.arc import rows_of, survey, triangular

__all__ = ["crlb"]

_EPS = float(np.finfo(float).eps)
# Rounding errors of one QR step, in units of eps and the number of components.
_PER_STEP = 16.0
_SWEEPS = 8


def crlb(
    dynamics: Any,
    sensor: Any,
    state: Any,
    times: ArrayLike,
    prior: ArrayLike | None = None,
    *,
    controls: Any = None,
    start: float | None = None,
    **context: Any,
) -> FloatArray:
    """Posterior Cramér-Rao bound: the covariance no filter can beat, epoch by epoch (equations I2 to I4).

    Parameters
    ----------
    dynamics : model
        From :mod:`losnav.dynamics` or your own, as for a filter; its process noise counts.
    sensor : sensor or sequence
        A sensor, or several; for one that does not measure at every epoch a pair ``(sensor, seen)``, with
        ``seen`` bools ``(T,)`` or ``(T, M)``, or measurements ``(T, M)`` with NaN where there are none.
    state : (..., N) or a state object
        True state at the start.
    times : (T,)
        Epochs, s; decreasing ones go back in time.
    prior : (..., N, N), optional
        Covariance of what is known at the start, before the first measurement. A component with an infinite
        variance is not known at all; without a prior none is.
    controls : (C,), (T - 1, C) or (T, C), optional
        As for ``ExtendedKalmanFilter.run``: entry ``k`` of ``T`` acts over the step that ends at
        ``times[k]``.
    start : float, optional
        Epoch of ``state`` and ``prior`` if that is not ``times[0]``.
    **context
        What the sensors are told besides the state: ``dcm=`` ``(3, 3)`` or ``(T, 3, 3)``, and so on.

    Returns
    -------
    (..., T, N, N)
        Bound on the covariance of the state after the measurements of each epoch, linearised along the true
        path. What measurements and prior do not determine has an infinite variance, and NaN for its
        covariances; the other components keep their bound.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, a prior that is not positive definite, a transition that cannot be
        inverted, or a model or sensor that lacks a method.

    Notes
    -----
    An extended Kalman filter that is linearised at the truth has this covariance; one that works reaches it.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.1e-3, acceleration_psd=1e-10)
    >>> laser = ln.sensors.RangeBearing(sigma_range=0.2, sigma_angle=1e-3)
    >>> times = np.arange(0.0, 3000.0, 60.0)
    >>> bound = ln.observability.crlb(orbit, laser, [-500.0, 0, 20, 0, 0, 0], times, dcm=np.eye(3))
    >>> bool(np.isinf(bound[0, 3, 3])), bool(bound[-1, 3, 3] < 1e-5)  # one epoch knows no velocity
    (True, True)
    """
    path, sensors, told = survey(dynamics, sensor, state, times, controls, start, context)
    unit, coupled = _balance(path.transition)
    inverse = _inverse(path.transition * unit / unit[:, np.newaxis])
    rows = rows_of(path, sensors, told) * unit
    if rows.shape[-2] > path.size:
        rows = triangular(rows)
    noise = _root(path.process_noise / unit / unit[:, np.newaxis])
    first = _prior_root(prior, path.size) * unit
    roots = _roots(first, inverse, noise, rows)
    bound = _covariance(roots, coupled) * unit * unit[:, np.newaxis]
    return bound[..., 1:, :, :] if start is not None else bound


def _balance(transition: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Units, powers of two, in which rows and columns of all transitions are alike (Osborne 1960), and which
    components have to do with others at all."""
    size = transition.shape[-1]
    unit = np.ones(size)
    if not transition.size:
        return unit, np.zeros(size, dtype=bool)
    largest = np.abs(transition).reshape(-1, size, size).max(axis=0)
    np.fill_diagonal(largest, 0.0)
    coupled = largest.any(axis=0) | largest.any(axis=1)
    for _ in range(_SWEEPS):
        for i in range(size):
            row, column = largest[i].sum(), largest[:, i].sum()
            # What nothing leads to, or what leads nowhere, is given the size of its effect.
            ratio = row / column if row and column else (row or 1.0 / column if row or column else 1.0) ** 2
            factor = 2.0 ** np.round(0.5 * np.log2(ratio))
            unit[i] *= factor
            largest[i] /= factor
            largest[:, i] *= factor
    return unit, coupled


def _inverse(transition: FloatArray) -> FloatArray:
    try:
        inverse = np.linalg.inv(transition)
    except np.linalg.LinAlgError:
        inverse = np.full(1, np.nan)
    if not np.isfinite(inverse).all():
        raise InvalidInputError("dynamics.transition(...): expected a matrix that can be inverted")
    return np.asarray(inverse)


def _root(noise: FloatArray) -> FloatArray | None:
    """``L`` with ``L L'`` the process noise, which may be singular; None if there is none at all."""
    if not noise.any():
        return None
    size = np.sqrt(np.maximum(np.diagonal(noise, axis1=-2, axis2=-1), 0.0))[..., np.newaxis]
    safe = np.where(size > 0.0, size, 1.0)
    unit = noise / safe / np.swapaxes(safe, -1, -2)
    try:
        return np.asarray(size * np.linalg.cholesky(unit))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(unit)
        if (values < -1e-9).any():
            raise InvalidInputError(
                "dynamics.process_noise(...): expected a positive semidefinite matrix"
            ) from None
        return np.asarray(size * vectors * np.sqrt(np.maximum(values, 0.0))[..., np.newaxis, :])


def _prior_root(prior: ArrayLike | None, size: int) -> FloatArray:
    """``R`` with ``R' R`` the inverse of the prior, zero for what is not known."""
    if prior is None:
        return np.zeros((size, size))
    array = as_float64(prior, "prior")
    if array.ndim < 2 or array.shape[-2:] != (size, size):
        raise InvalidInputError(f"prior: expected shape (..., {size}, {size}), got {array.shape}")
    variances = np.diagonal(array, axis1=-2, axis2=-1)
    unknown = np.isposinf(variances).reshape(-1, size).any(axis=0)
    if (np.isposinf(variances) != unknown).any():
        raise InvalidInputError("prior: expected the same components to be unknown in the whole batch")
    known = np.flatnonzero(~unknown)
    rows, columns = known[:, np.newaxis], known
    kept = covariances(array[..., rows, columns], "prior", known.size)
    deviation = np.sqrt(np.diagonal(kept, axis1=-2, axis2=-1))[..., np.newaxis]
    try:
        if not (deviation > 0.0).all():
            raise np.linalg.LinAlgError
        lower = np.linalg.cholesky(kept / deviation / np.swapaxes(deviation, -1, -2))
    except np.linalg.LinAlgError:
        raise InvalidInputError("prior: expected a positive definite matrix") from None
    out = np.zeros(array.shape)
    out[..., rows, columns] = np.linalg.inv(lower) / np.swapaxes(deviation, -1, -2)
    return out


def _roots(first: FloatArray, inverse: FloatArray, noise: FloatArray | None, rows: FloatArray) -> FloatArray:
    """Roots of the information after the measurements of each epoch, ``(..., T, N, N)``."""
    size, epochs, height = rows.shape[-1], rows.shape[-3], rows.shape[-2]
    lead = np.broadcast_shapes(first.shape[:-2], inverse.shape[:-3], rows.shape[:-3])
    extra = 0 if noise is None else size
    out = np.empty((*lead, epochs, size, size))
    stack = np.zeros((*lead, extra + size + height, extra + size))
    upper = first
    for k in range(epochs):
        if k:
            upper = out[..., k - 1, :, :] @ inverse[..., k - 1, :, :]
        stack[..., extra : extra + size, extra:] = upper
        stack[..., extra + size :, extra:] = rows[..., k, :, :]
        if noise is not None and k:
            stack[..., :extra, :extra] = np.eye(extra)
            stack[..., extra : extra + size, :extra] = -upper @ noise[..., k - 1, :, :]
            out[..., k, :, :] = triangular(stack)[..., extra:, extra:]
        else:
            out[..., k, :, :] = triangular(stack[..., extra:, extra:])
    return out


def _covariance(roots: FloatArray, coupled: npt.NDArray[np.bool_]) -> FloatArray:
    """``(R' R)^-1``; infinite where the root says nothing."""
    size = roots.shape[-1]
    # Rounding errors of the steps so far add up as a random walk.
    floor = _PER_STEP * size * _EPS * np.sqrt(np.arange(1, roots.shape[-3] + 1))
    norms = np.linalg.norm(roots, axis=-2)
    # A column of rounding errors must not be taken for little information: components that have to do with
    # each other have comparable columns in balanced units.
    largest = np.where(coupled, norms, 0.0).max(axis=-1, keepdims=True)
    norms = np.where(coupled & (norms <= floor[:, np.newaxis] * largest), largest, norms)
    norms = np.where(norms > 0.0, norms, 1.0)[..., np.newaxis, :]
    unit = roots / norms
    diagonal = np.diagonal(unit, axis1=-2, axis2=-1)
    empty = np.abs(diagonal) < _EPS**2
    # A triangular matrix without a zero on its diagonal can be inverted; whether it should be is seen below.
    inverse = np.linalg.inv(unit + empty[..., np.newaxis] * _EPS**2 * np.eye(size))
    reach = np.linalg.norm(inverse, axis=(-2, -1)) * np.linalg.norm(unit, axis=(-2, -1))
    lost = reach * np.broadcast_to(floor, reach.shape) > 1.0
    inverse /= np.swapaxes(norms, -1, -2)
    out = np.asarray(inverse @ np.swapaxes(inverse, -1, -2))
    for index in np.argwhere(lost):
        where = tuple(index)
        out[where] = _partial(unit[where], norms[where][0], float(floor[where[-1]]))
    return out


def _partial(unit: FloatArray, norms: FloatArray, floor: float) -> FloatArray:
    """The bound of what is determined; the rest infinite."""
    _, values, right = np.linalg.svd(unit)
    held = values > floor * values[0]
    inverse = (right[held].T / values[held]) / norms[:, np.newaxis]
    out: FloatArray = inverse @ inverse.T
    undetermined = (np.abs(right[~held]) > np.sqrt(_EPS)).any(axis=0)
    out[undetermined] = out[:, undetermined] = np.nan
    out[undetermined, undetermined] = np.inf
    return out

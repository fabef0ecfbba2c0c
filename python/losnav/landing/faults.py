"""What goes wrong on the way from a sensor to a filter: measurements that do not come, or come late."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, finite
from losnav.errors import InvalidInputError

__all__ = ["arriving", "outage", "thinned"]


def outage(z: ArrayLike, times: ArrayLike, begin: float, end: float) -> FloatArray:
    """Measurements without those of ``begin <= t < end``.

    Parameters
    ----------
    z : (..., T, M)
        Measurements.
    times : (T,)
        Their epochs, s.
    begin, end : float
        s.

    Returns
    -------
    (..., T, M)
        NaN in the rows that did not come.

    Raises
    ------
    InvalidInputError
        If the epochs do not fit the measurements.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.landing.outage([[1.0], [2.0], [3.0]], [0.0, 1.0, 2.0], 1.0, 2.0).ravel()
    array([ 1., nan,  3.])
    """
    rows, epochs = _rows(z), finite(times, "times")
    if epochs.shape != rows.shape[-2:-1]:
        raise InvalidInputError(f"times: expected shape {rows.shape[-2:-1]}, got {epochs.shape}")
    return _without(rows, (epochs >= begin) & (epochs < end))


def thinned(z: ArrayLike, every: int) -> FloatArray:
    """Each ``every``-th measurement, the first of them at index ``every - 1``; NaN in the other rows.

    Parameters
    ----------
    z : (..., T, M)
        Measurements.
    every : int
        At least 1.

    Returns
    -------
    (..., T, M)

    Raises
    ------
    InvalidInputError
        If ``every`` is no whole number of at least 1.
    """
    rows, step = _rows(z), _count(every, "every", 1)
    return _without(rows, np.arange(1, rows.shape[-2] + 1) % step != 0)


def arriving(z: ArrayLike, late: int) -> FloatArray:
    """Measurements at the epochs at which they arrive, ``late`` epochs after the exposure.

    A filter that is told of the delay takes ``z`` itself (``ln.sensors.Delayed``); this is what one sees that
    takes each measurement for a fresh one.

    Parameters
    ----------
    z : (..., T, M)
        Measurements at the epochs of their exposure.
    late : int
        Epochs, 0 or more.

    Returns
    -------
    (..., T, M)
        NaN in the first ``late`` rows.

    Raises
    ------
    InvalidInputError
        If ``late`` is no whole number of at least 0.
    """
    rows, shift = _rows(z), _count(late, "late", 0)
    moved = np.full_like(rows, np.nan)
    count = rows.shape[-2]
    if shift < count:
        moved[..., shift:, :] = rows[..., : count - shift, :]
    return moved


def _rows(z: ArrayLike) -> FloatArray:
    rows = as_float64(z, "z")
    if rows.ndim < 2:
        raise InvalidInputError(f"z: expected shape (..., T, M), got {rows.shape}")
    return rows


def _without(rows: FloatArray, lost: np.ndarray[Any, np.dtype[np.bool_]]) -> FloatArray:
    left = np.array(rows)
    left[..., lost, :] = np.nan
    return left


def _count(value: int, name: str, least: int) -> int:
    try:
        count = operator.index(value)
    except TypeError:
        raise InvalidInputError(f"{name}: expected a whole number, got {value!r}") from None
    if count < least:
        raise InvalidInputError(f"{name}: expected at least {least}, got {count}")
    return count

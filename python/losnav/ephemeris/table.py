"""Ephemerides from samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, in_range, vectors
from losnav.errors import InvalidInputError

# Samples a polynomial goes through, and through how many the velocities of a table without them are taken.
NODES, STENCIL = 4, 9
# Numbers of a polynomial: position and velocity at each sample.
DEGREES = 2 * NODES


class Ephemeris:
    """Positions and velocities of a body between samples.

    Between two samples the path is the polynomial of degree 7 through position and velocity of these and
    the next one on either side; position and velocity are continuous everywhere. Outside the samples it
    refuses to answer.

    Parameters
    ----------
    times : (T,)
        Epochs of the samples, s, increasing; two or more.
    positions : (T, 3)
        m.
    velocities : (T, 3), optional
        m/s. Without them they are those of the polynomials of degree 8 through nine samples; five samples
        are then the least.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, times that do not increase or too few samples.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> day = 86400.0
    >>> times = np.arange(0.0, 400 * day, 10 * day)
    >>> planet = ln.Ephemeris.sampled(lambda t: ln.ephemeris.approximate_planet("jupiter", t), times)
    >>> planet(3.3 * day).shape
    (6,)
    >>> exact = ln.ephemeris.approximate_planet("jupiter", 3.3 * day)
    >>> bool(np.abs(planet(3.3 * day) - exact)[:3].max() < 1e-2)  # m
    True
    >>> planet.interpolation_error < 1.0  # m, estimated
    True
    """

    __slots__ = ("_interpolation_error", "_polynomials", "_times")

    def __init__(self, times: ArrayLike, positions: ArrayLike, velocities: ArrayLike | None = None) -> None:
        t, p = finite(times, "times").copy(), vectors(positions, "positions")
        least = 2 if velocities is not None else 5
        if t.ndim != 1 or len(t) < least:
            raise InvalidInputError(f"times: expected shape (T,) with T >= {least}, got {t.shape}")
        if (np.diff(t) <= 0.0).any():
            raise InvalidInputError(
                f"times: expected increasing epochs, got {np.diff(t).min():g} s between two"
            )
        if p.shape != (len(t), 3):
            raise InvalidInputError(f"positions: expected shape ({len(t)}, 3), got {p.shape}")
        v, doubt = (vectors(velocities, "velocities"), 0.0) if velocities is not None else _slopes(t, p)
        if v.shape != p.shape:
            raise InvalidInputError(f"velocities: expected shape {p.shape}, got {v.shape}")
        t.flags.writeable = False
        self._times = t
        self._polynomials, error = _polynomials(t, p, v)
        self._interpolation_error = error + doubt
        in_range(self._polynomials, "positions or velocities")

    @classmethod
    def sampled(cls, function: Callable[[FloatArray], Any], times: ArrayLike) -> Ephemeris:
        """Ephemeris of a function, asked once for all samples.

        Parameters
        ----------
        function : callable
            Of ``(T,)`` times, s: returns ``(T, 6)`` states ``[r v]``, ``(T, 3)`` positions, or both as
            ``(positions, velocities)``; m and m/s.
        times : (T,)
            Epochs of the samples, s, increasing. A hundredth of the body's period apart leaves millimetres.

        Returns
        -------
        Ephemeris
            Between the first and the last of ``times``.

        Raises
        ------
        InvalidInputError
            As the class, or if the function returns something else.
        """
        epochs = finite(times, "times")
        told = function(epochs)
        if isinstance(told, tuple) and len(told) == 2:
            return cls(epochs, told[0], told[1])
        states = finite(told, "function(times)")
        if states.shape not in ((*epochs.shape, 3), (*epochs.shape, 6)):
            size = epochs.size
            raise InvalidInputError(
                f"function(times): expected shape ({size}, 3) or ({size}, 6), got {states.shape}"
            )
        return cls(epochs, states[..., :3], states[..., 3:] if states.shape[-1] == 6 else None)

    @property
    def start(self) -> float:
        """First epoch it knows, s."""
        return float(self._times[0])

    @property
    def end(self) -> float:
        """Last epoch it knows, s."""
        return float(self._times[-1])

    @property
    def interpolation_error(self) -> float:
        """Estimated error half way between samples, m: what the farthest of the four samples still changes.

        The largest over all intervals, and rather too large. A table that is too coarse shows here.
        """
        return self._interpolation_error

    def __call__(self, time: ArrayLike) -> FloatArray:
        """State of the body.

        Parameters
        ----------
        time : scalar or (...)
            Epochs, s, within :attr:`start` and :attr:`end`.

        Returns
        -------
        (..., 6)
            ``[r v]``, m and m/s.

        Raises
        ------
        InvalidInputError
            On NaN, infinity, or an epoch it does not know.
        """
        return self._motion(time)[..., :6]

    def _motion(self, time: ArrayLike) -> FloatArray:
        """Position, velocity and acceleration, ``(..., 9)``."""
        t = finite(time, "time")
        self._check(t)
        piece = np.clip(np.searchsorted(self._times, t, side="right") - 1, 0, len(self._times) - 2)
        start, length = self._times[piece], np.diff(self._times)[piece]
        x = ((t - start) / length)[..., np.newaxis]
        value = slope = bend = np.zeros(3)
        for c in np.moveaxis(self._polynomials[piece], -1, 0)[::-1]:
            bend = bend * x + 2 * slope
            slope = slope * x + value
            value = value * x + c
        h = length[..., np.newaxis]
        return np.concatenate([value, slope / h, bend / h**2], axis=-1)

    def _check(self, time: FloatArray, name: str = "time") -> None:
        """Refuse epochs outside the samples."""
        early, late = (np.min(time), np.max(time)) if time.size else (self.start, self.end)
        if early < self.start or late > self.end:
            came = f"{early:.10g} s" if early == late else f"{early:.10g} to {late:.10g} s"
            known = f"{self.start:.10g} to {self.end:.10g} s"
            raise InvalidInputError(f"{name}: expected epochs within the ephemeris, {known}, got {came}")

    def _table(self) -> FloatArray:
        """``(T - 1, 26)``: start, length and polynomials of every piece, for the engine."""
        pieces = len(self._polynomials)
        flat = self._polynomials.reshape(pieces, -1)
        return np.column_stack([self._times[:-1], np.diff(self._times), flat])

    def __repr__(self) -> str:
        return (
            f"Ephemeris({len(self._times)} samples, {self.start:g} to {self.end:g} s, "
            f"interpolation error below {self._interpolation_error:.2g} m)"
        )


def _nodes(count: int, used: int) -> np.ndarray[Any, np.dtype[np.intp]]:
    """Samples of every interval, ``(T - 1, used)``: its two ends, then the nearest others."""
    rows = []
    for k in range(count - 1):
        others = sorted((j for j in range(count) if j not in (k, k + 1)), key=lambda j: abs(j - k - 0.5))
        rows.append([k, k + 1, *others[: used - 2]])
    return np.array(rows)


def _polynomials(t: FloatArray, p: FloatArray, v: FloatArray) -> tuple[FloatArray, float]:
    """Coefficients ``(T - 1, 3, 8)`` in the share of each interval, and the estimate of the error, m.

    Newton's divided differences with every sample taken twice: the first four terms are Hermite's cubic, and
    what follows is small, so nothing is lost to rounding.
    """
    used = min(NODES, len(t))
    nodes = np.repeat(_nodes(len(t), used), 2, axis=1)
    pieces, size = nodes.shape
    length = np.diff(t)
    x = (t[nodes] - t[:-1, np.newaxis]) / length[:, np.newaxis]
    table = p[nodes]
    newton = [table[:, 0]]
    for order in range(1, size):
        gap = (x[:, order:] - x[:, :-order])[..., np.newaxis]
        doubled = gap == 0.0
        slopes = v[nodes[:, order:]] * length[:, np.newaxis, np.newaxis]
        table = np.where(doubled, slopes, (table[:, 1:] - table[:, :-1]) / np.where(doubled, 1.0, gap))
        newton.append(table[:, 0])
    coefficients = np.zeros((pieces, 3, DEGREES))
    basis = np.zeros((pieces, 1, DEGREES))
    basis[..., 0] = 1.0
    last = np.zeros((pieces, 3))
    for order, term in enumerate(newton):
        coefficients += term[..., np.newaxis] * basis
        if order >= max(size - 2, 2):
            last += np.abs(term) * np.abs(basis @ 0.5 ** np.arange(DEGREES))
        shifted = np.roll(basis, 1, axis=-1)
        shifted[..., 0] = 0.0
        basis = shifted - x[:, order, np.newaxis, np.newaxis] * basis
    return coefficients, float(np.linalg.norm(last, axis=-1).max())


def _slopes(t: FloatArray, p: FloatArray) -> tuple[FloatArray, float]:
    """Velocities at the samples, of the polynomial through nine, and what the ninth changes, m."""
    width = min(STENCIL, len(t))
    out, doubt = np.empty_like(p), 0.0
    for k in range(len(t)):
        first = min(max(k - width // 2, 0), len(t) - width)
        chosen = np.arange(first, first + width)
        out[k] = _slope(t[chosen], p[chosen], k - first)
        fewer = chosen[:-1] if k - first < width - 1 - (k - first) else chosen[1:]
        change = np.linalg.norm(out[k] - _slope(t[fewer], p[fewer], k - int(fewer[0])))
        # Hermite's cubic follows a slope by 4/27 of the interval at most.
        doubt = max(doubt, float(change * np.diff(t[chosen]).max() * 4 / 27))
    return out, doubt


def _slope(t: FloatArray, p: FloatArray, here: int) -> FloatArray:
    """Derivative of the polynomial through samples at one of them (barycentric weights)."""
    length = t[-1] - t[0]
    x = (t - t[here]) / length
    weights = 1.0 / (x[:, np.newaxis] - x + np.eye(len(t))).prod(axis=1)
    others = np.arange(len(t)) != here
    ratios = weights[others] / weights[here] / -x[others]
    slope: FloatArray = ratios @ (p[others] - p[here]) / length
    return slope

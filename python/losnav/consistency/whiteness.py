"""Are the innovations white?  Their autocorrelation over the epochs, with bounds.

For a component ``y`` of the innovation, ``rho_k = sum y_t y_{t+k} / sqrt(sum y_t^2 sum y_{t+k}^2)``, sums
over runs and epochs. Nothing is subtracted: a consistent filter's innovations have zero mean, so a bias is
a correlation too. The variance of an innovation changes along an arc, which the usual bound ``1/sqrt(n)``
ignores; here it is ``sqrt(sum y_t^2 y_{t+k}^2)`` in place of the root of the products, right for independent
innovations of any variances. With it, the squares of the lags' ratios add up to a chi-square variable (as in
Ljung & Box, Biometrika 65, 1978), from which the verdict is taken.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from losnav._arrays import FloatArray, as_float64
from losnav.consistency.chi_square import checked_confidence, chi2_quantile, chi2_sf
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Autocorrelation", "autocorrelation"]

# Lags looked at unless told otherwise, and at most this part of the epochs.
_LAGS, _PART = 20, 4
# A component this much smaller than the largest of a sensor with fewer degrees of freedom than components is
# the void one of a unit vector: of second order in the others, and so never white.
_VOID = 1e-2


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelation of innovations.

    Attributes
    ----------
    lags : (K,) int array
        1 to K, counted in measurements.
    value : (K, M) array
        Correlation of each component of the innovation with itself ``lags`` measurements later.
    bound : (K, M) array
        A white sequence stays within plus or minus this with the probability ``confidence``, each value by
        itself.
    confidence, overall_confidence : float
        Coverage of one bound; and of the verdict.
    fraction_inside : float
        Part of the values within their bounds; about ``confidence`` for a white sequence.
    p_value : (M,) array
        Probability that a white sequence is correlated as much, all lags of a component together.
    white : bool
        Whether no component contradicts whiteness at ``overall_confidence``.
    """

    lags: np.ndarray[Any, np.dtype[np.intp]]
    value: FloatArray
    bound: FloatArray
    confidence: float
    overall_confidence: float
    fraction_inside: float
    p_value: FloatArray
    white: bool

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        del copy
        return np.array(self.value, dtype=dtype)

    def summary(self) -> str:
        """Verdict and numbers, as text."""
        lines = [
            f"Innovations at lags 1 to {self.lags[-1]}: "
            + (
                "white"
                if self.white
                else "CORRELATED: the filter leaves something of its measurements unused"
            ),
            f"  within their {100 * self.confidence:g} % bounds: {100 * self.fraction_inside:.1f} %",
        ]
        for k in range(self.value.shape[1]):
            if not np.isnan(self.p_value[k]):
                lines.append(
                    f"  component {k}: {self.value[0, k]:+.3f} at lag 1 (bound {self.bound[0, k]:.3f}), "
                    f"p = {self.p_value[k]:.2g}"
                )
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Draw the correlation over the lags in its bounds.

        Parameters
        ----------
        path : path, optional
            PNG file to write; without, the figure is returned.

        Returns
        -------
        matplotlib.figure.Figure or pathlib.Path
            The figure, or where it was written.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.consistency.figures import correlations

        return correlations(self, path)


def autocorrelation(
    log: Any,
    *,
    sensor: int = 0,
    max_lag: int | None = None,
    confidence: float = 0.95,
    overall_confidence: float = 0.999,
) -> Autocorrelation:
    """Autocorrelation of a filter's innovations, which a consistent filter leaves white.

    Parameters
    ----------
    log : FilterLog
        Of one run or of many; anything with ``innovation``, a sequence with an array ``(..., T, M)`` for each
        sensor, and ``accepted`` (..., T, sensors). NaN and rejected measurements are left out.
    sensor : int
        Whose innovations.
    max_lag : int, optional
        Largest lag; 20, or a quarter of the epochs if that is less.
    confidence, overall_confidence : float
        Two-sided coverage of a bound, and of the verdict, in (0, 1).

    Returns
    -------
    Autocorrelation

    Raises
    ------
    InvalidInputError
        If the log has no such sensor or is too short for the lag.

    Notes
    -----
    Bar-Shalom, Li & Kirubarajan (2001), eqs. 5.4.2-14 and -15, with bounds for changing variance. The
    component of a unit vector along the predicted one is no measurement and is left out (NaN).

    Examples
    --------
    >>> import types
    >>> import numpy as np
    >>> import losnav as ln
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.normal(size=(20, 101, 3)) * np.linspace(3, 1, 101)[:, np.newaxis]
    >>> log = types.SimpleNamespace(
    ...     innovation=[noise[:, 1:]], accepted=np.ones((20, 100, 1), bool), dof=np.array([3])
    ... )
    >>> ln.consistency.autocorrelation(log).white
    True
    >>> log.innovation = [noise[:, 1:] + 0.2 * noise[:, :-1]]
    >>> print(ln.consistency.autocorrelation(log).summary().splitlines()[0])
    Innovations at lags 1 to 20: CORRELATED: the filter leaves something of its measurements unused
    """
    innovation, dof = _innovations(log, sensor)
    epochs, size = innovation.shape[-2:]
    most = max(1, min(_LAGS, epochs // _PART)) if max_lag is None else int(max_lag)
    if not 1 <= most < epochs:
        raise InvalidInputError(f"max_lag: expected 1 to {epochs - 1} for {epochs} epochs, got {most}")
    y = np.nan_to_num(innovation.reshape(-1, epochs, size))
    y *= 1.0 / np.maximum(np.abs(y).max(axis=(0, 1)), np.finfo(float).tiny)
    products, spread, size_of = (np.empty((most, size)) for _ in range(3))
    for k in range(1, most + 1):
        a, b = y[:, :-k], y[:, k:]
        products[k - 1] = (a * b).sum(axis=(0, 1))
        spread[k - 1] = np.square(a * b).sum(axis=(0, 1))
        # Only where both ends of a pair are there: a gap must not weaken the correlation.
        pairs = (a != 0.0) & (b != 0.0)
        size_of[k - 1] = (np.square(a) * pairs).sum(axis=(0, 1)) * (np.square(b) * pairs).sum(axis=(0, 1))
    void = _void(innovation, dof)
    with np.errstate(divide="ignore", invalid="ignore"):
        value = np.where(void, np.nan, products / np.sqrt(size_of))
        ratio = np.square(products) / spread
        bound = np.sqrt(chi2_quantile(checked_confidence(confidence), 1) * spread / size_of)
    told = ~np.isnan(value) & np.isfinite(ratio)
    lags = told.sum(axis=0)
    ratio = np.where(told, ratio, 0.0).sum(axis=0)
    p = np.array([float(chi2_sf(q, n)) if n else np.nan for q, n in zip(ratio, lags, strict=True)])
    level = (1.0 - checked_confidence(overall_confidence, "overall_confidence")) / max(
        1, int((lags > 0).sum())
    )
    return Autocorrelation(
        lags=np.arange(1, most + 1),
        value=value,
        bound=np.where(void, np.nan, bound),
        confidence=confidence,
        overall_confidence=overall_confidence,
        fraction_inside=float((np.abs(value) <= bound)[told].mean()) if told.any() else float("nan"),
        p_value=p,
        white=bool(np.all(p[lags > 0] > level)),
    )


def _innovations(log: Any, sensor: int) -> tuple[FloatArray, int | None]:
    """Innovations (..., T, M) of one sensor, NaN where not used, and their degrees of freedom."""
    every = getattr(log, "innovations", None) or log.innovation
    if isinstance(every, np.ndarray):
        every = [every]
    if not -len(every) <= sensor < len(every):
        raise InvalidInputError(f"sensor: expected one of {len(every)} sensors, got {sensor}")
    innovation = as_float64(every[sensor], "log.innovation")
    if innovation.ndim < 2:
        raise InvalidInputError(f"log.innovation: expected shape (..., T, M), got {innovation.shape}")
    accepted = np.broadcast_to(log.accepted, (*innovation.shape[:-1], len(every)))[..., sensor]
    freedom = getattr(log, "dof", None)
    dof = None if freedom is None else int(np.max(np.reshape(freedom, (-1, len(every)))[:, sensor]))
    return np.where(accepted[..., np.newaxis], innovation, np.nan), dof


def _void(innovation: FloatArray, dof: int | None) -> np.ndarray[Any, np.dtype[np.bool_]]:
    size = innovation.shape[-1]
    square = np.nan_to_num(np.square(innovation.reshape(-1, size))).sum(axis=0)
    if dof is None or dof >= size:
        return np.asarray(square <= 0.0)
    return np.asarray(square <= _VOID**2 * square.max())

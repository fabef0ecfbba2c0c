"""Monte Carlo estimates with the interval that belongs to each: what claims are judged by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import bootstrap_interval, chi2_quantile

__all__ = [
    "BAND",
    "CONFIDENCE",
    "deviation",
    "identity",
    "percent",
    "ratio",
    "resampled",
    "resampled_median",
    "scaled_mean",
    "span",
]

Array = NDArray[np.float64]

#: Coverage of the intervals of claims.
CONFIDENCE = 0.95
#: Coverage of the chi-square bands of consistency tests.
BAND = 0.999

_RESAMPLES = 1000


def scaled_mean(values: Array, dof: int = 6) -> tuple[float, tuple[float, float]]:
    """Mean of chi-square variables of unknown scale, with its exact interval."""
    mean, total = float(np.mean(values)), dof * values.size
    low, high = chi2_quantile([(1 - BAND) / 2, (1 + BAND) / 2], total)
    return mean, (mean * total / float(high), mean * total / float(low))


def deviation(values: Array) -> tuple[float, tuple[float, float]]:
    """Standard deviation about zero of a normal sample, with its exact interval."""
    deviation, count = float(np.sqrt(np.mean(values**2))), len(values)
    low, high = chi2_quantile([(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2], count)
    return deviation, (deviation * float(np.sqrt(count / high)), deviation * float(np.sqrt(count / low)))


def resampled(values: Array, statistic: Callable[[Array], Array]) -> tuple[float, tuple[float, float]]:
    """Statistic of the mean over runs (first axis), with its bootstrap interval."""
    runs = len(values)
    if runs < 2 or values[0].size == 0:
        return (float(statistic(values.mean(axis=0))) if values.size else np.nan), (-np.inf, np.inf)
    weights = np.random.default_rng(0).multinomial(runs, np.full(runs, 1 / runs), size=_RESAMPLES) / runs
    draws = statistic(weights @ values)
    low, high = np.quantile(draws, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(statistic(values.mean(axis=0))), (float(low), float(high))


def resampled_median(values: Array) -> tuple[float, tuple[float, float]]:
    """Median of a sample, with its bootstrap interval."""
    return float(np.median(values)), bootstrap_interval(values, np.median, confidence=CONFIDENCE)


def identity(mean: Array) -> Array:
    """The mean itself, for :func:`resampled`."""
    return mean


def ratio(mean: Array) -> Array:
    """First mean over second, for :func:`resampled`."""
    return np.asarray(mean[..., 0] / np.maximum(mean[..., 1], 1e-12))


def span(value: float, interval: tuple[float, float]) -> str:
    """A value and its interval as text."""
    return f"{value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]"


def percent(value: float, interval: tuple[float, float]) -> str:
    """A share and its interval as text, in percent."""
    return f"{100 * value:.1f} % [{100 * interval[0]:.1f}, {100 * interval[1]:.1f}]"

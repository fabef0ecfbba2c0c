"""Confidence intervals of quantities that are not chi-square: success rates, medians, iteration counts.

Sources: incomplete beta function by continued fraction (Abramowitz & Stegun 26.5.8); Clopper & Pearson,
Biometrika 26 (1934).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from losnav._arrays import finite
from losnav.consistency.chi_square import checked_confidence
from losnav.errors import InvalidInputError

__all__ = ["binomial_interval", "bootstrap_interval"]

_RELATIVE_END = 1e-16
_TINY = 1e-300
_MAX_TERMS = 100_000


def _incomplete_beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta I_x(a, b) by its continued fraction (A&S 26.5.8), on the side where it
    converges fast."""
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    if x > (a + 1.0) / (a + b + 2.0):
        return 1.0 - _incomplete_beta(b, a, 1.0 - x)
    front = math.exp(
        math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b) + a * math.log(x) + b * math.log1p(-x)
    )
    c, d = 1.0, 1.0 / (1.0 - (a + b) * x / (a + 1.0) or _TINY)
    h = d
    for m in range(1, _MAX_TERMS):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        for numerator in (even, odd):
            d = 1.0 / (1.0 + numerator * d or _TINY)
            c = 1.0 + numerator / c or _TINY
            h *= c * d
        if abs(c * d - 1.0) < _RELATIVE_END:
            break
    return front * h / a


def _beta_quantile(p: float, a: float, b: float) -> float:
    low, high = 0.0, 1.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if _incomplete_beta(a, b, middle) < p else (low, middle)
    return 0.5 * (low + high)


def binomial_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact (Clopper–Pearson) interval of a success probability.

    Parameters
    ----------
    successes, trials : int
        ``0 <= successes <= trials``, ``trials >= 1``.
    confidence : float
        Two-sided coverage (at least this much, whatever the true probability), in (0, 1).

    Returns
    -------
    (low, high) : tuple of float
        Bounds of the probability, in [0, 1].

    Raises
    ------
    InvalidInputError
        If the counts are impossible or ``confidence`` is outside (0, 1).

    Examples
    --------
    >>> from losnav.consistency import binomial_interval
    >>> [round(p, 4) for p in binomial_interval(100, 100)]
    [0.9638, 1.0]
    """
    k, n = int(successes), int(trials)
    if n < 1 or not 0 <= k <= n:
        raise InvalidInputError(
            f"successes, trials: expected 0 <= successes <= trials and trials >= 1, got {k}, {n}"
        )
    tail = 0.5 * (1.0 - checked_confidence(confidence))
    low = 0.0 if k == 0 else _beta_quantile(tail, k, n - k + 1)
    high = 1.0 if k == n else _beta_quantile(1.0 - tail, k + 1, n - k)
    return low, high


def bootstrap_interval(
    samples: ArrayLike,
    statistic: Callable[..., NDArray[np.float64]] = np.mean,
    *,
    confidence: float = 0.95,
    resamples: int = 1000,
    seed: int = 0,
) -> tuple[float, float]:
    """Percentile bootstrap interval of a statistic of independent samples.

    Parameters
    ----------
    samples : array_like, (runs,)
        Independent values, one for each Monte Carlo run.
    statistic : callable
        ``statistic(values, axis=...)``, for example ``np.mean`` or ``np.median``.
    confidence : float
        Two-sided coverage in (0, 1); approximate, as always with the bootstrap.
    resamples : int
        Number of resampled data sets.
    seed : int
        Seed of the resampling, so that the interval is reproducible.

    Returns
    -------
    (low, high) : tuple of float
        Same unit as the samples.

    Raises
    ------
    InvalidInputError
        If there is no sample or ``confidence`` is outside (0, 1).

    Examples
    --------
    >>> import numpy as np
    >>> from losnav.consistency import bootstrap_interval
    >>> low, high = bootstrap_interval(np.arange(100.0), np.median)
    >>> bool(low < 49.5 < high)
    True
    """
    values = finite(samples, "samples").ravel()
    if values.size == 0:
        raise InvalidInputError("samples: expected at least one value, got none")
    tail = 0.5 * (1.0 - checked_confidence(confidence))
    rng = np.random.default_rng(seed)
    draws = np.empty(resamples)
    # Blocks bound the memory at about 8 MB whatever the number of samples.
    block = max(1, 1_000_000 // values.size)
    for start in range(0, resamples, block):
        count = min(block, resamples - start)
        picks = rng.integers(0, values.size, size=(count, values.size))
        draws[start : start + count] = statistic(values[picks], axis=-1)
    low, high = np.quantile(draws, [tail, 1.0 - tail])
    return float(low), float(high)

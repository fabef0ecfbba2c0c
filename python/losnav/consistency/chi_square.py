"""Chi-square functions without SciPy, and the exact band of an average of chi-square variables.

Sources: incomplete gamma function by series and by modified Lentz continued fraction (Abramowitz & Stegun
6.5.29, 6.5.31); Bar-Shalom, Li & Kirubarajan (2001), section 5.4, for the test.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from losnav._arrays import as_float64
from losnav.errors import InvalidInputError

__all__ = ["chi2_cdf", "chi2_quantile", "chi2_sf", "nees_bounds"]

# A term or factor closer to its limit than this no longer changes a double.
_RELATIVE_END = 1e-16
# Lentz's method divides by running quantities; this stands in for an exact zero.
_TINY = 1e-300
# Both series and fractions need about sqrt(dof) terms near the mean; 10⁵ covers 10⁸ degrees of freedom.
_MAX_TERMS = 100_000


def _lower_series(a: float, x: float) -> float:
    """Regularised lower incomplete gamma P(a, x) by its power series (A&S 6.5.29); for x < a + 1."""
    term = total = 1.0 / a
    for n in range(1, _MAX_TERMS):
        term *= x / (a + n)
        total += term
        if term < total * _RELATIVE_END:
            break
    return total * math.exp(a * math.log(x) - x - math.lgamma(a))


def _upper_fraction(a: float, x: float) -> float:
    """Regularised upper incomplete gamma Q(a, x) by its continued fraction (A&S 6.5.31); for x >= a + 1."""
    b = x + 1.0 - a
    c = 1.0 / _TINY
    d = 1.0 / b
    h = d
    for n in range(1, _MAX_TERMS):
        numerator = -n * (n - a)
        b += 2.0
        d = 1.0 / (numerator * d + b or _TINY)
        c = b + numerator / c or _TINY
        factor = c * d
        h *= factor
        if abs(factor - 1.0) < _RELATIVE_END:
            break
    return h * math.exp(a * math.log(x) - x - math.lgamma(a))


def _gamma_tails(x: float, dof: float) -> tuple[float, float]:
    """(P, Q) of a chi-square variable: both tails, each without cancellation."""
    if math.isnan(x) or math.isnan(dof):
        return math.nan, math.nan
    if x <= 0.0:
        return 0.0, 1.0
    if math.isinf(x):
        return 1.0, 0.0
    a, half = 0.5 * dof, 0.5 * x
    if half < a + 1.0:
        lower = _lower_series(a, half)
        return lower, 1.0 - lower
    upper = _upper_fraction(a, half)
    return 1.0 - upper, upper


def _quantile(p: float, dof: float) -> float:
    if p <= 0.0:
        return 0.0
    if p >= 1.0:
        return math.inf
    low, high = 0.0, dof + 10.0
    while _gamma_tails(high, dof)[0] < p:
        low, high = high, 2.0 * high
    # Bisection on the smaller tail: slower than Newton by a few microseconds and never wrong.
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        below, above = _gamma_tails(middle, dof)
        short = below < p if p < 0.5 else above > 1.0 - p
        low, high = (middle, high) if short else (low, middle)
    return 0.5 * (low + high)


def _broadcast(
    function: Callable[[float, float], float], x: ArrayLike, dof: ArrayLike
) -> NDArray[np.float64]:
    freedom = as_float64(dof, "dof")
    if np.any(freedom <= 0.0):
        raise InvalidInputError(f"dof: expected positive degrees of freedom, got {freedom.min():g}")
    values = np.vectorize(function, otypes=[np.float64])(x, freedom)
    return np.asarray(values)[()]


def chi2_cdf(x: ArrayLike, dof: ArrayLike) -> NDArray[np.float64]:
    """Probability that a chi-square variable lies below ``x``.

    Parameters
    ----------
    x : array_like, (...)
        Value, dimensionless.
    dof : array_like, (...)
        Degrees of freedom, > 0 (need not be integers).

    Returns
    -------
    (...) array
        Probability in [0, 1]; a float for scalar arguments.

    Raises
    ------
    InvalidInputError
        If ``dof`` is not positive.

    Examples
    --------
    >>> from losnav.consistency import chi2_cdf
    >>> round(float(chi2_cdf(5.348, 6)), 3)
    0.5
    """
    return _broadcast(lambda v, k: _gamma_tails(v, k)[0], x, dof)


def chi2_sf(x: ArrayLike, dof: ArrayLike) -> NDArray[np.float64]:
    """Probability that a chi-square variable exceeds ``x`` (the p-value of a fit), exact far into the tail.

    Parameters
    ----------
    x : array_like, (...)
        Value, dimensionless.
    dof : array_like, (...)
        Degrees of freedom, > 0.

    Returns
    -------
    (...) array
        Probability in [0, 1]; a float for scalar arguments.

    Raises
    ------
    InvalidInputError
        If ``dof`` is not positive.

    Examples
    --------
    >>> from losnav.consistency import chi2_sf
    >>> f"{chi2_sf(100.0, 2):.4e}"        # exp(-50)
    '1.9287e-22'
    """
    return _broadcast(lambda v, k: _gamma_tails(v, k)[1], x, dof)


def chi2_quantile(probability: ArrayLike, dof: ArrayLike) -> NDArray[np.float64]:
    """Value below which a chi-square variable lies with the given probability.

    Parameters
    ----------
    probability : array_like, (...)
        In [0, 1].
    dof : array_like, (...)
        Degrees of freedom, > 0.

    Returns
    -------
    (...) array
        Quantile; 0 and inf at probabilities 0 and 1. A float for scalar arguments.

    Raises
    ------
    InvalidInputError
        If a probability lies outside [0, 1] or ``dof`` is not positive.

    Examples
    --------
    >>> from losnav.consistency import chi2_quantile
    >>> round(float(chi2_quantile(0.95, 6)), 4)
    12.5916
    """
    p = as_float64(probability, "probability")
    if not np.all((p >= 0.0) & (p <= 1.0)):
        raise InvalidInputError(f"probability: expected a probability in [0, 1], got {probability!r}")
    return _broadcast(_quantile, p, dof)


def nees_bounds(dof: float, runs: int = 1, confidence: float = 0.999) -> tuple[float, float]:
    """Exact two-sided band of the *mean* of ``runs`` independent normalised squared errors.

    The sum of ``runs`` independent chi-square variables is chi-square with ``runs * dof`` degrees of freedom;
    the band is its quantile range divided by ``runs``. A consistent estimator falls outside with probability
    ``1 - confidence``.

    Parameters
    ----------
    dof : float
        Degrees of freedom of one error: 6 for a pose, the rank of the measurement for an innovation.
    runs : int
        Number of independent errors averaged.
    confidence : float
        Two-sided coverage in (0, 1).

    Returns
    -------
    (low, high) : tuple of float

    Raises
    ------
    InvalidInputError
        If ``dof`` or ``runs`` is not positive, or ``confidence`` is outside (0, 1).

    Examples
    --------
    >>> from losnav.consistency import nees_bounds
    >>> [round(b, 2) for b in nees_bounds(6, runs=1500)]
    [5.71, 6.3]
    """
    if runs < 1:
        raise InvalidInputError(f"runs: expected at least 1, got {runs}")
    tail = 0.5 * (1.0 - checked_confidence(confidence))
    low, high = chi2_quantile([tail, 1.0 - tail], float(dof) * runs)
    return float(low) / runs, float(high) / runs


def checked_confidence(confidence: float, name: str = "confidence") -> float:
    """The confidence, if it is one."""
    if not 0.0 < confidence < 1.0:
        raise InvalidInputError(f"{name}: expected a number in (0, 1), got {confidence}")
    return confidence

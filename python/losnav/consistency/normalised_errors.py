"""NEES and NIS of a filter's log, tested epoch by epoch and as a whole.

With ``e = x_true [-] x`` and its covariance ``P``, ``e' P^-1 e`` is chi-square with as many degrees of
freedom as ``e`` has components; with the innovation ``y`` and ``S``, ``y' S^-1 y`` is chi-square with the
rank of the measurement. Sums over independent runs are chi-square with the sum of the degrees of freedom, so
the band of an average over runs is exact at every epoch.

Over time, innovations of a consistent filter are independent: their band is exact there too. Errors of states
are not: one error lives on until measurements have replaced it. A sum of ``D`` degrees of freedom whose terms
are correlated over ``tau`` epochs has the variance ``2 D tau``; it is tested as ``tau`` times a chi-square
variable of ``D / tau`` degrees of freedom, which has the right mean and variance. ``tau = 1 + 2 sum_k rho_k``
is estimated from the series itself, about its mean over runs and time, up to the first pair of lags whose
correlations do not add up to something positive (Geyer, Statistical Science 7, 1992).
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, finite
from losnav.consistency.chi_square import checked_confidence, chi2_quantile
from losnav.errors import InvalidInputError, NumericalError
from losnav.navigation_state import NavState

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["NormalisedErrors", "nees", "nis"]


@dataclass(frozen=True, eq=False)
class NormalisedErrors:
    """Normalised squared errors of one or many runs, and whether they are as they should be.

    Attributes
    ----------
    name : str
        ``"NEES"`` or ``"NIS"``.
    time : (T,) array
        Epochs, s.
    value : (..., T) array
        The normalised squared errors; NaN where there was nothing to compare.
    dof : (..., T) array
        Degrees of freedom of each, zero where the value is NaN.
    confidence : float
        Two-sided coverage of the band at each epoch.
    overall_confidence : float
        Two-sided coverage of the band of the mean, which decides the verdict.
    average : (T,) array
        Mean over the runs.
    lower, upper : (T,) array
        Exact band of ``average``.
    expected : (T,) array
        Mean degrees of freedom: what ``average`` should be.
    inside : (T,) bool array
        Whether ``average`` lies in its band.
    fraction_inside : float
        Part of the epochs at which it does; about ``confidence`` for a consistent filter.
    mean : float
        Mean over runs and time.
    expected_mean : float
        What it should be.
    bounds : (float, float)
        Band of ``mean`` at ``overall_confidence``.
    correlation_time : float
        Epochs over which successive values are correlated; 1 for innovations.
    verdict : str
        ``"consistent"``; ``"optimistic"``: errors are larger than the covariance says; ``"pessimistic"``:
        smaller.
    factor : float
        ``mean / expected_mean``: what the covariance would have to be multiplied by.
    rejected : (..., T) bool array
        Values of measurements that the filter's gate turned away. They count: without them a consistent
        filter's mean would be too low.
    sensors : tuple of NormalisedErrors
        The same for each sensor by itself, where there are several.
    """

    name: str
    time: FloatArray
    value: FloatArray
    dof: FloatArray
    confidence: float
    overall_confidence: float
    average: FloatArray
    lower: FloatArray
    upper: FloatArray
    expected: FloatArray
    inside: np.ndarray[Any, np.dtype[np.bool_]]
    fraction_inside: float
    mean: float
    expected_mean: float
    bounds: tuple[float, float]
    correlation_time: float
    verdict: str
    factor: float
    rejected: np.ndarray[Any, np.dtype[np.bool_]]
    sensors: tuple[NormalisedErrors, ...] = ()

    @property
    def consistent(self) -> bool:
        """Whether the mean lies in its band."""
        return self.verdict == "consistent"

    @property
    def runs(self) -> int:
        """Number of runs."""
        return int(np.prod(self.value.shape[:-1], dtype=np.int64))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        del copy
        return np.array(self.value, dtype=dtype)

    def summary(self) -> str:
        """Verdict, numbers and how they were judged, as text."""
        runs = f"{self.runs} run{'s' if self.runs != 1 else ''}"
        low, high = self.bounds
        lines = [
            f"{self.name} of {runs}, {self.value.shape[-1]} epochs: {self._sentence()}",
            f"  mean {self.mean:.4g}, expected {self.expected_mean:.4g}, "
            f"{100 * self.overall_confidence:g} % band [{low:.4g}, {high:.4g}]{self._how()}",
            f"  inside its {100 * self.confidence:g} % band at {100 * self.fraction_inside:.1f} % of the "
            f"epochs ({int(self.inside.sum())} of {int((self.expected > 0).sum())})",
        ]
        turned_away = int(self.rejected.sum())
        if turned_away:
            kept = ~self.rejected & ~np.isnan(self.value)
            counted = int((~np.isnan(self.value)).sum())
            without = self.value[kept].mean() if kept.any() else np.nan
            lines.append(
                f"  {turned_away} of {counted} measurements rejected by the gate; mean without them "
                f"{without:.4g}"
            )
        for k, each in enumerate(self.sensors):
            lines.append(
                f"  sensor {k}: {each._sentence()} (mean {each.mean:.4g} of {each.expected_mean:.4g})"
            )
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.summary()

    def plot(self, path: str | os.PathLike[str] | None = None) -> Figure | Path:
        """Draw the average over the runs in its band.

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
        from losnav.consistency.figures import normalised_errors

        return normalised_errors(self, path)

    def _sentence(self) -> str:
        if self.consistent:
            return "consistent"
        if np.isnan(self.mean):
            return "nothing to compare"
        size = np.sqrt(self.factor)
        larger = f"{size:.3g} times as large" if size >= 1.0 else f"only {size:.3g} times as large"
        return f"{self.verdict.upper()}: errors are {larger} as the covariance says"

    def _how(self) -> str:
        if self.correlation_time <= 1.0:
            return ""
        return f" (correlated over {self.correlation_time:.3g} epochs)"


def nees(
    log: Any,
    truth: Any,
    *,
    components: Sequence[int] | slice | None = None,
    confidence: float = 0.95,
    overall_confidence: float = 0.999,
    difference: Callable[[Any, Any], FloatArray] | None = None,
) -> NormalisedErrors:
    """Normalised estimation error squared of a filter's states: are its covariances true?

    Parameters
    ----------
    log : FilterLog
        Of one run or of many; anything with ``time`` (T,), ``state`` (..., T, N) and ``covariance``
        (..., T, N, N).
    truth : (T, N) or (..., T, N)
        True states at ``log.time``, the same for all runs or one for each.
    components : sequence of int or slice, optional
        Look only at these components of the error, for instance ``slice(0, 3)`` for the position.
    confidence : float
        Two-sided coverage of the band at each epoch, in (0, 1).
    overall_confidence : float
        Two-sided coverage of the band of the mean over runs and time, in (0, 1).
    difference : callable, optional
        ``difference(truth, state)``, the error true minus estimate ``(..., T, N)``; the plain difference of
        arrays if absent.

    Returns
    -------
    NormalisedErrors

    Raises
    ------
    InvalidInputError
        On shapes that do not fit each other, NaN or infinity.
    NumericalError
        If a covariance is not positive definite.

    Notes
    -----
    Bar-Shalom, Li & Kirubarajan (2001), eqs. 5.4.2-1 to 5.4.2-10; how time correlation is respected stands at
    the head of the module.

    Examples
    --------
    >>> import types
    >>> import numpy as np
    >>> import losnav as ln
    >>> rng = np.random.default_rng(1)
    >>> states, covariances = rng.normal(size=(100, 50, 2)), np.tile(np.eye(2), (100, 50, 1, 1))
    >>> honest = types.SimpleNamespace(time=np.arange(50.0), state=states, covariance=covariances)
    >>> test = ln.consistency.nees(honest, np.zeros((50, 2)))
    >>> test.consistent, round(test.mean, 1)
    (True, 2.0)
    >>> boasting = types.SimpleNamespace(time=honest.time, state=states, covariance=covariances / 4)
    >>> print(ln.consistency.nees(boasting, np.zeros((50, 2))).summary().splitlines()[0])
    NEES of 100 runs, 50 epochs: OPTIMISTIC: errors are 2 times as large as the covariance says
    """
    time = finite(log.time, "log.time")
    covariance = finite(log.covariance, "log.covariance")
    if difference is None and isinstance(log.state, NavState):
        error = _navigation_error(truth, log.state, covariance.shape[-1])
    else:
        error = difference(truth, log.state) if difference is not None else _difference(truth, log.state)
    size = error.shape[-1]
    if error.ndim < 2 or error.shape[-2] != time.size or covariance.shape[-2:] != (size, size):
        raise InvalidInputError(
            f"log: expected times (T,), states (..., T, N) and covariances (..., T, N, N), got {time.shape}, "
            f"{error.shape}, {covariance.shape}"
        )
    if components is not None:
        pick = np.arange(size)[components if isinstance(components, slice) else list(components)]
        error, covariance = error[..., pick], covariance[..., pick[:, np.newaxis], pick]
    value = _normalised(error, covariance)
    dof = np.full(value.shape, float(error.shape[-1]))
    return _judged("NEES", time, value, dof, (confidence, overall_confidence), correlated=True)


def nis(
    log: Any,
    *,
    sensor: int | None = None,
    dof: ArrayLike | None = None,
    confidence: float = 0.95,
    overall_confidence: float = 0.999,
) -> NormalisedErrors:
    """Normalised innovation squared: are the measurements where the filter expects them, as exactly?

    Needs no truth. Every measurement offered counts, also those the gate rejected; NaN is no measurement.

    Parameters
    ----------
    log : FilterLog
        Of one run or of many; anything with ``time`` (T,), ``nis`` (..., T, sensors), ``accepted`` (..., T,
        sensors) and ``dof`` (sensors,).
    sensor : int, optional
        Only this sensor; all together if absent.
    dof : scalar or (sensors,), optional
        Degrees of freedom of each sensor's measurement, in place of the log's.
    confidence, overall_confidence
        As for :func:`nees`.

    Returns
    -------
    NormalisedErrors
        With several sensors, ``value`` is the sum over the sensors at each epoch.

    Raises
    ------
    InvalidInputError
        On shapes that do not fit each other, or a sensor the log does not have.

    Notes
    -----
    Bar-Shalom, Li & Kirubarajan (2001), eqs. 5.4.2-11 to 5.4.2-13. A mean in band is no proof: a slow bias of
    the state may hardly show in the innovations. See also :func:`autocorrelation`.

    Examples
    --------
    >>> import types
    >>> import numpy as np
    >>> import losnav as ln
    >>> rng = np.random.default_rng(1)
    >>> values = rng.chisquare(3, size=(40, 100, 1))
    >>> log = types.SimpleNamespace(
    ...     time=np.arange(100.0), nis=values, accepted=values < 1e3, dof=np.array([3])
    ... )
    >>> print(ln.consistency.nis(log).verdict)
    consistent
    """
    time = finite(log.time, "log.time")
    value = as_float64(log.nis, "log.nis")
    if value.ndim < 2 or value.shape[-2] != time.size:
        raise InvalidInputError(f"log.nis: expected shape (..., {time.size}, sensors), got {value.shape}")
    freedom = finite(log.dof if dof is None else dof, "dof" if dof is not None else "log.dof")
    try:
        freedom = np.broadcast_to(freedom, value.shape)
    except ValueError:
        raise InvalidInputError(
            f"dof: expected one for each of the {value.shape[-1]} sensors, got shape {freedom.shape}"
        ) from None
    freedom = np.where(np.isnan(value), 0.0, freedom)
    accepted = np.broadcast_to(log.accepted, value.shape)
    rejected = np.asarray(~accepted & ~np.isnan(value))
    count = value.shape[-1]
    coverage = confidence, overall_confidence

    def one(k: int) -> NormalisedErrors:
        return _judged("NIS", time, value[..., k], freedom[..., k], coverage, rejected=rejected[..., k])

    if sensor is not None:
        if not -count <= sensor < count:
            raise InvalidInputError(f"sensor: expected one of {count} sensors, got {sensor}")
        return one(sensor)
    if count == 1:
        return one(0)
    nothing = np.isnan(value).all(axis=-1)
    total = np.where(nothing, np.nan, np.nansum(value, axis=-1))
    whole = _judged(
        "NIS", time, total, freedom.sum(axis=-1), coverage, rejected=np.asarray(rejected.any(axis=-1))
    )
    return dataclasses.replace(whole, sensors=tuple(one(k) for k in range(count)))


def _difference(truth: Any, state: Any) -> FloatArray:
    true, estimate = finite(truth, "truth"), finite(state, "log.state")
    if true.ndim < 2 or true.shape[-2:] != estimate.shape[-2:]:
        expected = f"{estimate.shape[-2:]} or (runs, {', '.join(map(str, estimate.shape[-2:]))})"
        raise InvalidInputError(f"truth: expected shape {expected}, got {true.shape}")
    try:
        return np.asarray(true - estimate)
    except ValueError:
        raise InvalidInputError(
            f"truth: expected as many runs as the log has, {estimate.shape[:-2]}, got {true.shape[:-2]}"
        ) from None


def _navigation_error(truth: Any, state: NavState, size: int) -> FloatArray:
    if not isinstance(truth, NavState):
        raise InvalidInputError(f"truth: expected a NavState like the log's, got {type(truth).__name__}")
    return truth.minus(state, size)


def _normalised(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """e' P^-1 e, each component in its own standard deviation: units may differ by any factor."""
    deviation = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = covariance / (deviation[..., :, np.newaxis] * deviation[..., np.newaxis, :])
        scaled = error / deviation
    try:
        root = np.linalg.cholesky(correlation)
    except np.linalg.LinAlgError:
        raise NumericalError("log.covariance: expected positive definite matrices, one is not") from None
    white = np.linalg.solve(root, scaled[..., np.newaxis])[..., 0]
    if not np.isfinite(white).all():
        raise NumericalError("log.covariance: expected positive definite matrices, one is not")
    return np.asarray(np.square(white).sum(axis=-1))


def _correlation_time(value: FloatArray, most: int) -> float:
    """Epochs over which the values are correlated; see the head of the module."""
    series = value.reshape(-1, value.shape[-1])
    epochs = series.shape[-1]
    deviation = np.nan_to_num(series - np.nanmean(series))
    spectrum = np.abs(np.fft.rfft(deviation, 2 * epochs)) ** 2
    covariance = np.fft.irfft(spectrum.mean(axis=0))[:epochs]
    if covariance[0] <= 0.0:
        return 1.0
    # The biased estimate, c_k with 1/T, has the weights (1 - k/T) of the sum already.
    rho = covariance / covariance[0]
    pairs = rho[1 : epochs - (epochs - 1) % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0.0)
    return float(np.clip(1.0 + 2.0 * pairs[: ends[0] if ends.size else None].sum(), 1.0, most))


def _band(dof: FloatArray, confidence: float) -> tuple[FloatArray, FloatArray]:
    """Two-sided quantiles of chi-square variables; zero where there is no degree of freedom."""
    tail = 0.5 * (1.0 - confidence)
    distinct, place = np.unique(dof, return_inverse=True)
    low, high = np.zeros(distinct.size), np.zeros(distinct.size)
    some = distinct > 0.0
    if some.any():
        low[some] = chi2_quantile(tail, distinct[some])
        high[some] = chi2_quantile(1.0 - tail, distinct[some])
    place = place.reshape(dof.shape)
    return low[place], high[place]


def _judged(
    name: str,
    time: FloatArray,
    value: FloatArray,
    dof: FloatArray,
    coverage: tuple[float, float],
    *,
    correlated: bool = False,
    rejected: np.ndarray[Any, np.dtype[np.bool_]] | None = None,
) -> NormalisedErrors:
    confidence = checked_confidence(coverage[0])
    overall = checked_confidence(coverage[1], "overall_confidence")
    epochs = value.shape[-1]
    counted = ~np.isnan(value)
    runs = counted.reshape(-1, epochs).sum(axis=0)
    freedom = dof.reshape(-1, epochs).sum(axis=0)
    total = np.nansum(value.reshape(-1, epochs), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        average, expected = total / runs, np.where(runs > 0, freedom / runs, 0.0)
        low, high = (edge / runs for edge in _band(freedom, confidence))
    inside = (average >= low) & (average <= high)
    number, degrees = int(runs.sum()), float(freedom.sum())
    mean = float(total.sum() / number) if number else float("nan")
    tau = _correlation_time(value, epochs) if correlated and number else 1.0
    bounds, verdict = (float("nan"), float("nan")), "undecided"
    if degrees > 0.0:
        edges = _band(np.full(1, degrees / tau), overall)
        bounds = (float(edges[0][0]) * tau / number, float(edges[1][0]) * tau / number)
        verdict = "optimistic" if mean > bounds[1] else "pessimistic" if mean < bounds[0] else "consistent"
    return NormalisedErrors(
        name=name,
        time=time,
        value=value,
        dof=dof,
        confidence=confidence,
        overall_confidence=overall,
        average=average,
        lower=low,
        upper=high,
        expected=expected,
        inside=inside,
        fraction_inside=float(inside.sum() / max(1, int((runs > 0).sum()))),
        mean=mean,
        expected_mean=degrees / number if number else float("nan"),
        bounds=bounds,
        correlation_time=tau,
        verdict=verdict,
        factor=mean * number / degrees if degrees else float("nan"),
        rejected=np.zeros(value.shape, bool) if rejected is None else rejected,
    )

"""Claims made of an estimate and its interval, or of a number that is computed, not sampled."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.intervals import CONFIDENCE
from losnav.scenarios.verdicts import Claim

__all__ = ["computed", "first", "ratio", "sampled", "text"]

Array = NDArray[np.float64]
#: A value and its confidence interval.
Estimate = tuple[float, tuple[float, float]]


def computed(value: float, **fields: Any) -> Claim:
    """A claim about a number without noise."""
    return Claim(value=value, interval=(value, value), confidence=CONFIDENCE, **fields)


def sampled(estimate: Estimate, **fields: Any) -> Claim:
    """A claim about a Monte Carlo estimate."""
    value, interval = estimate
    return Claim(value=value, interval=interval, confidence=CONFIDENCE, **fields)


def text(estimate: Estimate, unit: str = "", scale: float = 1.0, form: str = ".3g") -> str:
    """Value and interval, in a unit."""
    value, low, high = (format(scale * number, form) for number in (estimate[0], *estimate[1]))
    return f"{value} [{low}, {high}]{f' {unit}' if unit else ''}"


def first(mean: Array) -> Array:
    """The mean itself of one column, for :func:`~losnav.scenarios.intervals.resampled`."""
    return np.asarray(mean[..., 0])


def ratio(mean: Array) -> Array:
    """Ratio of two rms values, from two columns of mean squares."""
    return np.asarray(np.sqrt(mean[..., 0] / mean[..., 1]))

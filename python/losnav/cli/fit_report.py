"""Words and numbers that the reports on a pose and on an attitude share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import chi2_quantile, chi2_sf

__all__ = ["finite", "fit_text", "listed", "number", "p_value", "suspects"]

Array = NDArray[np.float64]

# Two-sided: a right model fails one fit in 500.
_DOUBT = 1e-3
# Chance that a fit of right measurements names any of them suspicious.
_FALSE_ALARM = 1e-3


def p_value(chi2: float, dof: int) -> float:
    """Chance of a larger chi²; NaN where there is nothing to check."""
    return float(chi2_sf(chi2, dof)) if dof > 0 and np.isfinite(chi2) else np.nan


def fit_text(chi2: float, dof: int, wrong: str, rejecting: bool) -> str:
    """What chi² says of sigma, for ``dof`` of at least 1; ``wrong`` names what else may be the matter."""
    p = p_value(chi2, dof)
    odds = f"p = {p:.2g}" if p >= 1e-99 else "p < 1e-99"
    head = f"chi2 {chi2:.4g} for {dof} degrees of freedom, {odds}"
    ratio = np.sqrt(chi2 / dof)
    if p < _DOUBT:
        cause = f"{wrong} left" if rejecting else f"{wrong} (try --robust)"
        return (
            f"{head}: residuals {ratio:.3g} times larger than sigma allows, do not trust the 1-sigma above; "
            f"sigma too small, or {cause}"
        )
    if p > 1 - _DOUBT:
        return (
            f"{head}: residuals {ratio:.2g} times sigma; sigma, and the 1-sigma above, are probably too large"
        )
    return f"{head}: consistent with sigma"


def suspects(square: Array, used: NDArray[np.bool_]) -> list[int]:
    """Used directions whose normalised squared residual (N,) is larger than chance allows, worst first."""
    limit = float(chi2_quantile(1 - _FALSE_ALARM / len(square), 2))
    return [int(k) for k in np.argsort(-square) if used[k] and square[k] > limit]


def listed(values: Any) -> list[float | None]:
    """Numbers that JSON can hold."""
    return [finite(value) for value in np.asarray(values)]


def finite(value: Any) -> float | None:
    """The number, or None where there is none."""
    return float(value) if np.isfinite(value) else None


def number(value: float | None, form: str = ".6f") -> str:
    """The number as text, or that it is not known."""
    return "unknown" if value is None else format(value, form)

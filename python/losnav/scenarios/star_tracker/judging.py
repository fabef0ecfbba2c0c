"""Two kinds of claims that need no sample: what is computed exactly, and what is tried on many cases."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import binomial_interval
from losnav.scenarios.intervals import CONFIDENCE
from losnav.scenarios.verdicts import Claim, Verdict

__all__ = ["ARCSEC", "best_angle", "computed", "decided", "tried", "triple"]

Array = NDArray[np.float64]

#: One second of arc, rad.
ARCSEC = float(np.radians(1 / 3600))

_REFINEMENTS = 4
_FINER = 40


def decided(truth: bool) -> Verdict:
    """The verdict of a statement that is true or false."""
    return "holds" if truth else "does not"


def computed(  # noqa: PLR0917
    number: str,
    statement: str,
    ours: str,
    value: float,
    truth: bool | Verdict,
    why: str,
    *,
    established: Verdict,
    printed: str = "-",
    interval: tuple[float, float] | None = None,
    confidence: float = 1.0,
) -> Claim:
    """A claim about a quantity that is computed; its interval is the value itself unless it is given."""
    return Claim(
        number=number,
        statement=statement,
        printed=printed,
        ours=ours,
        value=value,
        interval=(value, value) if interval is None else interval,
        confidence=confidence,
        verdict=decided(truth) if isinstance(truth, bool) else truth,
        why=why,
        established=established,
    )


def tried(
    number: str, statement: str, violated: NDArray[np.bool_], why: str, *, established: Verdict
) -> Claim:
    """A claim for all cases, tried on random ones: a single violation decides, none bounds their share."""
    count, cases = int(np.count_nonzero(violated)), violated.size
    share = binomial_interval(count, cases, CONFIDENCE)
    return computed(
        number,
        statement,
        f"{count} violations in {cases} random cases (share at most {share[1]:.2g})",
        count / cases,
        count == 0,
        why,
        established=established,
        interval=(float(share[0]), float(share[1])),
        confidence=CONFIDENCE,
    )


def best_angle(value: Callable[[Array], Array], low: float, high: float, step: float) -> float:
    """Angle in [low, high] with the least value, by ever finer grids; rad."""
    grid = np.linspace(low, high, max(3, round((high - low) / step) + 1))
    for _ in range(_REFINEMENTS):
        middle = int(np.argmin(value(grid)))
        bounds = grid[max(middle - 1, 0)], grid[min(middle + 1, len(grid) - 1)]
        best, grid = float(grid[middle]), np.linspace(*bounds, _FINER)
    return best


def triple(sigma: Array) -> str:
    """Three 1-sigma in rad as text, arcsec."""
    return "(" + ", ".join(f"{value / ARCSEC:.2f}" for value in sigma) + ")″"

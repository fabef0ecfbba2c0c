"""Claim 10: is the degree an index of performance, and which number is?"""

from __future__ import annotations

from typing import TYPE_CHECKING

from losnav.scenarios.judging import computed
from losnav.scenarios.sun_line_of_sight.arcs import Comparison, compare
from losnav.scenarios.verdicts import Claim, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = ["index_claims"]

# Rank correlation with the error that an index of performance must have, or be more negative.
_USEFUL = -0.8


def index_claims(scenario: SunLineOfSight) -> list[Claim]:
    """Claim 10, for the degree and for its rivals."""
    c, days = compare(scenario), scenario.horizon / 86400
    listed: tuple[tuple[str, str, str, str, Verdict, str], ...] = (
        (
            "a",
            "degree",
            "The higher the observability degree, the better the estimate",
            "yes",
            "does not",
            "A ratio of singular values says how even the information is, not how much of it there is; and "
            "its "
            "rows of different order have different units.",
        ),
        (
            "b",
            "horizon",
            "The higher the smallest singular value of the same matrix, its rows weighted for "
            f"{days:.0f} days, the better the estimate",
            "-",
            "holds",
            "Rows times T^k/k!: what each derivative changes within the time T, in one unit. No ratio.",
        ),
        (
            "c",
            "gramian",
            "The higher the smallest singular value of the arc's information, the better the estimate",
            "-",
            "holds",
            "Of the root of the Gramian of all measurements of the arc about its start, with mu = 1.",
        ),
        (
            "d",
            "condition",
            "The better conditioned the arc's information, the better the estimate",
            "-",
            "does not",
            "Smallest over largest singular value of the same root: a ratio again.",
        ),
    )
    return [_of(scenario, c, *row) for row in listed]


def _of(  # noqa: PLR0917 - the columns of the list
    s: SunLineOfSight,
    c: Comparison,
    letter: str,
    index: str,
    statement: str,
    printed: str,
    established: Verdict,
    reason: str,
) -> Claim:
    """One index by its rank correlation with the error."""
    position, velocity = c.correlations(index)
    worst = max(position, velocity)
    return computed(
        worst,
        number=f"10{letter}",
        statement=statement,
        printed=printed,
        ours=f"rank correlation with the error {position:+.2f} (position), {velocity:+.2f} (velocity)",
        verdict=judge((worst, worst), below=_USEFUL),
        why=f"Spearman's, over {s.arcs} arcs of {s.duration / 86400:.0f} days from all around the orbit, "
        f"against "
        f"the Cramér-Rao bound at the end; pointwise indices are averaged along the arc. Asked: {_USEFUL:g} "
        f"or "
        f"less. {reason}",
        established=established,
    )

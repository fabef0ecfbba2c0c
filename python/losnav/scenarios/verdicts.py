"""What every scenario hands back: a table to read, claims judged one by one, figures."""

from __future__ import annotations

import concurrent.futures
import math
import os
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

from losnav.campaign import Progress

__all__ = ["Claim", "Claims", "Result", "Scenario", "Table", "Verdict", "judge"]

Verdict: TypeAlias = Literal["holds", "does not", "ambiguous"]


@dataclass(frozen=True)
class Table:
    """A small table of text cells that prints aligned and converts to dictionaries.

    Attributes
    ----------
    title : str
    columns : tuple of str
        Column heads, with units.
    rows : tuple of tuples
        Cells: str, int or float.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def records(self) -> list[dict[str, Any]]:
        """Rows as dictionaries, for JSON or a data frame; None stands for a number that is not finite."""
        rows = ([_finite(value) if isinstance(value, float) else value for value in row] for row in self.rows)
        return [dict(zip(self.columns, row, strict=True)) for row in rows]

    def __str__(self) -> str:
        cells = [list(self.columns), *([_cell(value) for value in row] for row in self.rows)]
        width = [max(len(row[k]) for row in cells) for k in range(len(self.columns))]
        lines = ["  ".join(text.rjust(w) for text, w in zip(row, width, strict=True)) for row in cells]
        return "\n".join([self.title, lines[0], "-" * len(lines[0]), *lines[1:]])


def _cell(value: object) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Claim:
    """One published statement beside what this scenario measures.

    Attributes
    ----------
    number : str
        Number in the list of claims, with a letter where one sentence makes several.
    statement : str
        What was published, in one line.
    printed : str
        The published value, or "-" if there is none.
    ours : str
        Our value with its interval, as text.
    value : float
        Our value.
    interval : (float, float)
        Confidence interval of ``value``; both ends equal it for a quantity that is computed, not sampled.
    confidence : float
        Coverage of the interval.
    verdict : {"holds", "does not", "ambiguous"}
    why : str
        What the verdict rests on.
    established : {"holds", "does not", "ambiguous"}
        Verdict of an independent study of the unchanged scenario: what a sufficiently long campaign should
        find.
    """

    number: str
    statement: str
    printed: str
    ours: str
    value: float
    interval: tuple[float, float]
    confidence: float
    verdict: Verdict
    why: str
    established: Verdict

    @property
    def as_established(self) -> bool:
        """Whether this campaign came to the established verdict."""
        return self.verdict == self.established

    def as_dict(self) -> dict[str, Any]:
        """All fields, with numbers that JSON can hold."""
        fields = asdict(self)
        fields["value"] = _finite(self.value)
        fields["interval"] = [_finite(bound) for bound in self.interval]
        return fields

    def __str__(self) -> str:
        head = f"{self.number:>4}  {self.verdict.upper():<9}  {self.statement}"
        body = [
            f"printed: {self.printed}",
            f"ours:    {self.ours}",
            *textwrap.wrap(f"why:     {self.why}", 100),
        ]
        return "\n".join([head, *(" " * 17 + line for line in body)])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


class Claims(tuple[Claim, ...]):
    """The claims of a scenario, in order; prints as a report."""

    __slots__ = ()

    def __new__(cls, claims: Iterable[Claim] = ()) -> Claims:
        return super().__new__(cls, claims)

    def table(self) -> Table:
        """One line for each claim."""
        rows = tuple((c.number, c.verdict, c.statement, c.printed, c.ours) for c in self)
        return Table("Published claims", ("claim", "verdict", "statement", "printed", "ours"), rows)

    def tally(self, verdict: Verdict) -> int:
        """Number of claims with this verdict."""
        return sum(claim.verdict == verdict for claim in self)

    def __str__(self) -> str:
        kinds: Sequence[Verdict] = ("holds", "does not", "ambiguous")
        total = ", ".join(f"{self.tally(kind)} {kind}" for kind in kinds)
        return "\n".join([*(str(claim) for claim in self), f"{len(self)} statements: {total}"])


def judge(interval: tuple[float, float], *, above: float = -math.inf, below: float = math.inf) -> Verdict:
    """Judge a range against limits: all of it inside holds, all of it outside does not, astride is ambiguous.

    Examples
    --------
    >>> from losnav.scenarios.verdicts import judge
    >>> judge((0.2, 0.4), below=1.0), judge((0.8, 1.4), below=1.0), judge((1.2, 1.4), below=1.0)
    ('holds', 'ambiguous', 'does not')
    """
    low, high = interval
    if not (math.isfinite(low) and math.isfinite(high)):
        return "ambiguous"
    if above <= low and high <= below:
        return "holds"
    return "does not" if high < above or low > below else "ambiguous"


class Result(Protocol):
    """What ``Scenario.run`` returns."""

    def table(self) -> Table:
        """The figures a report would start with."""

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report, :meth:`table` first."""

    def claims(self) -> Claims:
        """Every published claim, judged."""

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures into the folder ``path`` and return their paths (needs the ``plot`` extra)."""


class Scenario(Protocol):
    """A frozen dataclass of parameters that can be run."""

    def parameters(self) -> dict[str, Any]:
        """All parameters by name."""

    def run(  # noqa: PLR0917 - the contract's order
        self,
        runs: int = 100,
        seed: int = 0,
        executor: concurrent.futures.Executor | None = None,
        progress: bool | Progress = False,
        out: str | os.PathLike[str] | None = None,
        resume: bool = False,
    ) -> Result:
        """Repeat the scenario ``runs`` times; see :func:`losnav.campaign.run_campaign` for the other
        arguments."""

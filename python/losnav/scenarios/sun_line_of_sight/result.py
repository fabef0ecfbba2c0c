"""What a campaign of Sun-only flights hands back: arrays, tables, claims, figures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.sun_line_of_sight.arcs import bound, compare, more_information, rss
from losnav.scenarios.sun_line_of_sight.orbit import curve
from losnav.scenarios.sun_line_of_sight.study import cases, kept_epochs
from losnav.scenarios.verdicts import Claims, Table

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = ["ARCS", "KM", "POSITION", "VELOCITY", "SunLineOfSightResult"]

Array = NDArray[np.float64]

POSITION, VELOCITY = slice(0, 3), slice(3, 6)
KM = 1e3
#: Names of the arcs, in the order of the publication's systems.
ARCS = ("backward", "forward")
_ROWS = 10  # of the tables along an arc
_ANGLES = (0.0, 60.0, 120.0, 180.0)


@dataclass(frozen=True, eq=False)
class SunLineOfSightResult:
    """Arrays and summaries of a campaign.

    Attributes
    ----------
    scenario : SunLineOfSight
        Its parameters.
    runs, seed : int
        Size and seed of the campaign.
    arrays : dict of arrays
        One row for each run. ``{backward,forward}_error`` (runs, S, 6): true minus estimate, m and m/s, at
        the epochs of :func:`~losnav.scenarios.sun_line_of_sight.study.kept_epochs`; ``_sigma`` (runs, S, 6):
        the filter's own 1-sigma; ``_nees`` (runs, S); ``_nis`` (runs, S): mean of the Sun sensor's since the
        epoch kept before. ``case_error`` (runs, cases, S, 6), ``case_nees``, ``case_nis`` (runs, cases, S):
        the same of every variation of :func:`~losnav.scenarios.sun_line_of_sight.study.cases`.
    """

    scenario: SunLineOfSight
    runs: int
    seed: int
    arrays: dict[str, NDArray[Any]]

    @cached_property
    def case_names(self) -> tuple[str, ...]:
        """Names of the variations, in the order of the arrays ``case_*``."""
        return tuple(case.name for case in cases(self.scenario))

    @cached_property
    def times(self) -> Array:
        """Time since the start, either way, at the epochs kept, s, (S,)."""
        return np.abs(self.scenario.forward.times[kept_epochs(self.scenario)])

    def arc(self, name: str) -> dict[str, Array]:
        """Errors, NEES and NIS of one of the two arcs or of a variation, (runs, S, ...)."""
        if name in ARCS:
            return {key: self.arrays[f"{name}_{key}"] for key in ("error", "nees", "nis")}
        k = self.case_names.index(name)
        return {key: self.arrays[f"case_{key}"][:, k] for key in ("error", "nees", "nis")}

    def squares(self, name: str, part: slice = POSITION) -> Array:
        """Squared distances of the errors of an arc or variation, (runs, S)."""
        return np.asarray(np.square(self.arc(name)["error"][..., part]).sum(axis=-1))

    def bound(self, arc: str, doppler: bool = False) -> Array:
        """Cramér-Rao bound at the epochs kept, (S, 6, 6)."""
        return bound(self.scenario, arc, doppler)[kept_epochs(self.scenario)]

    def table(self) -> Table:
        """Accuracy along both arcs, beside the bound."""
        columns: tuple[str, ...] = ("t [d]",)
        cells = [self.times / 86400]
        for number, arc in enumerate(ARCS, start=1):
            head = f"sys {number}"
            columns += (f"{head} [km]", "bound [km]", "[mm/s]", "bound [mm/s]", "NEES", "NIS")
            position, velocity = rss(self.bound(arc))
            found = self.arc(arc)
            cells += [np.sqrt(self.squares(arc).mean(axis=0)) / KM, position / KM]
            cells += [1e3 * np.sqrt(self.squares(arc, VELOCITY).mean(axis=0)), 1e3 * velocity]
            cells += [found["nees"].mean(axis=0), found["nis"].mean(axis=0)]
        picks = np.unique(np.linspace(0, len(self.times) - 1, _ROWS + 1).round().astype(int))
        rows = tuple(tuple(float(cell[k]) for cell in cells) for k in picks)
        title = f"Systems 1 (backward) and 2 (forward), {self.runs} runs: rms of the errors, rss of the axes"
        return Table(title, columns, rows)

    def case_table(self) -> Table:
        """Every variation at the end of its arc."""
        columns = (
            "study",
            "rms [km]",
            "median [km]",
            "mean [km]",
            "bound [km]",
            "NEES",
            "median NEES",
            "NIS",
        )
        rows: list[tuple[Any, ...]] = []
        for case in cases(self.scenario):
            found = self.arc(case.name)
            error, nees = found["error"][:, -1, POSITION], found["nees"][:, -1]
            distance = np.linalg.norm(error, axis=1)
            best = rss(self.bound(case.arc, case.doppler)[-1])[0]
            numbers = [np.sqrt(np.mean(distance**2)) / KM, np.median(distance) / KM]
            numbers += [np.linalg.norm(error.mean(axis=0)) / KM, best / KM]
            numbers += [nees.mean(), np.median(nees), found["nis"].mean()]
            rows.append((case.name, *(float(x) for x in numbers)))
        return Table("Variations: position at the end of the arc", columns, tuple(rows))

    def degree_table(self) -> Table:
        """The observability degree at four points of the orbit, for several orders."""
        f = np.radians(_ANGLES)
        columns = ("highest derivative", *(f"f = {angle:.0f} deg" for angle in _ANGLES))
        orders = range(3, max(self.scenario.order, 5) + 1)
        rows = [
            (order, *(float(value) for value in curve(self.scenario, f, order=order))) for order in orders
        ]
        title = f"Observability degree, unit of length {self.scenario.unit_length / KM:.6g} km"
        return Table(title, columns, tuple(rows))

    def index_table(self) -> Table:
        """Indices of the arcs of the comparison beside the bound at their ends."""
        c = compare(self.scenario)
        columns: tuple[str, ...] = (
            "start f [deg]",
            "degree",
            "horizon-weighted",
            "information",
            "its condition",
        )
        columns += ("position [km]", "velocity [mm/s]")
        cells = [np.degrees(c.anomaly), c.degree, c.horizon, c.gramian, c.condition]
        cells += [c.position / KM, 1e3 * c.velocity]
        rows = tuple(tuple(float(cell[k]) for cell in cells) for k in range(len(c.anomaly)))
        words = f"{self.scenario.duration / 86400:.0f} days from all around the orbit"
        return Table(f"Indices against the Cramér-Rao bound, {words}", columns, rows)

    def information_table(self) -> Table:
        """What more to look at would be worth on the forward arc."""
        columns = ("sensors", "position [km]", "velocity [mm/s]")
        rows = tuple((words, p / KM, 1e3 * v) for words, p, v in more_information(self.scenario))
        return Table("Cramér-Rao bound with more sensors, forward arc, one look in two hours", columns, rows)

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report."""
        return (
            self.table(),
            self.case_table(),
            self.degree_table(),
            self.index_table(),
            self.information_table(),
        )

    def claims(self) -> Claims:
        """The published claims, each part judged with what these runs and the bound say."""
        from losnav.scenarios.sun_line_of_sight.claims import judge_claims

        return judge_claims(self)

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as PNG files into the folder ``path`` (needs the ``plot`` extra) and return their
        paths.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.scenarios.sun_line_of_sight.figures import draw_all

        return draw_all(self, Path(path))

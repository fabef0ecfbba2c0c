"""What a campaign of rendezvous hands back: arrays, tables, claims, figures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.relative_navigation.study import cases, settled
from losnav.scenarios.verdicts import Claims, Table

if TYPE_CHECKING:
    from losnav.scenarios.relative_navigation import RelativeNavigation
    from losnav.scenarios.relative_navigation.truth import Arc

__all__ = ["POSITION", "VELOCITY", "RelativeNavigationResult", "three_sigma"]

Array = NDArray[np.float64]

POSITION, VELOCITY = slice(0, 3), slice(3, 6)
_ROWS = 10  # of the tables along an arc


def three_sigma(mean_square: Array) -> Array:
    """Three times the root of the summed mean squares of the last axis: the rss of what is called 3-sigma."""
    return np.asarray(3 * np.sqrt(mean_square.sum(axis=-1)))


@dataclass(frozen=True, eq=False)
class RelativeNavigationResult:
    """Arrays and summaries of a campaign.

    Attributes
    ----------
    scenario : RelativeNavigation
        Its parameters.
    runs, seed : int
        Size and seed of the campaign.
    arrays : dict of arrays
        One row for each run. ``{printed,approach}_error`` (runs, T, 6): true minus estimate, m and m/s;
        ``_sigma`` (runs, T, 6): the filter's own 1-sigma; ``_nees``, ``_nis`` (runs, T). ``aware_…``: the
        printed arc again, predicted with two J2 orbits in the corrected frame.
        For every density of ``psd_grid``: ``printed_grid_error`` (runs, Q, T, 6), ``printed_grid_nees``
        and ``approach_grid_square`` (runs, Q, T), the latter squared distances, m².
        ``burn_error`` (runs, Q, 2, T, 3): velocity, m/s, without and with the control in the prediction;
        ``burn_nis`` (runs, Q, 2, T). ``case_square``, ``case_bias``
        (runs, cases, 6), ``case_nees``, ``case_nis`` (runs, cases): means over the settled epochs of every
        variation of :func:`~losnav.scenarios.relative_navigation.study.cases`.
    """

    scenario: RelativeNavigation
    runs: int
    seed: int
    arrays: dict[str, NDArray[Any]]

    @cached_property
    def case_names(self) -> tuple[str, ...]:
        """Names of the variations, in the order of the arrays ``case_*``."""
        return tuple(case.name for case in cases(self.scenario))

    def case(self, name: str) -> dict[str, Array]:
        """Per-run summaries of one variation: square and bias (runs, 6), nees and nis (runs,)."""
        k = self.case_names.index(name)
        return {key: self.arrays[f"case_{key}"][:, k] for key in ("square", "bias", "nees", "nis")}

    def squares(self, error: Array, end: float | None = None) -> Array:
        """Mean squares over the settled epochs of the printed arc up to ``end`` (s), (runs, 6)."""
        times = self.scenario.printed.times
        kept = settled(self.scenario, times) & (times <= (np.inf if end is None else end))
        return np.asarray(np.mean(error[:, kept] ** 2, axis=1))

    def psd_errors(self) -> dict[float, Array]:
        """Errors on the printed arc for every process noise tried, (runs, T, 6) each, in rising order."""
        s, grid = self.scenario, self.arrays["printed_grid_error"]
        errors = {psd: grid[:, k] for k, psd in enumerate(s.psd_grid)}
        return dict(sorted({**errors, s.acceleration_psd: self.arrays["printed_error"]}.items()))

    def approach_squares(self) -> dict[float, Array]:
        """Squared position errors on the approach for every process noise tried, m², (runs, T) each, in
        rising order."""
        s, grid = self.scenario, self.arrays["approach_grid_square"]
        squares = {psd: grid[:, k] for k, psd in enumerate(s.psd_grid)}
        own = np.square(self.arrays["approach_error"][..., POSITION]).sum(axis=-1)
        return dict(sorted({**squares, s.acceleration_psd: own}.items()))

    def table(self) -> Table:
        """Accuracy along the printed arc."""
        return self._along("printed", self.scenario.printed, "Printed arc")

    def approach_table(self) -> Table:
        """Accuracy along the approach."""
        return self._along("approach", self.scenario.approach, "Approach")

    def _along(self, name: str, arc: Arc, title: str) -> Table:
        a, times = self.arrays, arc.times
        square = np.mean(a[f"{name}_error"] ** 2, axis=0)
        predicted = np.mean(a[f"{name}_sigma"] ** 2, axis=0)
        columns: tuple[str, ...] = (
            "t [s]",
            "range [m]",
            "x [m]",
            "y [m]",
            "z [m]",
            "position [m]",
            "predicted [m]",
        )
        columns += ("velocity [mm/s]", "predicted [mm/s]", "NEES", "NIS")
        picks = np.unique(np.linspace(0, len(times) - 1, _ROWS + 1).round().astype(int))
        rows = []
        for k in picks:
            cells = [times[k], arc.range[k], *3 * np.sqrt(square[k, POSITION])]
            cells += [three_sigma(square[k, POSITION]), three_sigma(predicted[k, POSITION])]
            cells += [1e3 * three_sigma(square[k, VELOCITY]), 1e3 * three_sigma(predicted[k, VELOCITY])]
            cells += [a[f"{name}_nees"][:, k].mean(), a[f"{name}_nis"][:, k].mean()]
            rows.append(tuple(float(value) for value in cells))
        return Table(
            f"{title}, {self.runs} runs: 3 x rms of the errors, rss of the axes", columns, tuple(rows)
        )

    def case_table(self) -> Table:
        """Every variation, over the settled epochs."""
        columns: tuple[str, ...] = (
            "study",
            "x [m]",
            "y [m]",
            "z [m]",
            "position [m]",
            "velocity [mm/s]",
            "mean z error [m]",
        )
        columns += ("NEES", "NIS")
        rows: list[tuple[Any, ...]] = []
        for name in self.case_names:
            case = self.case(name)
            square = case["square"].mean(axis=0)
            cells = [*3 * np.sqrt(square[POSITION]), three_sigma(square[POSITION])]
            cells += [1e3 * three_sigma(square[VELOCITY]), case["bias"][:, 2].mean()]
            cells += [case["nees"].mean(), case["nis"].mean()]
            rows.append((name, *(float(value) for value in cells)))
        title = f"Variations of the printed arc from {self.scenario.settled:g} s on: 3 x rms, rss of the axes"
        return Table(title, columns, tuple(rows))

    def burn_table(self) -> Table:
        """The manoeuvre, with and without its acceleration in the prediction."""
        columns = ("q [m^2/s^3]", "control", "lag [s]", "velocity [mm/s]", "NIS")
        rows: list[tuple[Any, ...]] = []
        for k, psd in enumerate(self.scenario.burn_psds):
            for told, word in enumerate(("unknown", "in the prediction")):
                velocity = 1e3 * three_sigma(self.burn_squares(k, told).mean(axis=0))
                cells = (
                    float(self.burn_lags(k, told).mean()),
                    float(velocity),
                    self.burn_nis(k, told).mean(),
                )
                rows.append((psd, word, *(float(value) for value in cells)))
        s = self.scenario
        title = (
            f"Burn of {s.burn_acceleration:g} m/s^2 for {s.burn_duration:g} s (lag: mean velocity error of "
            "its second half over the acceleration)"
        )
        return Table(title, columns, tuple(rows))

    def burning(self, share: float = 1.0) -> NDArray[np.bool_]:
        """Epochs of the burn, or of its last ``share``."""
        s, times = self.scenario, self.scenario.printed.times
        begin = s.burn_start + (1 - share) * s.burn_duration
        return np.asarray((times > begin) & (times <= s.burn_start + s.burn_duration))

    def burn_lags(self, k: int, told: int) -> Array:
        """Lag of the velocity behind the truth in the second half of the burn, s, (runs,)."""
        along = self.arrays["burn_error"][:, k, told][:, self.burning(0.5), 0]
        return np.asarray(along.mean(axis=1) / self.scenario.burn_acceleration)

    def burn_squares(self, k: int, told: int) -> Array:
        """Mean squares of the velocity error over the burn, m²/s², (runs, 3)."""
        return np.asarray(np.mean(self.arrays["burn_error"][:, k, told][:, self.burning()] ** 2, axis=1))

    def burn_nis(self, k: int, told: int) -> Array:
        """Mean NIS over the burn, (runs,)."""
        return np.asarray(self.arrays["burn_nis"][:, k, told][:, self.burning()].mean(axis=1))

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report."""
        return self.table(), self.approach_table(), self.case_table(), self.burn_table()

    def claims(self) -> Claims:
        """The published claims, each part judged with what these runs measured."""
        from losnav.scenarios.relative_navigation.claims import judge_claims

        return judge_claims(self)

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as PNG files into the folder ``path`` (needs the ``plot`` extra) and return their
        paths.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.scenarios.relative_navigation.figures import draw_all

        return draw_all(self, Path(path))

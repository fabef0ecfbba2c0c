"""What a campaign of star images measured: arrays, tables, claims, figures."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.scenarios.star_tracker.alignment import biases_after_alignment
from losnav.scenarios.star_tracker.cases import Case, all_cases
from losnav.scenarios.star_tracker.judging import ARCSEC
from losnav.scenarios.star_tracker.study import mounting_errors
from losnav.scenarios.verdicts import Claims, Table

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker

__all__ = ["StarTrackerResult"]

Array = NDArray[np.float64]

_TABLE_ANGLES = (30.0, 43.0, 60.0, 75.0, 90.0, 105.0, 120.0)


@dataclass(frozen=True, eq=False)
class StarTrackerResult:
    """Arrays and summaries of a campaign.

    Attributes
    ----------
    scenario : StarTracker
        Its parameters.
    runs, seed : int
        Size and seed of the campaign.
    arrays : dict of arrays
        One row for each run. For every configuration ``{key}_error`` (runs, images, 3): true minus estimated
        attitude in fusion axes, rad; ``{key}_sigma`` (runs, images, 3): predicted; ``{key}_nees``
        (runs, images). Beside the configurations: ``"{key} attitudes"``, fused from the attitudes of the
        heads; ``"weighted alike"``, all stars weighed alike; ``"pixel alike"``, all with the sigma of a star
        on the axis; ``"mismounted across"``, ``"mismounted about"``, with a wrong mounting.
    """

    scenario: StarTracker
    runs: int
    seed: int
    arrays: dict[str, NDArray[Any]]

    @cached_property
    def cases(self) -> list[Case]:
        """The configurations simulated."""
        return all_cases(self.scenario)

    def case(self, key: str) -> Case:
        """A configuration by its key."""
        return next(case for case in self.cases if case.key == key)

    @cached_property
    def titles(self) -> dict[str, tuple[str, str]]:
        """Name and stars of every configuration by its key."""
        titles = {case.key: (case.title, "+".join(map(str, case.stars))) for case in self.cases}
        return {**titles, "unequal": ("unequal heads, 90° apart", "attitudes")}

    @property
    def consistent(self) -> list[str]:
        """Keys of the configurations with the noise that (14) and (17) assume."""
        return [key for key in self.titles if key != "pixel"]

    @cached_property
    def aligned_biases(self) -> Array:
        """Bias of the fused attitude after the mounting error across a boresight was estimated and removed,
        rad, (alignments, 3)."""
        return biases_after_alignment(self.scenario, mounting_errors(self.scenario)["across"])

    def rms(self, key: str) -> Array:
        """Measured rms error about x, y, z of a configuration, rad, (3,)."""
        return np.asarray(np.sqrt(np.mean(self.arrays[f"{key}_error"] ** 2, axis=(0, 1))))

    def sigma(self, key: str) -> Array:
        """Predicted 1-sigma about x, y, z, root mean square over the runs, rad, (3,)."""
        return np.asarray(np.sqrt(np.mean(self.arrays[f"{key}_sigma"] ** 2, axis=(0, 1))))

    def table(self) -> Table:
        """Predicted and measured accuracy of every configuration."""
        columns: tuple[str, ...] = ("configuration", "stars")
        columns += tuple(f"{name} {axis}" for name in ("1-sigma", "rms") for axis in "xyz")
        columns += ("NEES",)
        rows = []
        for key, names in self.titles.items():
            sigma, rms = self.sigma(key) / ARCSEC, self.rms(key) / ARCSEC
            nees = float(self.arrays[f"{key}_nees"].mean())
            rows.append((*names, *(float(value) for value in (*sigma, *rms)), nees))
        title = f"Fused attitude in the frame of head 1, arcsec, {self.runs} runs (NEES: 3 expected)"
        return Table(title, columns, tuple(rows))

    def separation_table(self) -> Table:
        """Accuracy of evenly spread stars against the separation of the heads."""
        s, rows = self.scenario, []
        for degrees in _TABLE_ANGLES:
            angle, cells = math.radians(degrees), []
            for geometry in ("symmetric", "asymmetric"):
                if geometry == "asymmetric" and angle < s.pair_angle / 2:
                    cells += [math.nan] * 3
                    continue
                sweep = star_tracker.separation_sweep(
                    [s.head_covariance] * 3, angle, geometry, separation=s.pair_angle
                )
                cells += [float(value) for value in sweep.sigma / ARCSEC]
            rows.append((degrees, *cells))
        columns = (
            "angle [deg]",
            *(f"{name} {axis}" for name in ("symmetric", "asymmetric") for axis in "xyz"),
        )
        title = (
            "1-sigma of three equal heads against their separation, arcsec (asymmetric: two heads "
            f"{math.degrees(s.pair_angle):.3g} deg apart, the angle is that of the third)"
        )
        return Table(title, columns, tuple(rows))

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report."""
        return self.table(), self.separation_table()

    def claims(self) -> Claims:
        """The published claims, each part judged with what these runs measured."""
        from losnav.scenarios.star_tracker.claims import judge_claims

        return judge_claims(self)

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as PNG files into the folder ``path`` (needs the ``plot`` extra) and return their
        paths.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.scenarios.star_tracker.figures import draw_all

        return draw_all(self, Path(path))

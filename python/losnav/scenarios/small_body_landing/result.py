"""What a campaign of landings hands back: arrays, tables, claims, figures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.small_body_landing.estimators import navigators
from losnav.scenarios.small_body_landing.study import (
    MAP_ERRORS,
    OUTAGE,
    STARTS,
    final_epochs,
    lost_filters,
    settled,
)
from losnav.scenarios.small_body_landing.truth import fly
from losnav.scenarios.verdicts import Claims, Table

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing import SmallBodyLanding

__all__ = ["ATTITUDE", "POSITION", "VELOCITY", "SmallBodyLandingResult", "convergence", "rms"]

Array = NDArray[np.float64]

#: Places in the last axis of the arrays ``*square``.
POSITION, VELOCITY, ATTITUDE = 0, 1, 2


def rms(mean_square: Array) -> Array:
    """Root, for :func:`~losnav.scenarios.intervals.resampled` of mean squares."""
    return np.asarray(np.sqrt(mean_square))


def convergence(error: Array, times: Array, limits: Array) -> Array:
    """First time after which errors (..., T, 3) stay under their limits (3,) to the end, s; inf if never."""
    bad = np.asarray((error >= limits).any(axis=-1))
    # The epoch after the last bad one.
    last = bad.shape[-1] - 1 - np.argmax(bad[..., ::-1], axis=-1)
    since = np.concatenate([times[1:], [np.inf]])[last]
    return np.asarray(np.where(bad.any(axis=-1), since, times[0]))


@dataclass(frozen=True, eq=False)
class SmallBodyLandingResult:
    """Arrays and summaries of a campaign.

    Attributes
    ----------
    scenario : SmallBodyLanding
        Its parameters.
    runs, seed : int
        Size and seed of the campaign.
    arrays : dict of arrays
        One row for each run; axes L gravity errors, F filters of :attr:`names`, T epochs. ``square`` (runs,
        L, F, T, 3): squared error of position, velocity, attitude, m², m²/s², rad². ``nees`` (runs, L, F,
        T): of these nine components. ``error``, ``sigma`` (runs, F, T, 9) and ``disturbance`` (runs, F, T,
        3) at the largest gravity error: true minus estimate, the filter's own 1-sigma, and the acceleration
        or model error it estimates, m/s². ``bias`` (runs, T, 3): that of the accelerometers, m/s².
        ``outage_square`` (runs, 4, T): squared position error. ``latency_square`` (runs, latencies, 2): mean
        squared position error from ``settled`` on, images taken for fresh, and known to be old.
        ``map_square`` (runs, 4, T, 3), ``map_nees`` (runs, 4, T): the treatments of the map.
        ``lost_distance``, ``lost_nees`` (runs, 3, filters): position error at the end, m, and mean NEES of
        the first ten epochs, from large first errors. ``near_square`` (runs, F, T, 3), ``near_nees`` (runs,
        F, T): truth a polyhedron, filter's gravity its harmonics. ``mems_square`` (runs, 2): mean squared
        attitude error, rad², without and with biases. ``perfect_square`` (runs, 2): mean squared velocity
        error at the end without biases of the unit and errors of the map, tight and predictive filter,
        m²/s².
    """

    scenario: SmallBodyLanding
    runs: int
    seed: int
    arrays: dict[str, NDArray[Any]]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the filters."""
        return tuple(navigator.name for navigator in navigators(self.scenario))

    @cached_property
    def lost_names(self) -> tuple[str, ...]:
        """Names of the filters of the study of large first errors."""
        return tuple(navigator.name for navigator in lost_filters(self.scenario))

    @property
    def times(self) -> Array:
        """Epochs, s."""
        return fly(self.scenario).times

    @cached_property
    def late(self) -> NDArray[np.bool_]:
        """Epochs that count for averages."""
        return settled(self.scenario, self.times)

    def level(self, share: float) -> int:
        """Place of a gravity error in the arrays."""
        return self.scenario.gravity_errors.index(share)

    @property
    def worst(self) -> float:
        """The largest gravity error."""
        return max(self.scenario.gravity_errors)

    @property
    def least(self) -> float:
        """The smallest gravity error."""
        return min(self.scenario.gravity_errors)

    def squares(self, name: str, share: float) -> Array:
        """Squared errors of a filter at a gravity error, (runs, T, 3)."""
        return np.asarray(self.arrays["square"][:, self.level(share), self.names.index(name)])

    def end(self, name: str, share: float, part: int = POSITION) -> Array:
        """Mean square of one part over the end of the descent, (runs,)."""
        return np.asarray(self.squares(name, share)[:, -final_epochs(self.scenario) :, part].mean(axis=1))

    def average(self, name: str, share: float, part: int = POSITION) -> Array:
        """Mean square of one part over the settled epochs, (runs,)."""
        return np.asarray(self.squares(name, share)[:, self.late, part].mean(axis=1))

    def nees(self, name: str, share: float) -> Array:
        """Mean NEES over the settled epochs, divided by nine, (runs,)."""
        nees = self.arrays["nees"][:, self.level(share), self.names.index(name)]
        return np.asarray(nees[:, self.late].mean(axis=1) / 9)

    def limits(self) -> Array:
        """Errors below which a filter has converged: m, m/s, rad."""
        s = self.scenario
        return np.array([s.converged_position, s.converged_velocity, s.converged_attitude])

    def table(self) -> Table:
        """Every filter at every gravity error."""
        rows: list[tuple[Any, ...]] = []
        for name in self.names:
            for share in self.scenario.gravity_errors:
                error = np.sqrt(self.squares(name, share).mean(axis=0))
                cells = [np.sqrt(self.end(name, share, part).mean()) for part in (POSITION, VELOCITY)]
                cells[1] *= 1e3
                cells.append(np.degrees(np.sqrt(self.end(name, share, ATTITUDE).mean())))
                cells.append(np.sqrt(self.average(name, share).mean()))
                cells.append(convergence(error, self.times, self.limits()))
                cells.append(self.nees(name, share).mean())
                rows.append((name, 100 * share, *(float(cell) for cell in cells)))
        columns: tuple[str, ...] = ("filter", "gravity error [%]", "position [m]", "velocity [mm/s]")
        columns += ("attitude [deg]", "average [m]", "converged [s]", "NEES/9")
        s = self.scenario
        title = (
            f"{self.runs} landings: RMSE of the last {s.final_window:g} s; average, NEES from {s.settled:g} s"
        )
        return Table(title, columns, tuple(rows))

    def outage_squares(self) -> Array:
        """Squared position errors from the beginning of the outage on, (runs, 4, T')."""
        return np.asarray(self.arrays["outage_square"][..., self.times >= self.scenario.outage_start])

    def outage_table(self) -> Table:
        """The velocimeter's outage."""
        error = np.sqrt(self.outage_squares().mean(axis=0))
        rows = tuple((name, float(error[k].max())) for k, name in enumerate(OUTAGE))
        s = self.scenario
        title = (
            f"No velocimeter for {s.outage_duration:g} s, an image every {s.outage_images:g} s, "
            "gravity error "
            f"{100 * self.worst:g} %"
        )
        return Table(title, ("filter", "worst RMSE of position [m]"), rows)

    def latency_table(self) -> Table:
        """Old images."""
        values = np.sqrt(self.arrays["latency_square"].mean(axis=0))
        rows = tuple(
            (float(latency), float(ignored), float(known))
            for latency, (ignored, known) in zip(self.scenario.latencies, values, strict=True)
        )
        columns = ("age of the images [s]", "ignored: position [m]", "clones: position [m]")
        return Table(f"Old images, average from {self.scenario.settled:g} s", columns, rows)

    def map_table(self) -> Table:
        """Treatments of the map."""
        last = final_epochs(self.scenario)
        rows = []
        for k, kind in enumerate(MAP_ERRORS):
            square = self.arrays["map_square"][:, k]
            cells = [np.sqrt(square[:, -last:, part].mean()) for part in (POSITION, VELOCITY)]
            cells = [cells[0], 1e3 * cells[1], self.arrays["map_nees"][:, k][:, self.late].mean() / 9]
            rows.append((kind, *(float(cell) for cell in cells)))
        columns = ("errors of the map", "position [m]", "velocity [mm/s]", "NEES/9")
        title = f"Errors of the map, {self.scenario.landmark_sigma:g} m per axis; the end, NEES on average"
        return Table(title, columns, tuple(rows))

    def lost(self) -> Array:
        """Share of lost filters, (3, filters)."""
        distance = self.arrays["lost_distance"]
        return np.asarray(np.mean(~(distance < self.scenario.lost_position), axis=0))

    def lost_table(self) -> Table:
        """Large first errors."""
        shares = 100 * self.lost()
        rows = tuple(
            (name, *(float(shares[k, i]) for k in range(len(STARTS))))
            for i, name in enumerate(self.lost_names)
        )
        s = self.scenario
        columns = (
            "filter",
            f"{s.large_position:g} m [%]",
            f"{np.degrees(s.large_attitude):g} deg [%]",
            "both [%]",
        )
        title = f"Filters more than {s.lost_position:g} m off at the end, from large first errors (1-sigma)"
        return Table(title, columns, rows)

    def near_table(self) -> Table:
        """Truth a polyhedron, the filters' gravity the harmonics of the same body."""
        last = final_epochs(self.scenario)
        rows = []
        for k, name in enumerate(self.names):
            square, nees = self.arrays["near_square"][:, k], self.arrays["near_nees"][:, k]
            cells = [np.sqrt(square[:, -last:, part].mean()) for part in (POSITION, VELOCITY)]
            rows.append((name, float(cells[0]), float(1e3 * cells[1]), float(nees[:, self.late].mean() / 9)))
        columns = ("filter", "position [m]", "velocity [mm/s]", "NEES/9")
        return Table("Truth a polyhedron, filters with its harmonics of degree 4", columns, tuple(rows))

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report."""
        return (
            self.table(),
            self.outage_table(),
            self.latency_table(),
            self.map_table(),
            self.lost_table(),
            self.near_table(),
        )

    def claims(self) -> Claims:
        """The published claims, each part judged with what these runs measured."""
        from losnav.scenarios.small_body_landing.claims import judge_claims

        return judge_claims(self)

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as PNG files into the folder ``path`` (needs the ``plot`` extra) and return their
        paths.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.scenarios.small_body_landing.figures import draw_all

        return draw_all(self, Path(path))

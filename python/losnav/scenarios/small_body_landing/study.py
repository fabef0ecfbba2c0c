"""One block of Monte Carlo runs: every study on the same draws, each filter as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from losnav import landing
from losnav.dynamics import Imu
from losnav.scenarios.small_body_landing.estimators import (
    Navigator,
    estimate,
    first_sigmas,
    navigators,
)
from losnav.scenarios.small_body_landing.sensing import Measured, measure
from losnav.scenarios.small_body_landing.truth import fly, shape_harmonics

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing import SmallBodyLanding

__all__ = [
    "MAP_ERRORS",
    "OUTAGE",
    "STARTS",
    "UPDATES",
    "LandingTask",
    "final_epochs",
    "lost_filters",
    "settled",
]

Array = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

#: Treatments of the map, in the order of the arrays ``map_*``.
MAP_ERRORS = ("ignore", "white", "consider", "estimate")
#: Filters of the outage study, by name.
OUTAGE = ("EKF, tight", "predictive", "EKF, tuned", "EKF, acceleration")
#: First errors of the study of lost filters.
STARTS = ("position", "attitude", "both")
#: Kinds of update of that study, and the options of the filter.
UPDATES: dict[str, dict[str, Any]] = {
    "plain": {},
    "iterated": {"iterations": 5},
    "underweighted": {"underweighting": 1.0},
}
_BEST = "EKF, acceleration"


@dataclass(frozen=True)
class LandingTask:
    """The task of the campaign: seeds of a block in, arrays with one row for each run out."""

    scenario: SmallBodyLanding

    def __call__(self, seeds: Sequence[SeedSequence], /) -> Arrays:
        s = self.scenario
        measured = measure(fly(s), seeds)
        arrays = self._comparison(measured) | self._outage(measured) | self._latency(measured)
        arrays |= self._map(measured) | self._lost(measured)
        return arrays | self._near_surface(seeds) | self._units(seeds)

    def _comparison(self, measured: Measured) -> Arrays:
        """Every filter at every gravity error; in full where it is largest."""
        s, field = self.scenario, measured.flight.gravity
        squares, nees, worst = [], [], []
        for share in s.gravity_errors:
            made = [estimate(n, measured, field.scaled(1.0 - share)) for n in navigators(s)]
            squares.append(np.stack([_squares(e.error) for e in made], axis=1))
            nees.append(np.stack([e.nees for e in made], axis=1))
            if share == max(s.gravity_errors):
                worst = made
        return {
            "square": np.stack(squares, axis=1),
            "nees": np.stack(nees, axis=1),
            "error": np.stack([e.error for e in worst], axis=1),
            "sigma": np.stack([e.sigma for e in worst], axis=1),
            "disturbance": np.stack([e.disturbance for e in worst], axis=1),
            "bias": measured.accelerometer_bias,
        }

    def _named(self, *names: str) -> list[Navigator]:
        known = {navigator.name: navigator for navigator in navigators(self.scenario)}
        return [known[name] for name in names]

    def _outage(self, measured: Measured) -> Arrays:
        """The velocimeter silent and few images, at the largest gravity error."""
        s, times = self.scenario, measured.flight.times
        begin, end = s.outage_start, s.outage_start + s.outage_duration
        velocity = landing.outage(measured.velocity, times, begin, end)
        out = (times >= begin) & (times < end)
        kept = np.isclose(np.mod(times - begin, s.outage_images), 0.0)
        pixels = np.array(measured.pixels)
        pixels[:, out & ~kept] = np.nan
        field = measured.flight.gravity.scaled(1.0 - max(s.gravity_errors))
        made = [estimate(n, measured, field, pixels=pixels, velocity=velocity) for n in self._named(*OUTAGE)]
        return {"outage_square": np.stack([_squares(e.error)[..., 0] for e in made], axis=1)}

    def _latency(self, measured: Measured) -> Arrays:
        """Old images: taken for fresh ones, and known to be old (axis 2), with the true gravity."""
        s, (best,) = self.scenario, self._named(_BEST)
        field, late, rows = measured.flight.gravity, settled(self.scenario, measured.flight.times), []
        for latency in s.latencies:
            arrived = landing.arriving(measured.pixels, round(latency / s.sampling))
            pair = [
                estimate(best, measured, field, pixels=arrived),
                estimate(best, measured, field, latency=latency),
            ]
            rows.append(np.stack([_squares(e.error)[:, late, 0].mean(axis=1) for e in pair], axis=1))
        return {"latency_square": np.stack(rows, axis=1)}

    def _map(self, measured: Measured) -> Arrays:
        """Treatments of the map's errors, with the true gravity."""
        (best,), field = self._named(_BEST), measured.flight.gravity
        made = [estimate(replace(best, map_errors=kind), measured, field) for kind in MAP_ERRORS]
        return {
            "map_square": np.stack([_squares(e.error) for e in made], axis=1),
            "map_nees": np.stack([e.nees for e in made], axis=1),
        }

    def _lost(self, measured: Measured) -> Arrays:
        """Large first errors: the position error at the end, and NEES of the first epochs."""
        s, field = self.scenario, measured.flight.gravity
        distances, first = [], []
        for kind in STARTS:
            sigmas = first_sigmas(s)
            if kind != "attitude":
                sigmas[:3] = s.large_position
            if kind != "position":
                sigmas[6:] = s.large_attitude
            made = [estimate(n, measured, field, sigmas=sigmas) for n in lost_filters(s)]
            end = [np.sqrt(_squares(e.error)[:, -final_epochs(s) :, 0].mean(axis=1)) for e in made]
            distances.append(np.stack(end, axis=1))
            first.append(np.stack([e.nees[:, :10].mean(axis=1) for e in made], axis=1))
        return {"lost_distance": np.stack(distances, axis=1), "lost_nees": np.stack(first, axis=1)}

    def _near_surface(self, seeds: Sequence[SeedSequence]) -> Arrays:
        """Truth a polyhedron, the filters' gravity the harmonics of the same body."""
        flight = fly(self.scenario, "polyhedron")
        measured, field = measure(flight, seeds), shape_harmonics(self.scenario)
        made = [estimate(n, measured, field) for n in navigators(self.scenario)]
        return {
            "near_square": np.stack([_squares(e.error) for e in made], axis=1),
            "near_nees": np.stack([e.nees for e in made], axis=1),
        }

    def _units(self, seeds: Sequence[SeedSequence]) -> Arrays:
        """Other inertial units, with the true gravity.

        A micromechanical one, with the tuned filter without and with the biases among its states; and one
        without biases, with a map without errors and the tight and the predictive filter.
        """
        s, flight = self.scenario, fly(self.scenario)
        late = settled(s, flight.times)

        def both(unit: Imu, pair: Sequence[Navigator], **world: float) -> list[Array]:
            measured = measure(flight, seeds, imu=unit, **world)
            return [_squares(estimate(n, measured, flight.gravity, unit=unit).error) for n in pair]

        tight, predictive, tuned = self._named("EKF, tight", "predictive", "EKF, tuned")
        mems = both(Imu.mems(), (tuned, replace(tuned, name="with biases", biases=True)))
        unbiased = Imu(s.unit.velocity_random_walk, s.unit.angle_random_walk)
        pair = [replace(navigator, map_errors="ignore") for navigator in (tight, predictive)]
        perfect = both(unbiased, pair, map_sigma=0.0)
        last = final_epochs(s)
        return {
            "mems_square": np.stack([square[:, late, 2].mean(axis=1) for square in mems], axis=1),
            "perfect_square": np.stack([square[:, -last:, 1].mean(axis=1) for square in perfect], axis=1),
        }


def lost_filters(scenario: SmallBodyLanding) -> list[Navigator]:
    """Filters of the study of large first errors: all of the comparison, and other updates of the best."""
    everyone = list(navigators(scenario))
    best = next(navigator for navigator in everyone if navigator.name == _BEST)
    varied = [
        replace(best, name=f"{best.name}, {kind}", options=options)
        for kind, options in UPDATES.items()
        if options
    ]
    return everyone + varied


def settled(scenario: SmallBodyLanding, times: Array) -> NDArray[np.bool_]:
    """Epochs whose errors count for averages."""
    return np.asarray(times > scenario.settled)


def final_epochs(scenario: SmallBodyLanding) -> int:
    """Number of epochs of the end of a descent."""
    return max(1, round(scenario.final_window / scenario.sampling))


def _squares(error: Array) -> Array:
    """Squared norms of the errors of position, velocity and attitude, (..., 3)."""
    return np.asarray(np.square(error).reshape((*error.shape[:-1], 3, 3)).sum(axis=-1))

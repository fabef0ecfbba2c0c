"""One block of Monte Carlo runs: both arcs and their variations on the same draws, each as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import NDArray

import losnav as ln

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = ["Case", "SunTask", "cases", "kept_epochs", "normalised"]

Array = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]

# Epochs of an arc whose errors are kept.
_KEPT = 100


@dataclass(frozen=True)
class Case:
    """A variation of one of the arcs.

    Attributes
    ----------
    name : str
    arc : {"backward", "forward"}
    factor : float
        The first error is so many times larger, and the filter is told.
    iterations : int
        Linearisations of each measurement.
    seen : bool
        Directions are those a moving observer sees.
    modelled : bool
        The filter knows that.
    doppler : bool
        The radial velocity is measured too.
    """

    name: str
    arc: str
    factor: float = 1.0
    iterations: int = 1
    seen: bool = False
    modelled: bool = False
    doppler: bool = False


def cases(scenario: SunLineOfSight) -> tuple[Case, ...]:
    """All variations, in the order of the arrays ``case_*``."""
    s, listed = scenario, []
    for arc in ("backward", "forward"):
        for iterations in (1, s.iterations):
            words = "once" if iterations == 1 else "iterated"
            listed.append(Case(f"large error, {words}, {arc}", arc, s.large_factor, iterations))
    listed.append(Case("aberration ignored", "backward", seen=True))
    listed.append(Case("aberration modelled", "backward", seen=True, modelled=True))
    listed.append(Case("Doppler, forward", "forward", doppler=True))
    return tuple(listed)


def kept_epochs(scenario: SunLineOfSight) -> NDArray[np.intp]:
    """Indices of the epochs whose errors are kept: evenly spread, the last among them."""
    count = len(scenario.forward.times)
    kept = min(_KEPT, count)
    return np.asarray(np.round(np.arange(1, kept + 1) * count / kept), dtype=np.intp) - 1


@dataclass(frozen=True)
class Draws:
    """Standard normal draws of a block: first errors (runs, 6), directions (runs, T, 3), rates (runs, T)."""

    first: Array
    direction: Array
    rate: Array

    @staticmethod
    def of(seeds: Sequence[SeedSequence], epochs: int) -> Draws:
        """The numbers of each run from its own seed."""
        every = [default_rng(seed).standard_normal(6 + 4 * epochs) for seed in seeds]
        rows = np.stack(every)
        rest = rows[:, 6:].reshape(len(seeds), epochs, 4)
        return Draws(rows[:, :6], rest[..., :3], rest[..., 3])


@dataclass(frozen=True)
class SunTask:
    """The task of the campaign: seeds of a block in, arrays with one row for each run out."""

    scenario: SunLineOfSight

    def __call__(self, seeds: Sequence[SeedSequence], /) -> Arrays:
        s = self.scenario
        draws = Draws.of(seeds, len(s.forward.times))
        arrays: Arrays = {}
        for arc in ("backward", "forward"):
            found = self._filtered(Case(arc, arc), draws)
            arrays |= {f"{arc}_{name}": values for name, values in found.items()}
        rows = [self._filtered(case, draws) for case in cases(s)]
        for name in ("error", "nees", "nis"):
            arrays[f"case_{name}"] = np.stack([row[name] for row in rows], axis=1)
        return arrays

    def _filtered(self, case: Case, draws: Draws) -> Arrays:
        """Errors, predicted 1-sigma, NEES at the epochs kept, and the mean NIS since the one before."""
        s, arc = self.scenario, getattr(self.scenario, case.arc)
        seen = ln.sensors.SunDirection(s.sigma, aberration=case.seen)
        measured: list[tuple[Any, Array]] = [
            (
                ln.sensors.SunDirection(s.sigma, aberration=case.modelled),
                seen.predict(arc.truth) + s.sigma * draws.direction,
            )
        ]
        if case.doppler:
            rate = ln.sensors.RangeRate(s.doppler_sigma)
            noise = s.doppler_sigma * draws.rate[..., np.newaxis]
            measured.append((rate, rate.predict(arc.truth) + noise))
        prior = case.factor**2 * s.prior
        first = s.start + draws.first * np.sqrt(np.diagonal(prior))
        ekf = ln.ExtendedKalmanFilter(s.dynamics, first, prior, iterations=case.iterations)
        log = ekf.run(arc.times, measured)
        kept = kept_epochs(s)
        error, covariance = arc.truth[kept] - log.state[:, kept], log.covariance[:, kept]
        since = np.concatenate([[0], kept[:-1] + 1])
        return {
            "error": error,
            "sigma": np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)),
            "nees": normalised(error, covariance),
            "nis": np.add.reduceat(log.nis[..., 0], since, axis=1) / np.diff(since, append=kept[-1] + 1),
        }


def normalised(error: Array, covariance: Array) -> Array:
    """Normalised squared errors ``e' P^-1 e``, (...), of covariances whose units differ by many decades."""
    sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    unit = covariance / sigma[..., :, None] / sigma[..., None, :]
    e = error / sigma
    return np.asarray((e * np.linalg.solve(unit, e[..., None])[..., 0]).sum(axis=-1))

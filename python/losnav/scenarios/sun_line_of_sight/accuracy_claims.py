"""Claims 7 to 9: which of the two systems is better, and how good they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import binomial_interval
from losnav.scenarios.intervals import CONFIDENCE, percent, resampled, resampled_median, scaled_mean
from losnav.scenarios.judging import computed, ratio, sampled, text
from losnav.scenarios.sun_line_of_sight.arcs import noise_readings, rss
from losnav.scenarios.sun_line_of_sight.result import ARCS, KM, POSITION, VELOCITY
from losnav.scenarios.sun_line_of_sight.study import normalised
from losnav.scenarios.verdicts import Claim, judge

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult

__all__ = ["accuracy_claims"]

Array = NDArray[np.float64]

# Converged: rms of the position below this, m.
_CONVERGED = 6e6
# A printed single run is believable if at least this share of runs ends as well.
_BELIEVABLE = 0.05
# Printed final errors of the two systems, m and m/s.
_PRINTED = {"backward": (450e3, 0.075), "forward": (147e3, 0.029)}


def accuracy_claims(result: SunLineOfSightResult) -> list[Claim]:
    """Claims 7, 8 and 9."""
    return [
        *_order(result),
        _reached(result),
        _process_noise(result),
        *_printed(result, "backward", "8"),
        *_printed(result, "forward", "9"),
        _below_the_bound(result),
    ]


def _order(result: SunLineOfSightResult) -> list[Claim]:
    """7a to 7c: system 1 is the slower and the less accurate one."""
    both = np.concatenate([result.squares(arc) for arc in ARCS], axis=1)
    times, count = result.times, len(result.times)

    def quotient(mean: Array) -> Array:
        """Time to stay below the limit, system 1 over system 2."""
        since = []
        for part in (mean[..., :count], mean[..., count:]):
            late = np.where(part > _CONVERGED**2, np.arange(count) + 1, 0).max(axis=-1)
            since.append(times[np.minimum(late, count - 1)])
        return np.asarray(since[0] / since[1])

    speed = resampled(both, quotient)
    alone = []
    for arc in ARCS:
        late = np.flatnonzero(result.squares(arc).mean(axis=0) > _CONVERGED**2)
        alone.append(times[min(late[-1] + 1 if late.size else 0, count - 1)])
    claims = [
        sampled(
            speed,
            number="7a",
            statement="System 1 (backward, low degree) converges more slowly than system 2 (forward, high "
            "degree)",
            printed="yes",
            ours=f"rms below {_CONVERGED / KM:.0f} km from {alone[0]:.2g} s on against {alone[1]:.2g} s: x "
            f"{text(speed)}",
            verdict=judge(speed[1], above=1.0),
            why="The fast arc through the perihelion bends more in the same time, and bending is what tells "
            "the "
            "distance.",
            established="does not",
        )
    ]
    for letter, words, part, unit, scale in (
        ("b", "position", POSITION, "km", 1 / KM),
        ("c", "velocity", VELOCITY, "mm/s", 1e3),
    ):
        ends = np.stack([result.squares(arc, part)[:, -1] for arc in ARCS], axis=1)
        worse = resampled(ends, ratio)
        rms = scale * np.sqrt(ends.mean(axis=0))
        best = [scale * float(rss(result.bound(arc)[-1])[part == VELOCITY]) for arc in ARCS]
        claims.append(
            sampled(
                worse,
                number=f"7{letter}",
                statement=f"System 1 ends with the larger error of {words}",
                printed="yes",
                ours=f"rms {rms[0]:.4g} against {rms[1]:.4g} {unit}: x {text(worse)}",
                verdict=judge(worse[1], above=1.0),
                why=f"Cramér-Rao bound {best[0]:.4g} and {best[1]:.4g} {unit}: no filter can have the "
                f"printed "
                "order under the stated conditions.",
                established="does not",
            )
        )
    return claims


def _reached(result: SunLineOfSightResult) -> Claim:
    """7d: the filters reach the bound, so that the order is no fault of theirs."""
    every = [normalised(result.arc(arc)["error"][:, -1], result.bound(arc)[-1]) for arc in ARCS]
    mean, interval = scaled_mean(np.concatenate(every))
    each = ", ".join(f"{np.mean(values):.2f} ({arc})" for arc, values in zip(ARCS, every, strict=True))
    inside = interval[0] <= 6.0 <= interval[1]
    return sampled(
        (mean, interval),
        number="7d",
        statement="The filter's errors have the covariance of the Cramér-Rao bound",
        printed="-",
        ours=f"normalised by the bound {each}; both {text((mean, interval))}, where 6 is right",
        verdict="holds" if inside else "does not",
        why="Squared final errors e' B^-1 e of all runs; exact chi-square interval of 99.9 %.",
        established="holds",
    )


def _process_noise(result: SunLineOfSightResult) -> Claim:
    """7e: what the missing unit of the process noise may explain."""
    readings = noise_readings(result.scenario)
    largest = max(arcs["backward"] / arcs["forward"] for arcs in readings.values())
    listed = "; ".join(
        f"{words} {arcs['backward'] / KM:.0f} and {arcs['forward'] / KM:.0f} km"
        for words, arcs in readings.items()
    )
    return computed(
        largest,
        number="7e",
        statement=f"With some unit of the process noise {result.scenario.published_noise:g} I system 1 is "
        f"the "
        "worse one",
        printed="-",
        ours=f"bound of systems 1 and 2: {listed}",
        verdict=judge((largest, largest), above=1.0),
        why="The publication gives a number without a unit.",
        established="does not",
    )


def _printed(result: SunLineOfSightResult, arc: str, number: str) -> list[Claim]:
    """8 and 9: the printed final errors, as those of a single run."""
    claims = []
    system = ARCS.index(arc) + 1
    for letter, words, part, limit, unit, scale in (
        ("a", "position", POSITION, _PRINTED[arc][0], "km", 1 / KM),
        ("b", "velocity", VELOCITY, _PRINTED[arc][1], "km/s", 1e-3),
    ):
        end = np.sqrt(result.squares(arc, part)[:, -1])
        within = int((end <= limit).sum())
        share = within / len(end), binomial_interval(within, len(end), CONFIDENCE)
        typical = text(resampled_median(scale * end), form=".4g")
        claims.append(
            sampled(
                share,
                number=f"{number}{letter}",
                statement=f"System {system} ends with {scale * limit:g} {unit} ({words}): believable for "
                f"one run",
                printed=f"{scale * limit:g} {unit}",
                ours=f"{percent(*share)} of the runs end as well; median {typical} {unit}",
                verdict=judge(share[1], above=_BELIEVABLE),
                why=f"Asked: at least {_BELIEVABLE:.0%} of the runs. Interval of Clopper and Pearson."
                + (
                    ""
                    if arc == "backward"
                    else " Read as 3-sigma noise and with the systems swapped all four "
                    "printed numbers would be medians; a single pair of runs cannot tell."
                ),
                established="holds" if arc == "backward" else "does not",
            )
        )
    return claims


def _below_the_bound(result: SunLineOfSightResult) -> Claim:
    """9c: the printed error of system 2 as a standard deviation."""
    position, velocity = (float(x) for x in rss(result.bound("forward")[-1]))
    limit, speed = _PRINTED["forward"]
    return computed(
        position / limit,
        number="9c",
        statement="147 km is what system 2 reaches on average",
        printed="147 km",
        ours=f"Cramér-Rao bound {position / KM:.0f} km, {position / limit:.0f} times more "
        f"(velocity {velocity / speed:.0f} times)",
        verdict=judge((position / limit,) * 2, below=1.0),
        why="The covariance no unbiased filter can beat, from prior and measurements as stated.",
        established="does not",
    )

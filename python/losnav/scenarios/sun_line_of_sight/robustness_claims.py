"""Beyond the publication, 11 to 13: large first errors, aberration, Doppler."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import binomial_interval, chi2_quantile
from losnav.constants import SPEED_OF_LIGHT
from losnav.scenarios.intervals import BAND, CONFIDENCE, percent, resampled, scaled_mean
from losnav.scenarios.judging import first, ratio, sampled, text
from losnav.scenarios.sun_line_of_sight.arcs import more_information, rss
from losnav.scenarios.sun_line_of_sight.result import ARCS, KM, POSITION
from losnav.scenarios.verdicts import Claim, judge

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult

__all__ = ["robustness_claims"]

Array = NDArray[np.float64]

# A filter is alive if so many runs end inside the ellipsoid of probability BAND.
_ALIVE = 0.85
# NIS of two degrees of freedom above which a filter is told that something is wrong.
_ALARM = 2.05


def robustness_claims(result: SunLineOfSightResult) -> list[Claim]:
    """Claims 11, 12 and 13."""
    return [*_large_errors(result), *_aberration(result), _doppler(result)]


def _large_errors(result: SunLineOfSightResult) -> list[Claim]:
    """11: a first error so large that one linearisation does not do."""
    s = result.scenario
    limit = float(chi2_quantile(BAND, 6))
    claims = []
    for letter, words, what, established in (
        ("a", "once", "the filter converges", "does not"),
        ("b", "iterated", f"linearising each measurement {s.iterations} times saves it", "holds"),
    ):
        nees = np.concatenate([result.arc(f"large error, {words}, {arc}")["nees"][:, -1] for arc in ARCS])
        alive = int((nees < limit).sum())
        share = alive / nees.size, binomial_interval(alive, nees.size, CONFIDENCE)
        ends = ", ".join(
            f"{np.sqrt(np.median(result.squares(f'large error, {words}, {arc}')[:, -1])) / KM:.4g} km ({arc})"
            for arc in ARCS
        )
        claims.append(
            sampled(
                share,
                number=f"11{letter}",
                statement=f"From a first error {s.large_factor:g} times larger {what}",
                printed="-",
                ours=f"{percent(*share)} of the runs end inside their 99.9 % ellipsoid; median error {ends}, "
                f"median NEES {np.median(nees):.3g}, mean {nees.mean():.3g}",
                verdict=judge(share[1], above=_ALIVE),
                why=f"{s.large_factor * s.initial_position_error / KM:.2g} km and "
                f"{s.large_factor * s.initial_velocity_error / KM:g} km/s per axis. Asked: {_ALIVE:.0%} of "
                f"the "
                "runs; NEES of a consistent filter is 6.",
                established=established,
            )
        )
    nis = np.stack([result.arc(f"large error, once, {arc}")["nis"].mean(axis=1) for arc in ARCS])
    mean = resampled(nis.mean(axis=0)[:, None], first)
    claims.append(
        sampled(
            mean,
            number="11c",
            statement="The filter that does not converge says so by its innovations",
            printed="-",
            ours=f"mean NIS {text(mean)}, where 2 is right",
            verdict=judge(mean[1], above=_ALARM),
            why=f"Mean over the arc and the runs; asked: above {_ALARM}.",
            established="holds",
        )
    )
    return claims


def _aberration(result: SunLineOfSightResult) -> list[Claim]:
    """12: stellar aberration."""
    ignored, modelled = (result.arc(f"aberration {word}") for word in ("ignored", "modelled"))
    distance = np.sqrt(result.squares("aberration ignored")[:, -1])
    bias = resampled(distance[:, None] / KM, first)
    best = float(rss(result.bound("backward")[-1])[0]) / KM
    nis = ignored["nis"].mean(axis=1)
    alarm = resampled(nis[:, None], first)
    nees = scaled_mean(modelled["nees"][:, -1])
    arc = result.scenario.backward.truth
    across = np.linalg.norm(np.cross(arc[:, :3], arc[:, 3:]), axis=1) / np.linalg.norm(arc[:, :3], axis=1)
    angle = across / SPEED_OF_LIGHT
    return [
        sampled(
            bias,
            number="12a",
            statement="Stellar aberration may be left out",
            printed="-",
            ours=f"error {text(bias)} km, NEES {ignored['nees'][:, -1].mean():.2g}",
            verdict=judge(bias[1], below=2 * best),
            why=f"The Sun is seen {1e4 * angle.min():.1f} to {1e4 * angle.max():.1f} e-4 rad from where it "
            f"is, "
            f"sigma {1e4 * result.scenario.sigma:g} e-4. Asked: at most twice the bound of {best:.0f} km.",
            established="does not",
        ),
        sampled(
            alarm,
            number="12b",
            statement="If it is left out, the innovations tell",
            printed="-",
            ours=f"mean NIS {text(alarm, form='.4f')}, where 2 is right",
            verdict=judge(alarm[1], above=_ALARM),
            why="The wrong directions are those of another orbit, to which the filter converges. No test of "
            "innovations can see it.",
            established="does not",
        ),
        sampled(
            nees,
            number="12c",
            statement="A sensor that knows of it repairs the filter",
            printed="-",
            ours=f"NEES {text(nees)}, where 6 is right; rms "
            f"{np.sqrt(result.squares('aberration modelled')[:, -1].mean()) / KM:.0f} km",
            verdict="holds" if nees[1][0] <= 6.0 <= nees[1][1] else "does not",
            why="SunDirection(sigma, aberration=True); exact chi-square interval of 99.9 %.",
            established="holds",
        ),
    ]


def _doppler(result: SunLineOfSightResult) -> Claim:
    """13: the radial velocity."""
    s = result.scenario
    ends = [result.squares(name, POSITION)[:, -1] for name in ("forward", "Doppler, forward")]
    gain = resampled(np.stack(ends, axis=1), ratio)
    rms = [np.sqrt(end.mean()) / KM for end in ends]
    best = float(rss(result.bound("forward", doppler=True)[-1])[0]) / KM
    others = "; ".join(f"{words}: {position / KM:.0f} km" for words, position, _ in more_information(s))
    return sampled(
        gain,
        number="13",
        statement=f"Doppler to the Sun of {s.doppler_sigma:g} m/s makes system 2 five times better",
        printed="-",
        ours=f"rms {rms[0]:.0f} -> {rms[1]:.0f} km: x {text(gain)}; bound {best:.0f} km",
        verdict=judge(gain[1], above=5.0),
        why=f"Bounds with one look in two hours: {others} (planets on circles, from longitude 0).",
        established="holds",
    )

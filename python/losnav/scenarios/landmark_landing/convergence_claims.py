"""Claims 5 and 6: how many iterations GLSDC and LM need, and from where they reach the right pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.intervals import CONFIDENCE, identity, percent, ratio, resampled, span
from losnav.scenarios.verdicts import Claim, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing.result import LandingResult

__all__ = ["convergence_claims"]

# Differences of iteration counts smaller than this are no effect, however well they are measured.
_NOTICEABLE = 0.05

_WARM: tuple[tuple[str, str, str, Verdict], ...] = (
    ("b", "glsdc", "GLSDC", "does not"),
    ("c", "lm", "LM", "holds"),
)


def convergence_claims(result: LandingResult) -> list[Claim]:
    """Claims 5 and 6, paired over the same images."""
    return [*_iterations(result), *_epochs(result)]


def _iterations(result: LandingResult) -> list[Claim]:
    """5: LM converges in fewer iterations than GLSDC."""
    a = result.arrays
    warm_gn, warm_lm = (a[f"{name}_iterations"][:, 1:].astype(float) for name in ("glsdc", "lm"))
    value, interval = resampled((warm_gn - warm_lm).mean(axis=1), identity)
    fewer, fewer_interval = resampled((warm_lm < warm_gn).mean(axis=1), identity)
    return [
        Claim(
            number="5a",
            statement="LM needs fewer iterations than GLSDC on average (previous estimate as guess)",
            printed="fewer (Fig. 6)",
            ours=f"GLSDC {warm_gn.mean():.2f}, LM {warm_lm.mean():.2f}: LM fewer by {span(value, interval)}",
            value=value,
            interval=interval,
            confidence=CONFIDENCE,
            verdict=judge(interval, above=0.0),
            why="Printed stop test, rejected trials of LM counted, damping led by the gain ratio; paired, "
            "bootstrap over runs.",
            established="does not",
        ),
        Claim(
            number="5b",
            statement="LM needs fewer iterations on most images",
            printed="fewer (Fig. 6)",
            ours=f"{percent(fewer, fewer_interval)} of images",
            value=fewer,
            interval=fewer_interval,
            confidence=CONFIDENCE,
            verdict=judge(fewer_interval, above=0.5),
            why="Same runs as 5a, image by image.",
            established="does not",
        ),
        *_cold_iterations(result),
    ]


def _cold_iterations(result: LandingResult) -> list[Claim]:
    far = _far_cells(result)
    if not far.any():
        return []
    good = {name: result.arrays[f"cold_{name}_success"][:, far].astype(float) for name in ("gn", "lm")}
    count = {name: result.arrays[f"cold_{name}_iterations"][:, far].astype(float) for name in ("gn", "lm")}
    both = good["gn"] * good["lm"]
    pairs = np.stack([(both * (count["lm"] < count["gn"])).sum(axis=1), both.sum(axis=1)], axis=1)
    fewer, fewer_interval = resampled(pairs, ratio)
    means = [float((both * count[name]).sum() / max(both.sum(), 1.0)) for name in ("gn", "lm")]
    limit = result.scenario.cold_max_iterations
    spent = {name: np.where(good[name] > 0, count[name], limit) for name in ("gn", "lm")}
    saved, saved_interval = resampled((spent["gn"] - spent["lm"]).mean(axis=1), identity)
    lead, lead_interval = resampled((good["lm"] - good["gn"]).mean(axis=1), identity)
    return [
        Claim(
            number="5c",
            statement="LM needs fewer iterations from far cold starts, where both succeed",
            printed="fewer",
            ours=f"in {percent(fewer, fewer_interval)} of them; mean GLSDC {means[0]:.2f}, LM {means[1]:.2f}",
            value=fewer,
            interval=fewer_interval,
            confidence=CONFIDENCE,
            verdict=judge(fewer_interval, above=0.5),
            why=f"{_far_text(result)}; stop at a relative change of {result.scenario.cold_cost_tolerance:g}.",
            established="does not",
        ),
        Claim(
            number="5d",
            statement="LM needs fewer iterations from far cold starts, all starts counted",
            printed="fewer",
            ours=f"GLSDC {spent['gn'].mean():.1f}, LM {spent['lm'].mean():.1f}: LM fewer by "
            f"{span(saved, saved_interval)}",
            value=saved,
            interval=saved_interval,
            confidence=CONFIDENCE,
            verdict=judge(saved_interval, above=0.0),
            why=f"A start that never reaches the right pose counts with the limit of {limit} iterations.",
            established="holds",
        ),
        Claim(
            number="5e",
            statement="LM reaches the right pose more often than GLSDC from far cold starts",
            printed="-",
            ours=f"LM {good['lm'].mean():.2%}, GLSDC {good['gn'].mean():.2%}: LM more by "
            f"{percent(lead, lead_interval)}",
            value=lead,
            interval=lead_interval,
            confidence=CONFIDENCE,
            verdict=judge(lead_interval, above=0.0),
            why="Success, not the number of iterations, is what LM is for.",
            established="holds",
        ),
    ]


def _cold_epochs(result: LandingResult) -> Claim:
    times, far = result.scenario.cold_times, _far_cells(result)[0]
    early, late = int(np.argmin(times)), int(np.argmax(times))
    success = result.arrays["cold_gn_success"].astype(float)
    at = {k: success[:, k, far].mean(axis=1) for k in (early, late)}
    value, interval = resampled(at[late] - at[early], identity)
    return Claim(
        number="6a",
        statement="From a cold start, early epochs are harder to converge (GLSDC)",
        printed="-",
        ours=f"success {at[early].mean():.0%} at {times[early]:.0f} s, {at[late].mean():.0%} at "
        f"{times[late]:.0f} s: gain {percent(value, interval)}",
        value=value,
        interval=interval,
        confidence=CONFIDENCE,
        verdict=judge(interval, above=0.0),
        why=f"{_far_text(result)}; the position scatter shrinks with the range.",
        established="holds",
    )


def _epochs(result: LandingResult) -> list[Claim]:
    """6: early epochs are harder to converge."""
    claims = [_cold_epochs(result)] if _far_cells(result).any() else []
    for letter, name, label, established in _WARM:
        iterations = result.arrays[f"{name}_iterations"][:, 1:].astype(float)
        thirds = np.stack([part.mean(axis=1) for part in np.array_split(iterations, 3, axis=1)], axis=1)
        value, interval = resampled(thirds[:, 0] - thirds[:, 2], identity)
        claims.append(
            Claim(
                number=f"6{letter}",
                statement=f"With the previous estimate as guess, early epochs need more iterations ({label})",
                printed="-",
                ours=f"{' / '.join(f'{mean:.2f}' for mean in thirds.mean(axis=0))} in the thirds of the "
                f"descent: {span(value, interval)}",
                value=value,
                interval=interval,
                confidence=CONFIDENCE,
                verdict=judge(interval, above=_NOTICEABLE),
                why="Mean of the first third minus the last, first image excepted; less than "
                f"{_NOTICEABLE:g} iteration is no effect.",
                established=established,
            )
        )
    return claims


def _far_cells(result: LandingResult) -> NDArray[np.bool_]:
    s = result.scenario
    offsets = np.array(s.cold_offsets) > np.min(s.cold_offsets)
    angles = np.array(s.cold_angles) > np.min(s.cold_angles)
    cells = offsets[:, None] & angles[None, :]
    return np.broadcast_to(cells, (len(s.cold_times), *cells.shape))


def _far_text(result: LandingResult) -> str:
    s = result.scenario
    angles = sorted(np.degrees(s.cold_angles))[1:]
    offsets = sorted(s.cold_offsets)[1:]
    return (
        f"Guesses scattered by {offsets[0]:.0f} to {offsets[-1]:.0f} m (as of t = 0) and {angles[0]:.0f} "
        f"to {angles[-1]:.0f} deg"
    )

"""Claims N1 to N4 of the landing, and the order of all of them.

A ratio of two RMSEs is that of two filters, or of two gravity errors, on the same draws; its interval is a
bootstrap over the runs. With 30 runs one RMSE scatters by 7 % (1-sigma) if its three axes share the error and
by 13 % if one of them has it, but ratios on the same draws by much less.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.intervals import resampled
from losnav.scenarios.judging import first, ratio, sampled, text
from losnav.scenarios.small_body_landing.information_claims import information_claims
from losnav.scenarios.small_body_landing.result import POSITION, VELOCITY, rms
from losnav.scenarios.small_body_landing.robustness_claims import robustness_claims
from losnav.scenarios.verdicts import Claim, Claims, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult

__all__ = ["judge_claims"]

Array = NDArray[np.float64]

_TIGHT, _PREDICTIVE, _TUNED, _BEST = "EKF, tight", "predictive", "EKF, tuned", "EKF, acceleration"
# What counts as growing, and as growing little.
_GROWS, _LITTLE, _EQUAL = 1.1, 1.25, 1.01
# More accurate by so much.
_BETTER = 0.9
# NEES over its expectation that still counts as consistent, and what treating the map as white costs at most.
_CONSISTENT = 1.15
# Times of convergence.
_FASTER = 0.5


def judge_claims(result: SmallBodyLandingResult) -> Claims:
    """All claims, in the order of the publication; those it does not make at the end."""
    families = (_growth, _little, _accuracy, _convergence, information_claims, robustness_claims)
    return Claims(claim for family in families for claim in family(result))


def _pair(numerator: Array, denominator: Array) -> tuple[float, tuple[float, float]]:
    """Ratio of two RMSEs from per-run mean squares."""
    return resampled(np.stack([numerator, denominator], axis=1), ratio)


def _values(result: SmallBodyLandingResult, name: str, part: int, scale: float, unit: str) -> str:
    """RMSE at the end from the smallest to the largest gravity error."""
    ends = [scale * np.sqrt(result.end(name, x, part).mean()) for x in (result.least, result.worst)]
    return f"{ends[0]:.3g} -> {ends[1]:.3g} {unit}"


def _both(result: SmallBodyLandingResult, name: str) -> str:
    return f"{_values(result, name, POSITION, 1.0, 'm')}, {_values(result, name, VELOCITY, 1e3, 'mm/s')}"


def _growth(result: SmallBodyLandingResult) -> list[Claim]:
    """N1: the error of the EKF grows with the error of gravity."""
    listed: tuple[tuple[str, str, str, float, Verdict], ...] = (
        ("a", _TIGHT, "the process noise of the inertial unit alone", _GROWS, "holds"),
        ("b", "EKF, bias constant", "constant biases among its states", _GROWS, "holds"),
        (
            "c",
            _TUNED,
            f"a process noise of {1e3 * result.scenario.tuned_noise:g} mm/s^2/sqrt(Hz)",
            _GROWS,
            "does not",
        ),
        ("d", _BEST, "an acceleration among its states", _EQUAL, "does not"),
    )
    claims = []
    for letter, name, words, limit, established in listed:
        grown = _pair(result.end(name, result.worst), result.end(name, result.least))
        claims.append(
            sampled(
                grown,
                number=f"1{letter}",
                statement=f"The error of the EKF grows with that of gravity: {words}",
                printed="grows",
                ours=f"position x {text(grown)}: {_both(result, name)}",
                verdict=judge(grown[1], above=limit),
                why=f"RMSE over the last {result.scenario.final_window:g} s with gravity "
                f"{100 * result.worst:g} % too small over that with {100 * result.least:g} %, same "
                "draws; asked: "
                f"more than {limit:g}. NEES/9 is {result.nees(name, result.least).mean():.3g} -> "
                f"{result.nees(name, result.worst).mean():.3g}.",
                established=established,
            )
        )
    return claims


def _little(result: SmallBodyLandingResult) -> list[Claim]:
    """N2: that of the predictive filter grows little."""
    claims = []
    for letter, part, word in (("a", POSITION, "position"), ("b", VELOCITY, "velocity")):
        grown = _pair(
            result.end(_PREDICTIVE, result.worst, part), result.end(_PREDICTIVE, result.least, part)
        )
        claims.append(
            sampled(
                grown,
                number=f"2{letter}",
                statement=f"The error of the predictive filter grows little: {word}",
                printed="little",
                ours=f"x {text(grown)}: {_both(result, _PREDICTIVE)}",
                verdict=judge(grown[1], below=_LITTLE),
                why=f"W = {result.scenario.predictive_weight:g} s^4/m^2; asked: less than {_LITTLE:g}.",
                established="holds",
            )
        )
    return claims


def _accuracy(result: SmallBodyLandingResult) -> list[Claim]:
    """N3: the predictive filter is more accurate than the EKF."""
    listed: tuple[tuple[str, str, int, str, Verdict], ...] = (
        ("a", _TIGHT, POSITION, "the tight one, position", "holds"),
        ("b", _TUNED, POSITION, "a tuned one, position", "does not"),
        ("c", "EKF, equal gain", VELOCITY, "one of equal gain, velocity", "does not"),
        ("d", _BEST, VELOCITY, "one that estimates an acceleration, velocity", "does not"),
    )
    claims, worst = [], result.worst
    for letter, name, part, words, established in listed:
        relative = _pair(result.end(_PREDICTIVE, worst, part), result.end(name, worst, part))
        claims.append(
            sampled(
                relative,
                number=f"3{letter}",
                statement=f"The predictive filter is more accurate than the EKF: {words}",
                printed="more accurate",
                ours=f"error x {text(relative)}; {_both(result, _PREDICTIVE)} against {_both(result, name)}",
                verdict=judge(relative[1], below=_BETTER),
                why=f"With gravity {100 * worst:g} % too small, same draws; asked: at least 10 % better.",
                established=established,
            )
        )
    return [*claims, _price(result), _consistency(result)]


def _price(result: SmallBodyLandingResult) -> Claim:
    """3e: with a perfect model."""
    square = result.arrays["perfect_square"]
    price = resampled(square[:, ::-1], ratio)
    tight, predictive = 1e3 * np.sqrt(square.mean(axis=0))
    return sampled(
        price,
        number="3e",
        statement="With a perfect model the predictive filter is as accurate as the EKF",
        printed="-",
        ours=f"velocity x {text(price)}: {predictive:.3g} mm/s against {tight:.2g} mm/s",
        verdict=judge(price[1], below=_GROWS),
        why="True gravity, an inertial unit without biases, a map without errors. Its gain cannot fall below "
        "a floor, whatever the covariance says: it takes the velocimeter's noise for a model error.",
        established="does not",
    )


def _consistency(result: SmallBodyLandingResult) -> Claim:
    """3f: its own covariance."""
    nees = np.stack([result.nees(name, result.worst) for name in (_PREDICTIVE, _TUNED)], axis=1)
    over = resampled(nees, lambda mean: np.asarray(mean[..., 0] / mean[..., 1]))
    return sampled(
        over,
        number="3f",
        statement="The covariance of the predictive filter is as good as that of a tuned EKF",
        printed="-",
        ours=f"NEES x {text(over)}: NEES/9 {nees[:, 0].mean():.3g} against {nees[:, 1].mean():.3g}",
        verdict=judge(over[1], below=_CONSISTENT),
        why="The covariance does not see the first of the two corrections by the same measurement. "
        "Both take the "
        "map's constant errors for white ones, which is the rest of the excess: see 8d.",
        established="does not",
    )


def _convergence(result: SmallBodyLandingResult) -> list[Claim]:
    """N4: the predictive filter converges faster."""
    s, times, limit = result.scenario, result.times, result.scenario.converged_position

    def reached(mean: Array) -> Array:
        below = rms(mean.reshape((*mean.shape[:-1], 2, -1))) < limit
        at = np.where(below.any(axis=-1), times[below.argmax(axis=-1)], times[-1] + s.sampling)
        return np.asarray(at[..., 0] / at[..., 1])

    square = [result.squares(name, result.worst)[..., POSITION] for name in (_PREDICTIVE, _TIGHT)]
    both = np.concatenate(square, axis=1)
    gained = resampled(both, reached)
    when = [float(times[np.argmax(rms(x.mean(axis=0)) < limit)]) for x in square]
    stays = [bool((rms(x.mean(axis=0))[result.late] < limit).all()) for x in square]
    beyond = (np.sqrt(square[1][:, result.late]) >= limit).mean(axis=1)
    share = resampled(beyond[:, np.newaxis], first)
    return [
        sampled(
            gained,
            number="4a",
            statement=f"The predictive filter converges faster: first RMSE of position below {limit:g} m",
            printed="faster",
            ours=f"time x {text(gained)}: {when[0]:g} s against {when[1]:g} s of the tight EKF",
            verdict=judge(gained[1], below=_FASTER),
            why=f"From {s.position_sigma:g} m and {np.degrees(s.attitude_sigma):g} deg per axis, gravity "
            f"{100 * result.worst:g} % too small; asked: in half the time. The first "
            "images decide, "
            "and they are the same for all.",
            established="does not",
        ),
        sampled(
            share,
            number="4b",
            statement="The tight EKF stays converged",
            printed="-",
            ours=f"beyond {limit:g} m for a share of {text(share, form='.2f')} of the time from "
            f"{s.settled:g} s on "
            f"(predictive: {'never' if stays[0] else 'also'})",
            verdict=judge(share[1], below=0.01),
            why="What looks like slow convergence is divergence: its covariance shrinks, its error does not.",
            established="does not",
        ),
    ]

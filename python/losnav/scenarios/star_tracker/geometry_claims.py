"""Claims 3 to 9: how accuracy depends on the angles between the heads, from covariances alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.scenarios.intervals import resampled
from losnav.scenarios.star_tracker.judging import ARCSEC, best_angle, computed, decided, triple
from losnav.scenarios.verdicts import Claim, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker
    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["geometry_claims", "sigmas_at"]

Array = NDArray[np.float64]

_ORTHOGONAL = math.pi / 2
_MEASURES = ("trace", "determinant", "worst")
# How far the best separation may lie from 90 degrees and still be called 90: what the search resolves.
_RESOLVED = math.radians(0.01)
_SAME = 1e-12
_PRINTED_GAIN = 0.30


def geometry_claims(result: StarTrackerResult) -> list[Claim]:
    """Claims 3 to 9, in order."""
    s = result.scenario
    return [
        *_separation(s),
        _frames(s),
        _star_distribution(s),
        _equal_axes(s),
        *_gains(result),
        *_asymmetric(s),
    ]


def sigmas_at(covariances: Array, angle: float, frame: int = 0) -> Array:
    """1-sigma of three heads in the symmetric geometry, in the axes of one of them, rad, (3,)."""
    return star_tracker.separation_sweep(covariances, angle, frame=frame).sigma


def _unequal(s: StarTracker) -> Array:
    return np.stack([np.diag(np.square(row)) for row in s.unequal_sigmas])


def _separation(s: StarTracker) -> list[Claim]:
    """3: the accuracy about z is best at 90 degrees, and so is every measure of the whole."""
    equal, unequal = np.stack([s.head_covariance] * 3), _unequal(s)
    top = math.radians(120.0)

    def best(covariances: Array, frame: int, measure: str) -> float:
        def value(angles: Array) -> Array:
            sweep = star_tracker.separation_sweep(covariances, angles, frame=frame)
            return sweep.sigma[:, 2] if measure == "z" else np.asarray(getattr(sweep, measure))

        return best_angle(value, s.sweep_step, top, s.sweep_step)

    found = [best(equal, 0, "z"), *(best(unequal, frame, "z") for frame in range(3))]
    whole = [best(heads, 0, measure) for heads in (equal, unequal) for measure in _MEASURES]
    claims = []
    for number, statement, angles, text in (
        (
            "3a",
            "The accuracy about z is best with the heads 90° apart",
            found,
            "z of a head: three equal heads, then each of three unequal ones",
        ),
        (
            "3b",
            "So are trace, determinant and the worst axis of the covariance",
            whole,
            "the three measures for equal, then for unequal heads; they do not depend on the frame",
        ),
    ):
        degrees = np.degrees(angles)
        low, high = float(degrees.min()), float(degrees.max())
        claims.append(
            computed(
                number,
                statement,
                "best at " + ", ".join(f"{angle:.2f}°" for angle in degrees),
                float(degrees[np.argmax(abs(degrees - 90))]),
                judge((low, high), above=90 - math.degrees(_RESOLVED), below=90 + math.degrees(_RESOLVED)),
                f"Minimum over 0 to 120° found to {math.degrees(_RESOLVED):g}°; {text}. For frames that are "
                "not a head's see P3b.",
                printed="90°",
                interval=(low, high),
                established="holds",
            )
        )
    return claims


def _frames(s: StarTracker) -> Claim:
    """4: another fusion frame, another split over the axes."""
    sweeps = [star_tracker.separation_sweep(_unequal(s), _ORTHOGONAL, frame=frame) for frame in range(3)]
    sigma, traces = np.stack([sweep.sigma for sweep in sweeps]), np.array([sweep.trace for sweep in sweeps])
    change = float(np.ptp(sigma, axis=0).max() / sigma.max())
    same = float(np.ptp(traces) / traces[0])
    return computed(
        "4",
        "Another fusion frame splits the accuracy differently over its axes",
        ", ".join(f"head {k + 1}: {triple(row)}" for k, row in enumerate(sigma)),
        change,
        change > 1e-3 and same < _SAME,
        f"Unequal heads, orthogonal; 1-sigma about x, y, z of each head's frame. Traces agree to {same:.0e}.",
        established="holds",
    )


def _star_distribution(s: StarTracker) -> Claim:
    """5: x and y differ a little, because stars are not spread evenly."""
    even = star_tracker.separation_sweep([s.head_covariance] * 3, np.radians(np.linspace(5, 120, 24))).sigma
    exact = float(np.max(abs(even[:, 0] - even[:, 1]) / even[:, 0]))
    head = star_tracker.Head(np.eye(3), s.fov, s.star_sigma)
    rng = np.random.default_rng(s.search_seed)
    mountings = star_tracker.separation_sweep([s.head_covariance] * 3, _ORTHOGONAL).mountings
    spread = []
    for stars in (s.stars, 100 * s.stars):
        fields = np.stack([[head.stars(stars, rng) for _ in range(3)] for _ in range(s.star_fields)])
        information = star_tracker.star_information(fields, s.star_sigma)
        fused = star_tracker.fused_covariance(np.linalg.inv(information), mountings)
        sigma = np.sqrt(np.diagonal(fused, axis1=-2, axis2=-1))
        spread.append(abs(sigma[:, 0] - sigma[:, 1]) / sigma.mean(axis=1))
    value, interval = resampled(spread[0], lambda mean: mean)
    many = float(spread[1].mean())
    return computed(
        "5",
        "The small difference between x and y comes from the distribution of the stars",
        f"{value:.2%} [{interval[0]:.2%}, {interval[1]:.2%}] with {s.stars} random stars a head, {many:.2%} "
        f"with {100 * s.stars}, {exact:.0e} with evenly spread ones",
        value,
        exact < 1e-9 and interval[0] > 5 * exact and many < 0.5 * interval[0],
        f"Mean of |σx − σy| over σ, {s.star_fields} random sets of three star fields, 90° apart; the "
        "symmetric geometry treats x and y alike at every separation if the heads are equal.",
        interval=interval,
        confidence=0.95,
        established="holds",
    )


def _equal_axes(s: StarTracker) -> Claim:
    """6: orthogonal heads give equal accuracy in the three axes."""
    sigma = sigmas_at(np.stack([s.head_covariance] * 3), _ORTHOGONAL)
    unequal = sigmas_at(_unequal(s), _ORTHOGONAL)
    spread = float(np.ptp(sigma) / sigma.mean())
    return computed(
        "6",
        "Orthogonal heads give equal accuracy in all three axes",
        f"{triple(sigma)} for equal heads; {triple(unequal)} for unequal ones",
        float(sigma[2] / ARCSEC),
        spread < _SAME,
        f"Equal to {spread:.0e} for equal heads whose x and y are alike, and only for those.",
        printed="equal",
        established="holds",
    )


def _fused_gain(k: float, axis: int) -> float:
    """Gain of three orthogonal heads over one of them, for a head k times worse about its boresight."""
    head = np.diag([1.0, 1.0, k**2])
    return float(1 - sigmas_at(np.stack([head] * 3), _ORTHOGONAL)[axis] / np.sqrt(head[axis, axis]))


def _gains(result: StarTrackerResult) -> list[Claim]:
    """7 and 8: thirty percent better, and in which sense."""
    s = result.scenario
    k = s.boresight_ratio
    cross, about = _fused_gain(k, 0), _fused_gain(k, 2)
    measured = {name: _measured_gain(result, axes) for name, axes in (("cross", [0, 1]), ("about", [2]))}
    low, high = 0.01, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if _fused_gain(middle, 2) < _PRINTED_GAIN else (low, middle)
    widest = star_tracker.boresight_ratio(math.radians(120.0))
    single, fused = s.head_covariance, sigmas_at(np.stack([s.head_covariance] * 3), _ORTHOGONAL)
    total = float(1 - np.linalg.norm(fused) / np.sqrt(np.trace(single)))
    readings: dict[str, float] = {"pointing": cross, "about the boresight": about, "all axes (rms)": total}
    agree = [_as_printed(gain) for gain in readings.values()]
    mixed: Verdict = "ambiguous" if any(agree) and not all(agree) else decided(all(agree))
    return [
        _gain_claim(
            "7a", "pointing of the boresight (errors about x and y)", cross, measured["cross"], "holds"
        ),
        _gain_claim("7b", "rotation about the boresight (z)", about, measured["about"], "does not"),
        computed(
            "7c",
            "Some square field of view up to 120° gives 30 % about the boresight",
            f"needs k = {low:.2f}; fields up to 120° have k ≥ {widest:.2f}",
            low,
            low >= widest,
            "k, how much worse a head is about its boresight than across it, falls with the field of view "
            f"({k:.2f} here).",
            printed="30 %",
            established="does not",
        ),
        computed(
            "8",
            'The fused "performance" is 30 % better than that of a single head',
            ", ".join(f"{name} {gain:.2%}" for name, gain in readings.items()),
            cross,
            mixed,
            "The word can mean either reading of claim 7 or all axes together; the number fits "
            f"{sum(agree)} of the {len(agree)}.",
            printed="30 %",
            established="ambiguous",
        ),
    ]


def _as_printed(gain: float) -> bool:
    """Whether a gain rounds to the printed percentage."""
    return round(100 * gain) == round(100 * _PRINTED_GAIN)


def _measured_gain(result: StarTrackerResult, axes: list[int]) -> tuple[float, tuple[float, float]]:
    """Gain of rms error, three orthogonal heads over one, with its bootstrap interval."""
    names = ("single", "orthogonal")
    squares = [np.mean(result.arrays[f"{name}_error"][..., axes] ** 2, axis=(1, 2)) for name in names]
    return resampled(np.stack(squares, axis=-1), lambda mean: 1 - np.sqrt(mean[..., 1] / mean[..., 0]))


def _gain_claim(
    number: str,
    what: str,
    gain: float,
    measured: tuple[float, tuple[float, float]],
    established: Verdict,
) -> Claim:
    value, interval = measured
    return computed(
        number,
        f"Three orthogonal heads are 30 % better than one in the {what}",
        f"{gain:.2%}; measured {value:.1%} [{interval[0]:.1%}, {interval[1]:.1%}]",
        value,
        _as_printed(gain),
        "Judged by the covariance of evenly spread stars, rounded as printed; measured: rms errors of the "
        "runs, whose fields are random.",
        printed="30 %",
        interval=interval,
        confidence=0.95,
        established=established,
    )


def _asymmetric(s: StarTracker) -> list[Claim]:
    """9: two heads close together; the third belongs as far from them as possible."""
    heads = np.stack([s.head_covariance] * 3)

    def sweep(angles: Array) -> star_tracker.SeparationSweep:
        return star_tracker.separation_sweep(heads, angles, "asymmetric", separation=s.pair_angle)

    limits = s.pair_angle / 2, math.pi - s.pair_angle / 2
    best = [
        math.degrees(best_angle(value, *limits, s.sweep_step))
        for value in (lambda a: sweep(a).sigma[:, 2], lambda a: sweep(a).trace)
    ]
    at, ideal = sweep(np.array([_ORTHOGONAL])).sigma[0], sigmas_at(heads, _ORTHOGONAL)
    worst = float(sweep(np.linspace(*limits, 200)).sigma[:, 2].max())
    tolerance = math.degrees(_RESOLVED)
    return [
        computed(
            "9a",
            f"With two heads {math.degrees(s.pair_angle):.3g}° apart, the third belongs at 90° from both",
            f"best at {best[0]:.2f}° for z, {best[1]:.2f}° for the trace",
            best[0],
            all(abs(angle - 90) <= tolerance for angle in best),
            "As far from both axes as it can be: beyond 90° a boresight comes closer to the line of the "
            f"others again. σz there {at[2] / ARCSEC:.3f}″, at the worst place {worst / ARCSEC:.3f}″.",
            printed="as far as possible",
            established="holds",
        ),
        computed(
            "9b",
            "It is then as good about z as with three orthogonal heads",
            f"{at[2] / ARCSEC:.3f}″ instead of {ideal[2] / ARCSEC:.3f}″: {at[2] / ideal[2] - 1:.1%} worse",
            float(at[2] / ideal[2] - 1),
            bool(at[2] <= ideal[2] * (1 + _SAME)),
            "What the two close heads share in direction is lost about z.",
            established="does not",
        ),
    ]

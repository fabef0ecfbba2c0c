"""Claims 1, 2 and 10 to 12: what the simulation says of the covariance, the weights and the fusion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.consistency import chi2_quantile, nees_bounds
from losnav.scenarios.intervals import BAND, deviation, resampled, scaled_mean
from losnav.scenarios.star_tracker.judging import ARCSEC, computed, triple
from losnav.scenarios.star_tracker.study import MISMOUNTED, mounting_errors
from losnav.scenarios.verdicts import Claim, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["covariance_claims", "fusion_claims"]

Array = NDArray[np.float64]

# Two estimates that differ by less than this share of 1-sigma are the same for every purpose.
_SAME_ESTIMATE = 0.01
# Share of an error that may be left where it is called suppressed.
_SUPPRESSED = 0.1


def covariance_claims(result: StarTrackerResult) -> list[Claim]:
    """Claims 1 and 2: the covariance, and the weights it rests on."""
    return [_nees(result), _ratios(result), _pixel(result), _weights(result)]


def fusion_claims(result: StarTrackerResult) -> list[Claim]:
    """Claims 10 to 12: few stars, attitude-level fusion, mounting errors."""
    return [*_few(result), *_levels(result), *_mounting(result)]


def _band(result: StarTrackerResult, tests: int) -> tuple[float, float]:
    """Bounds of the mean NEES of one configuration such that all ``tests`` of them stay inside together."""
    low, high = nees_bounds(3, result.runs, 1 - (1 - BAND) / tests)
    return float(low), float(high)


def _nees(result: StarTrackerResult) -> Claim:
    keys = result.consistent
    low, high = _band(result, len(keys))
    means = {key: float(result.arrays[f"{key}_nees"].mean()) for key in keys}
    value, interval = scaled_mean(np.concatenate([result.arrays[f"{key}_nees"].ravel() for key in keys]), 3)
    inside = sum(low <= mean <= high for mean in means.values())
    return computed(
        "1a",
        "The covariance (16), (17) is that of the simulated errors: NEES",
        f"{inside} of {len(keys)} configurations inside [{low:.2f}, {high:.2f}]; all together {value:.3f} "
        f"[{interval[0]:.3f}, {interval[1]:.3f}] ({BAND:.1%})",
        value,
        inside == len(keys) and interval[0] <= 3 <= interval[1],
        "The mean of e'P⁻¹e is 3 for a right covariance; exact chi-square band, "
        f"{BAND:.1%} for all configurations together. " + ", ".join(f"{k} {m:.2f}" for k, m in means.items()),
        interval=interval,
        confidence=BAND,
        established="holds",
    )


def _ratios(result: StarTrackerResult) -> Claim:
    """Measured over predicted 1-sigma, axis by axis."""
    keys = result.consistent
    ratio = np.concatenate(
        [
            np.sqrt(
                np.mean((result.arrays[f"{key}_error"] / result.arrays[f"{key}_sigma"]) ** 2, axis=(0, 1))
            )
            for key in keys
        ]
    )
    outside = (1 - BAND) / ratio.size
    low, high = np.sqrt(chi2_quantile([outside / 2, 1 - outside / 2], result.runs) / result.runs)
    lowest, highest = float(ratio.min()), float(ratio.max())
    return computed(
        "1b",
        "The same, axis by axis: measured over predicted 1-sigma",
        f"{lowest:.3f} to {highest:.3f} over {ratio.size} axes of {len(keys)} configurations",
        float(ratio[np.argmax(abs(ratio - 1))]),
        bool(low <= lowest and highest <= high),
        f"All inside [{low:.3f}, {high:.3f}], exact chi-square band at {BAND:.1%} for the {ratio.size} "
        f"together ({result.runs} runs).",
        printed="agree",
        interval=(lowest, highest),
        confidence=BAND,
        established="holds",
    )


def _pixel(result: StarTrackerResult) -> Claim:
    s, nees = result.scenario, result.arrays["pixel alike_nees"]
    value, interval = scaled_mean(nees, 3)
    own = float(result.arrays["pixel_nees"].mean())
    return computed(
        "1c",
        "It stays exact for white pixel noise instead of white angular noise",
        f"NEES {value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}] ({BAND:.1%}); {own:.3f} with the "
        "detector's own covariance",
        value,
        _equal_to(interval, 3.0),
        f"{nees.size} images of a {np.degrees(s.fov):.0f}° field, one sigma for all stars: off the axis a "
        "pixel is less angle, so (14) is a few percent pessimistic in variance. With the covariance of "
        "white noise on the detector it is right again.",
        interval=interval,
        confidence=BAND,
        established="does not",
    )


def _equal_to(interval: tuple[float, float], expected: float) -> Verdict:
    """Whether a quantity is the expected one: not decided while the interval is wider than 5 percent."""
    low, high = interval
    if not low <= expected <= high:
        return "does not"
    return "holds" if high - low < 0.05 * expected else "ambiguous"


def _weights(result: StarTrackerResult) -> Claim:
    right, alike = result.arrays["weighted_error"], result.arrays["weighted alike_error"]
    squares = np.stack([np.sum(error**2, axis=(1, 2)) for error in (alike, right)], axis=-1)
    value, interval = resampled(squares, lambda mean: mean[..., 0] / mean[..., 1])
    nees, band = float(result.arrays["weighted_nees"].mean()), _band(result, 1)
    attained = band[0] <= nees <= band[1]
    better = judge(interval, above=1.0)
    noise = ":".join(f"{ratio:g}" for ratio in result.scenario.noise_ratios)
    return computed(
        "2",
        "Weights 1/σ² make the estimate the most likely one",
        f"NEES {nees:.2f}; equal weights give {value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}] times the "
        "mean square error",
        value,
        better if attained else "does not",
        f"Heads with star noise {noise}. With 1/σ² the errors have the inverse Fisher information for "
        f"covariance (NEES in [{band[0]:.2f}, {band[1]:.2f}]), which no unbiased estimate beats.",
        interval=interval,
        confidence=0.95,
        established="holds",
    )


def _few(result: StarTrackerResult) -> list[Claim]:
    """10: fewer than three stars in each head."""
    claims = []
    for number, key, words in (
        ("10a", "few 1+1+1", "one star in each of three heads"),
        ("10b", "few 1+1+0", "one star in each of two heads"),
    ):
        nees, band = float(result.arrays[f"{key}_nees"].mean()), _band(result, 2)
        known = bool(np.isfinite(result.arrays[f"{key}_sigma"]).all())
        rms = np.sqrt(np.mean(result.arrays[f"{key}_error"] ** 2, axis=(0, 1)))
        value, interval = deviation(result.arrays[f"{key}_error"][..., 2].ravel() / ARCSEC)
        claims.append(
            computed(
                number,
                f"It works with fewer than three stars in each head: {words}",
                f"{triple(rms)}; z {value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]″, NEES {nees:.2f}",
                value,
                known and band[0] <= nees <= band[1],
                "rms errors about x, y, z. Two directions that are not parallel are enough, wherever they "
                f"are seen; NEES asked in [{band[0]:.2f}, {band[1]:.2f}].",
                interval=interval,
                confidence=0.95,
                established="holds",
            )
        )
    return claims


def _levels(result: StarTrackerResult) -> list[Claim]:
    """11: image-level against attitude-level fusion."""
    claims = []
    for number, key, words in (
        ("11a", "orthogonal", f"{result.scenario.stars} stars in each head"),
        ("11b", "few 2+2+2", "two stars in each head"),
    ):
        images, attitudes = (result.arrays[f"{key}{level}_error"] for level in ("", " attitudes"))
        between = abs(images - attitudes) / result.arrays[f"{key}_sigma"]
        squares = np.stack([np.sum(e**2, axis=(1, 2)) for e in (attitudes, images)], axis=-1)
        value, interval = resampled(squares, lambda mean: np.sqrt(mean[..., 0] / mean[..., 1]))
        claims.append(
            computed(
                number,
                f"Image-level fusion beats attitude-level fusion: {words}",
                f"rms error {value:.5f} [{interval[0]:.5f}, {interval[1]:.5f}] times; the two differ by "
                f"{np.sqrt(np.mean(between**2)):.1e} of 1-sigma rms",
                value,
                judge((interval[0] - 1, interval[1] - 1), above=_SAME_ESTIMATE),
                "Attitudes weighted by their covariances carry all that the stars say, once every head has "
                "two; what differs is of second order in the noise. Asked: at least 1 % smaller errors.",
                interval=interval,
                confidence=0.95,
                established="does not",
            )
        )
    sigmas = [
        np.median(result.arrays[f"few 2+1+0{level}_sigma"], axis=(0, 1)) for level in ("", " attitudes")
    ]
    sizes = [
        np.linalg.norm(result.arrays[f"few 2+1+0{level}_error"], axis=-1) for level in ("", " attitudes")
    ]
    value = float(np.median(sizes[1]) / np.median(sizes[0]))
    interval = _median_ratio(sizes[1].ravel(), sizes[0].ravel())
    claims.append(
        computed(
            "11c",
            "Image-level fusion beats attitude-level fusion: two stars, one star, none",
            f"median error {value:.1f} [{interval[0]:.1f}, {interval[1]:.1f}] times; 1-sigma "
            f"{triple(sigmas[0])} against {triple(sigmas[1])}",
            value,
            judge((interval[0] - 1, interval[1] - 1), above=_SAME_ESTIMATE),
            "A head with one star has no attitude of its own, so only the first head's is left; its single "
            "star still tells two axes. Medians, because two stars that happen to be close leave the first "
            "head with almost no rotation about its boresight.",
            interval=interval,
            confidence=0.95,
            established="holds",
        )
    )
    return claims


def _median_ratio(above: Array, below: Array) -> tuple[float, float]:
    """Bootstrap interval of the ratio of two medians over the same runs."""
    runs = len(above)
    picks = np.random.default_rng(0).integers(runs, size=(1000, runs))
    draws = np.median(above[picks], axis=1) / np.median(below[picks], axis=1)
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def _mounting(result: StarTrackerResult) -> list[Claim]:
    """12: what fusion does to a mounting error."""
    s, claims = result.scenario, []
    heads, mountings = [s.head_covariance] * 3, [h.mounting for h in result.case("orthogonal").heads]
    for number, name, words in (
        ("12a", "across", "across its boresight"),
        ("12b", "about", "about its boresight"),
    ):
        error = mounting_errors(s)[name]
        errors = np.zeros((3, 3))
        errors[MISMOUNTED] = error
        predicted = float(star_tracker.mounting_bias(heads, mountings, errors) @ error / s.mounting_error)
        along = result.arrays[f"mismounted {name}_error"] - result.arrays["orthogonal_error"]
        value, interval = resampled(np.mean(along @ error, axis=1) / s.mounting_error, lambda mean: mean)
        left = value / s.mounting_error
        claims.append(
            computed(
                number,
                f"Fusion suppresses a mounting error of one head {words}",
                f"{s.mounting_error / ARCSEC:.3g}″ becomes {value / ARCSEC:.3f} "
                f"[{interval[0] / ARCSEC:.3f}, {interval[1] / ARCSEC:.3f}]″; formula "
                f"{predicted / ARCSEC:.3f}″",
                value / ARCSEC,
                judge((interval[0] / s.mounting_error, interval[1] / s.mounting_error), below=_SUPPRESSED),
                f"{left:.1%} of it remains, however many stars there are: the share of that head in the "
                "information about the axis. Asked: less than a tenth.",
                interval=(interval[0] / ARCSEC, interval[1] / ARCSEC),
                confidence=0.95,
                established="does not" if name == "across" else "holds",
            )
        )
    claims += [_biased_covariance(result), _aligned(result)]
    return claims


def _biased_covariance(result: StarTrackerResult) -> Claim:
    nees = result.arrays["mismounted across_nees"]
    value, interval = scaled_mean(nees, 3)
    return computed(
        "12c",
        "The covariance still is that of the errors then",
        f"NEES {float(nees.mean()):.2f} [{interval[0]:.2f}, {interval[1]:.2f}] ({BAND:.1%})",
        value,
        _equal_to(interval, 3.0),
        "A bias is no noise: (17) assumes perfect mountings, so they must be calibrated, on ground or from "
        "the stars themselves.",
        interval=interval,
        confidence=BAND,
        established="does not",
    )


def _aligned(result: StarTrackerResult) -> Claim:
    s = result.scenario
    error = mounting_errors(s)["across"]
    left = result.aligned_biases
    along = left @ error / s.mounting_error
    value, (low, high) = deviation(along / ARCSEC)
    size = s.mounting_error / ARCSEC
    return computed(
        "12d",
        "Mountings estimated from the stars themselves suppress it",
        f"{size:.3g}″ becomes {value:.3f} [{low:.3f}, {high:.3f}]″ rms; about x, y, z "
        f"{triple(np.sqrt(np.mean(left**2, axis=0)))}",
        value,
        judge((low / size, high / size), below=_SUPPRESSED),
        f"{s.alignments} alignments from {s.alignment_frames} images each, {s.stars} stars a head; judged "
        "about the axis of the error, asked: less than a tenth. About z the frame is that of head 1, which "
        "knows its own rotation about its boresight no better than all its images together.",
        interval=(low, high),
        confidence=0.95,
        established="holds",
    )

"""Figures of the simulated errors: one head against three, few stars, consistency, mounting errors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.consistency import chi2_quantile, nees_bounds
from losnav.plotting import AXIS_COLOURS, BLUE, GREEN, GREY, ORANGE, RED, new_figure, plain_ticks
from losnav.scenarios.intervals import deviation
from losnav.scenarios.star_tracker.judging import ARCSEC
from losnav.scenarios.star_tracker.study import mounting_errors

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["consistency", "few_stars", "mounting_error", "one_against_three"]

Array = NDArray[np.float64]

_SHOWN_IMAGES = 150
_AXES = "xyz"
# Median of the absolute value of a standard normal variable.
_HALF_NORMAL = math.sqrt(float(chi2_quantile(0.5, 1)))


def one_against_three(result: StarTrackerResult) -> Figure:
    shown = min(result.runs, _SHOWN_IMAGES)
    title = "One head against three orthogonal ones: errors of single images and ±3σ"
    figure, axes = new_figure(3, 2, size=(11.0, 7.2), title=title, width_ratios=(3, 1))
    image = np.arange(1, shown + 1)
    looks = (("single", "one head", ORANGE), ("orthogonal", "three heads", BLUE))
    for k in range(3):
        axis, bars = axes[k]
        for key, label, colour in looks:
            error = result.arrays[f"{key}_error"][:shown, 0, k] / ARCSEC
            limit = 3 * result.arrays[f"{key}_sigma"][:shown, 0, k] / ARCSEC
            axis.fill_between(image, -limit, limit, step="mid", color=colour, alpha=0.22, linewidth=0)
            axis.plot(image, error, ".", color=colour, markersize=4, label=label)
        axis.set_ylabel(f"error about {_AXES[k]} [arcsec]")
        axis.set_xlim(0, shown + 1)
        top = 1.15 * np.quantile(3 * result.arrays["single_sigma"][:shown, 0, k] / ARCSEC, 0.97)
        axis.set_ylim(-top, top)
        _compare_bars(bars, result, k, looks)
    axes[0, 0].set_title("shaded: predicted ±3σ, which varies with the random star fields", fontsize=9)
    axes[0, 1].set_title(f"1σ: predicted, and rms\nof {result.runs} runs (95 %)", fontsize=9)
    axes[2, 0].set_xlabel("image")
    axes[0, 0].legend(loc="upper right", ncol=2, markerscale=2)
    return figure


def _compare_bars(
    axis: Any, result: StarTrackerResult, k: int, looks: tuple[tuple[str, str, str], ...]
) -> None:
    for place, (key, _, colour) in enumerate(looks):
        sigma = result.sigma(key)[k] / ARCSEC
        value, (low, high) = deviation(result.arrays[f"{key}_error"][..., k].ravel() / ARCSEC)
        axis.bar(place, sigma, color=colour, alpha=0.45, width=0.62)
        axis.errorbar(
            place, value, [[value - low], [high - value]], fmt="o", color="black", markersize=4, capsize=4
        )
        axis.annotate(
            f"{sigma:.2f}″",
            (place, max(sigma, high)),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8,
        )
    gain = 1 - result.sigma(looks[1][0])[k] / result.sigma(looks[0][0])[k]
    axis.set_xticks(range(len(looks)), [f"{label}" for _, label, _ in looks])
    axis.set_xlim(-0.6, 1.6)
    axis.set_ylim(0, 1.3 * result.sigma(looks[0][0])[k] / ARCSEC)
    axis.annotate(
        f"−{gain:.0%}",
        (0.97, 0.93),
        xycoords="axes fraction",
        ha="right",
        va="top",
        color=BLUE,
        fontweight="bold",
    )
    axis.grid(visible=False, axis="x")


def few_stars(result: StarTrackerResult) -> Figure:
    title = "Stars fused as one image, or attitudes fused afterwards (three orthogonal heads)"
    figure, axes = new_figure(size=(9.5, 4.9), title=title)
    axis, width = axes[0, 0], 0.13
    keys = ("orthogonal", "few 2+2+2", "few 2+1+0", "few 1+1+1", "few 1+1+0")
    for place, key in enumerate(keys):
        for level, (suffix, start) in enumerate((("", -3), (" attitudes", 0))):
            if f"{key}{suffix}_sigma" not in result.arrays:
                axis.annotate(
                    "no head has\nan attitude",
                    (place + 1.5 * width, 1.25),
                    ha="center",
                    fontsize=8,
                    color="#555555",
                )
                continue
            sigma = np.median(result.arrays[f"{key}{suffix}_sigma"], axis=(0, 1)) / ARCSEC
            error = np.median(abs(result.arrays[f"{key}{suffix}_error"]), axis=(0, 1)) / ARCSEC / _HALF_NORMAL
            for k, colour in enumerate(AXIS_COLOURS):
                x = place + (start + k + 0.5) * width + (0.02 if level else -0.02)
                axis.bar(
                    x,
                    sigma[k],
                    width=width,
                    color=colour if not level else "white",
                    edgecolor=colour,
                    hatch="////" if level else None,
                    linewidth=1.0,
                )
                axis.plot(x, error[k], "_", color="black", markersize=9, markeredgewidth=1.6)
    axis.set_yscale("log")
    plain_ticks(axis, (1, 2, 5, 10, 20, 50, 100))
    axis.set_ylim(1, 150)
    axis.set_xlim(-0.55, len(keys) - 0.4)
    labels = ["+".join(map(str, result.case(key).stars)) for key in keys]
    axis.set_xticks(range(len(keys)), labels)
    axis.set(xlabel="stars in heads 1, 2, 3", ylabel="1σ (median over star fields) [arcsec]")
    axis.grid(visible=False, axis="x")
    _few_stars_legend(axis, result.runs)
    return figure


def _few_stars_legend(axis: Any, runs: int) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(color=colour, label=f"about {name}") for name, colour in zip(_AXES, AXIS_COLOURS, strict=True)
    ]
    handles += [
        Patch(facecolor=GREY, edgecolor=GREY, label="image-level"),
        Patch(facecolor="white", edgecolor=GREY, hatch="////", label="attitude-level"),
        Line2D(
            [], [], marker="_", color="black", linestyle="none", markersize=9, label=f"measured, {runs} runs"
        ),
    ]
    axis.legend(handles=handles, ncol=2, loc="upper right")


def consistency(result: StarTrackerResult) -> Figure:
    title = f"The predicted covariance against {result.runs} runs of every configuration"
    figure, axes = new_figure(1, 2, size=(11.0, 5.6), title=title, sharey=True, width_ratios=(1.5, 1))
    rows = [(key, "{} ({})".format(*result.titles[key])) for key in result.consistent]
    rows += [
        ("pixel", "pixel noise, its own covariance"),
        ("pixel alike", "pixel noise, one σ for all stars"),
    ]
    for place, (key, _) in enumerate(rows):
        scaled = result.arrays[f"{key}_error"] / result.arrays[f"{key}_sigma"]
        for k, colour in enumerate(AXIS_COLOURS):
            value, (low, high) = deviation(scaled[..., k].ravel())
            axes[0, 0].errorbar(
                value,
                place + 0.22 * (k - 1),
                xerr=[[value - low], [high - value]],
                fmt="o",
                color=colour,
                markersize=3,
                capsize=2,
                label=f"about {_AXES[k]}" if place == 0 else None,
            )
        nees = result.arrays[f"{key}_nees"]
        low, high = nees_bounds(3, nees.size, 0.999)
        axes[0, 1].barh(place, high - low, left=low, height=0.55, color=GREY, alpha=0.3)
        axes[0, 1].plot(nees.mean(), place, "o", color="black", markersize=4)
    axes[0, 0].axvline(1, color="black", linewidth=0.9)
    axes[0, 1].axvline(3, color="black", linewidth=0.9)
    axes[0, 0].set_yticks(range(len(rows)), [words for _, words in rows])
    axes[0, 0].invert_yaxis()
    axes[0, 0].set(xlabel="measured rms over predicted 1σ (95 % intervals)")
    axes[0, 1].set(xlabel="mean NEES (grey: 99.9 % band of a right covariance)")
    for axis in axes.flat:
        axis.grid(visible=False, axis="y")
    axes[0, 0].legend(loc="upper right", ncol=3, bbox_to_anchor=(1.0, 1.09))
    return figure


def mounting_error(result: StarTrackerResult) -> Figure:
    s = result.scenario
    heads, mountings = [s.head_covariance] * 3, [head.mounting for head in result.case("orthogonal").heads]
    figure, axes = new_figure(
        size=(7.5, 4.6), title="A wrong mounting of one of three orthogonal heads turns the fused attitude"
    )
    axis = axes[0, 0]
    size = np.linspace(0.0, 4 * s.mounting_error, 9)
    for (name, error), colour in zip(mounting_errors(s).items(), (BLUE, RED), strict=True):
        direction = error / s.mounting_error
        errors = np.zeros((size.size, 3, 3))
        errors[:, 1] = size[:, None] * direction
        bias = star_tracker.mounting_bias(heads, mountings, errors) @ direction / ARCSEC
        axis.plot(size / ARCSEC, bias, color=colour, label=f"error {name} its boresight: P Σ Sₙ Pₙ⁻¹ Sₙ' μₙ")
        shift = (result.arrays[f"mismounted {name}_error"] - result.arrays["orthogonal_error"]) @ direction
        axis.plot(
            s.mounting_error / ARCSEC,
            shift.mean() / ARCSEC,
            "o",
            color=colour,
            label=f"{result.runs} runs: {shift.mean() / ARCSEC:.3f}″",
        )
    direction = mounting_errors(s)["across"] / s.mounting_error
    value, (low, high) = deviation(result.aligned_biases @ direction / ARCSEC)
    axis.errorbar(
        1.05 * s.mounting_error / ARCSEC,
        value,
        [[value - low], [high - value]],
        fmt="D",
        color=GREEN,
        capsize=3,
        label=f"across, after alignment by {s.alignment_frames} images: {value:.2f}″ rms",
    )
    axis.axhline(s.head_sigma / math.sqrt(2) / ARCSEC, color=GREY, linewidth=0.9, linestyle=":")
    axis.annotate(
        "1σ of the star noise after fusion",
        (0.99, s.head_sigma / math.sqrt(2) / ARCSEC),
        xycoords=("axes fraction", "data"),
        ha="right",
        va="bottom",
        fontsize=8,
    )
    axis.set(xlabel="mounting error of one head [arcsec]", ylabel="bias of the fused attitude [arcsec]")
    axis.set(xlim=(0, None), ylim=(-0.2, None))
    axis.legend(loc="upper left")
    return figure

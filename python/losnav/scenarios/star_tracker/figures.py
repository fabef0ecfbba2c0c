"""Figures of the star tracker, as a navigation report shows them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.plotting import (
    AXIS_COLOURS,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    RED,
    figure_style,
    new_figure,
    plain_ticks,
    save_figure,
)
from losnav.scenarios.intervals import deviation
from losnav.scenarios.star_tracker.ellipsoid_figures import ellipsoids
from losnav.scenarios.star_tracker.judging import ARCSEC
from losnav.scenarios.star_tracker.monte_carlo_figures import (
    consistency,
    few_stars,
    mounting_error,
    one_against_three,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.star_tracker import StarTracker
    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["draw_all"]

Array = NDArray[np.float64]

_AXES = "xyz"
_HEAD_COLOURS = (BLUE, GREEN, ORANGE)
_FINE = 241
_ORTHOGONAL = math.pi / 2


def draw_all(result: StarTrackerResult, folder: Path) -> list[Path]:
    """Write every figure into ``folder`` and return the paths."""
    figures = {
        "head-separation": _separation,
        "fusion-frame": _fusion_frame,
        "one-against-three": one_against_three,
        "fused-ellipsoids": ellipsoids,
        "boresight-gain": _boresight_gain,
        "few-stars": few_stars,
        "fusion-consistency": consistency,
        "mounting-error": mounting_error,
    }
    with figure_style():
        return [save_figure(draw(result), folder / f"{name}.png") for name, draw in figures.items()]


def _sweep(s: StarTracker, angles: Array, geometry: Any = "symmetric") -> star_tracker.SeparationSweep:
    return star_tracker.separation_sweep([s.head_covariance] * 3, angles, geometry, separation=s.pair_angle)


def _measured(axis: Any, result: StarTrackerResult, key: str, angle: float) -> None:
    """Measured rms errors of a configuration with their 95 % intervals."""
    for k, colour in enumerate(AXIS_COLOURS):
        value, (low, high) = deviation(result.arrays[f"{key}_error"][..., k].ravel() / ARCSEC)
        axis.errorbar(
            math.degrees(angle) + (k - 1) * 0.9,
            value,
            [[value - low], [high - value]],
            fmt="o",
            markersize=3.5,
            capsize=2.5,
            color=colour,
        )


def _separation(result: StarTrackerResult) -> Figure:
    s = result.scenario
    title = "Accuracy of three heads against their separation (frame of head 1)"
    figure, axes = new_figure(1, 2, size=(11.0, 4.9), title=title, sharey=True)
    half = s.pair_angle / 2
    panels = (
        ("symmetric", 0.0, math.radians(120.0), "all heads at the same angle from each other"),
        (
            "asymmetric",
            half,
            math.pi - half,
            f"two heads {math.degrees(s.pair_angle):.3g}° apart, the third at the same angle from both",
        ),
    )
    for axis, (geometry, low, high, words) in zip(axes.flat, panels, strict=True):
        angles = np.linspace(low, high, _FINE)
        sigma = _sweep(s, angles, geometry).sigma / ARCSEC
        for k, colour in enumerate(AXIS_COLOURS):
            dashed = geometry == "symmetric" and k == 1
            axis.semilogy(
                np.degrees(angles),
                sigma[:, k],
                color=colour,
                linestyle=(0, (5, 5)) if dashed else "-",
                label=f"σ{_AXES[k]}",
            )
        best = int(np.argmin(sigma[:, 2]))
        axis.annotate(
            f"best σz: {sigma[best, 2]:.2f}″ at {math.degrees(angles[best]):.0f}°",
            (math.degrees(angles[best]), sigma[best, 2]),
            xytext=(0, 84),
            textcoords="offset points",
            ha="center",
            arrowprops={"arrowstyle": "->", "color": GREY},
        )
        axis.set_title(words)
        axis.set_xlabel("angle [deg]")
    _measured(axes[0, 0], result, "orthogonal", _ORTHOGONAL)
    for angle in s.check_angles:
        _measured(axes[0, 0], result, f"symmetric {math.degrees(angle):.4g}°", angle)
    for angle in s.third_angles:
        _measured(axes[0, 1], result, f"asymmetric {math.degrees(angle):.4g}°", angle)
    for axis in axes.flat:
        _single_lines(axis, s, labelled=axis is axes[0, 0])
        plain_ticks(axis, (1, 1.5, 2, 3, 5, 10, 20))
        axis.set_ylim(1.2, 22)
    axes[0, 0].set_ylabel("1σ about the axis [arcsec]")
    handles, labels = axes[0, 1].get_legend_handles_labels()
    handles.append(axes[0, 1].errorbar([], [], [], fmt="ko", markersize=3.5, capsize=2.5))
    figure.legend(
        handles,
        [*labels, f"rms of {result.runs} runs, random star fields (95 %)"],
        loc="outside lower center",
        ncol=6,
    )
    return figure


def _single_lines(axis: Any, s: StarTracker, labelled: bool) -> None:
    """The accuracy of one head alone, across and about its boresight."""
    for value, words in (
        (s.head_sigma, "one head, across its boresight"),
        (s.head_sigma * s.boresight_ratio, "one head, about its boresight"),
    ):
        axis.axhline(value / ARCSEC, color=GREY, linewidth=0.9, linestyle=":")
        if not labelled:
            continue
        axis.annotate(
            f"{words} ({value / ARCSEC:.2f}″)",
            (0.99, value / ARCSEC),
            xycoords=("axes fraction", "data"),
            xytext=(0, 2),
            textcoords="offset points",
            ha="right",
            va="bottom",
            fontsize=8,
            color="#555555",
        )


def _fusion_frame(result: StarTrackerResult) -> Figure:
    s = result.scenario
    title = "What is best depends on the axis, the frame and the heads"
    figure, axes = new_figure(1, 2, size=(11.0, 4.6), title=title)
    angles = np.radians(np.linspace(20.0, 120.0, _FINE))
    equal = [s.head_covariance] * 3
    for axis, heads, words in (
        (axes[0, 0], equal, "three equal heads"),
        (axes[0, 1], [np.diag(np.square(row)) for row in s.unequal_sigmas], _unequal_words(s)),
    ):
        curves: list[tuple[str, Any, str, str]] = [
            (f"σz in the frame of head {n + 1}", n, colour, "-") for n, colour in enumerate(_HEAD_COLOURS)
        ]
        if axis is axes[0, 0]:
            curves = [("σz in the frame of a head", 0, BLUE, "-")]
        curves.append(("σz, z on the axis of symmetry", "symmetry", PURPLE, "--"))
        for label, frame, colour, style in curves:
            sigma = star_tracker.separation_sweep(heads, angles, frame=frame).sigma[:, 2] / ARCSEC
            axis.plot(np.degrees(angles), sigma, color=colour, linestyle=style, label=label)
            _mark_least(axis, angles, sigma, colour, "best at {:.0f}°" if frame == "symmetry" else "")
        sweep = star_tracker.separation_sweep(heads, angles)
        mean = np.sqrt(sweep.trace / 3) / ARCSEC
        axis.plot(
            np.degrees(angles), mean, color="black", linestyle="-.", label="rms of the axes (any frame)"
        )
        _mark_least(axis, angles, mean, "black")
        axis.axvline(90, color=GREY, linewidth=0.9, linestyle=":", zorder=0)
        axis.annotate("best at 90°", (90.5, 0.5), xycoords=("data", "axes fraction"), fontsize=8)
        axis.set(xlabel="separation [deg]", xlim=(20, 122), ylim=(0.8, 8.0))
        axis.set_title(words)
        axis.legend(loc="upper right")
    axes[0, 0].set_ylabel("1σ [arcsec]")
    return figure


def _unequal_words(s: StarTracker) -> str:
    rows = [", ".join(f"{value / ARCSEC:.3g}" for value in row) for row in s.unequal_sigmas]
    return "unequal heads: " + "; ".join(f"({row})″" for row in rows)


def _mark_least(axis: Any, angles: Array, values: Array, colour: str, words: str = "") -> None:
    least = int(np.argmin(values))
    place = math.degrees(angles[least]), values[least]
    axis.plot(*place, "o", color=colour, markersize=5, clip_on=False)
    if words:
        axis.annotate(
            words.format(place[0]),
            place,
            xytext=(2, -14),
            textcoords="offset points",
            ha="right",
            fontsize=8,
            color=colour,
        )


def _boresight_gain(result: StarTrackerResult) -> Figure:
    s = result.scenario
    ratio = np.geomspace(0.5, 20.0, 200)
    square = _sweep(s, np.asarray(_ORTHOGONAL)).mountings
    heads = ratio[:, None, None] ** np.array([0.0, 0.0, 2.0]) * np.eye(3)
    fused = star_tracker.fused_covariance(np.repeat(heads[:, None], 3, axis=1), square)
    gain = 100 * (1 - np.sqrt(np.diagonal(fused / heads.clip(min=1e-300), axis1=-2, axis2=-1)))
    figure, axes = new_figure(
        size=(8.0, 4.8),
        title="“Boresight accuracy improves by 30 %”: the two readings (three orthogonal heads)",
    )
    axis = axes[0, 0]
    axis.semilogx(ratio, gain[:, 0], color=BLUE, label="pointing of the boresight (errors about x and y)")
    axis.semilogx(ratio, gain[:, 2], color=RED, label="rotation about the boresight (error about z)")
    axis.axhline(30, color=GREY, linewidth=0.9, linestyle=":")
    axis.annotate("printed: 30 %", (0.995, 30), xycoords=("axes fraction", "data"), ha="right", va="bottom")
    fields = np.radians([24.0, 20.0, 16.0, 10.0])
    for fov in fields:
        k = star_tracker.boresight_ratio(fov)
        axis.axvline(k, color=GREY, linewidth=0.6, alpha=0.7)
        axis.annotate(
            f"{math.degrees(fov):.0f}°", (k, 1.5), xytext=(2, 0), textcoords="offset points", fontsize=8
        )
    axis.annotate("field of view:", (0.52, 1.5), fontsize=8)
    k = s.boresight_ratio
    for column, colour in ((0, BLUE), (2, RED)):
        here = float(np.interp(k, ratio, gain[:, column]))
        axis.plot(k, here, "o", color=colour)
        axis.annotate(f"{here:.2f} %", (k, here), xytext=(6, -12), textcoords="offset points", color=colour)
    need = float(np.interp(30.0, gain[:, 2], ratio))
    axis.plot(need, 30.0, "s", color=RED, markersize=5)
    axis.annotate(
        f"30 % about the boresight\nwould need k = {need:.2f}",
        (need, 30.0),
        xytext=(18, -34),
        textcoords="offset points",
        color=RED,
        arrowprops={"arrowstyle": "->", "color": RED},
    )
    ticks = (0.5, 1, 2, 5, 10, 20)
    axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_xticks([], minor=True)
    axis.set(xlabel="k: 1σ about the boresight over 1σ across it, one head", ylabel="gain over one head [%]")
    axis.set(xlim=(0.5, 20), ylim=(0, 100))
    axis.legend(
        loc="center right", bbox_to_anchor=(1.0, 0.62), frameon=True, edgecolor="none", framealpha=1.0
    )
    return figure

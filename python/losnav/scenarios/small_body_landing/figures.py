"""Figures of the landing, as a navigation report shows them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import nees_bounds
from losnav.plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, figure_style, new_figure, save_figure
from losnav.scenarios.small_body_landing.body_figures import draw_descent, draw_field
from losnav.scenarios.small_body_landing.information_claims import lacking
from losnav.scenarios.small_body_landing.result import POSITION, VELOCITY, rms
from losnav.scenarios.small_body_landing.study import MAP_ERRORS, OUTAGE, STARTS, UPDATES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult

__all__ = ["draw_all"]

Array = NDArray[np.float64]

_SHOWN_RUNS = 20
_CONFIDENCE = 0.999
# Of the filters, in their order; black for the one that only serves a comparison of gains.
_COLOURS = (RED, ORANGE, GREEN, PURPLE, GREY, BLUE, "black")
_COMPARED = 6
_MAP_COLOURS = (RED, ORANGE, GREEN, BLUE)
_MAP_WORDS = {"ignore": "ignored", "white": "white noise", "consider": "considered", "estimate": "estimated"}


def draw_all(result: SmallBodyLandingResult, folder: Path) -> list[Path]:
    """Write every figure into ``folder`` and return the paths."""
    figures = {
        "landing-descent": draw_descent,
        "landing-errors": _errors,
        "landing-gravity": _gravity,
        "landing-nees": _nees,
        "landing-model-error": _model_error,
        "landing-robustness": _robustness,
        "landing-lost": _lost,
        "landing-field": draw_field,
    }
    with figure_style():
        return [save_figure(draw(result), folder / f"{name}.png") for name, draw in figures.items()]


def _errors(result: SmallBodyLandingResult) -> Figure:
    a, times, shown = result.arrays, result.times, min(result.runs, _SHOWN_RUNS)
    title = f"Gravity {100 * result.worst:g} % too small: errors of {shown} runs, the filters' ±3σ"
    figure, axes = new_figure(3, _COMPARED, size=(15.0, 7.0), title=title, sharex=True)
    rows = (
        (2, 1.0, "Up [m]"),
        (5, 1e3, "velocity Up [mm/s]"),
        (6, np.degrees(1.0), "attitude about East [deg]"),
    )
    late = times > times[-1] / 10
    for column, (name, colour) in enumerate(zip(result.names[:_COMPARED], _COLOURS, strict=False)):
        for row, (k, scale, label) in enumerate(rows):
            axis = axes[row, column]
            error, sigma = (scale * a[key][:, column, :, k] for key in ("error", "sigma"))
            axis.plot(times, error[:shown].T, color=GREY, linewidth=0.5, alpha=0.6)
            own = 3 * rms(np.mean(sigma**2, axis=0))
            for sign in (1, -1):
                axis.plot(times, sign * own, color=colour)
            limit = 1.15 * max(own[late].max(), np.abs(error[:shown, late]).max())
            axis.set_ylim(-limit, limit)
            if column == 0:
                axis.set_ylabel(label)
            if row == 0:
                axis.set_title(name)
            if row == 2:
                axis.set_xlabel("time [s]")
    return figure


def _gravity(result: SmallBodyLandingResult) -> Figure:
    s = result.scenario
    title = f"RMSE over the last {s.final_window:g} s against the error of gravity, {result.runs} runs"
    figure, axes = new_figure(1, 2, size=(11.0, 4.6), title=title)
    share = sorted(s.gravity_errors)
    parts = ((POSITION, 1.0, "position [m]"), (VELOCITY, 1e3, "velocity [mm/s]"))
    for axis, (part, scale, label) in zip(axes[0], parts, strict=True):
        for name, colour in zip(result.names[:_COMPARED], _COLOURS, strict=False):
            value = [scale * np.sqrt(result.end(name, x, part).mean()) for x in share]
            axis.plot(100 * np.array(share), value, "o-", color=colour, markersize=4, label=name)
        axis.set_yscale("log")
        axis.set(xlabel="gravity too small by [%]", ylabel=label)
    axes[0, 0].legend(loc="upper left")
    return figure


def _nees(result: SmallBodyLandingResult) -> Figure:
    title = f"NEES/9, mean of {result.runs} runs (1: the covariance is right)"
    figure, axes = new_figure(1, 3, size=(13.5, 4.6), title=title, sharey=True)
    low, high = nees_bounds(9, result.runs, confidence=_CONFIDENCE)
    for axis, share in zip(axes[0], (result.least, result.worst), strict=False):
        for k, (name, colour) in enumerate(zip(result.names[:_COMPARED], _COLOURS, strict=False)):
            mean = result.arrays["nees"][:, result.level(share), k].mean(axis=0) / 9
            axis.plot(result.times, mean, color=colour, label=name, linewidth=1.0)
        axis.set_title(f"gravity {100 * share:g} % too small")
    axes[0, 0].legend(loc="upper left", ncol=2, fontsize=8)
    for k, kind in enumerate(MAP_ERRORS):
        mean = result.arrays["map_nees"][:, k].mean(axis=0) / 9
        axes[0, 2].plot(result.times, mean, color=_MAP_COLOURS[k], label=_MAP_WORDS[kind], linewidth=1.0)
    axes[0, 2].set_title("true gravity: errors of the map")
    axes[0, 2].legend(loc="upper left")
    for axis in axes[0]:
        axis.axhspan(low / 9, high / 9, color=GREEN, alpha=0.25, linewidth=0)
        axis.set_yscale("log")
        axis.set(xlabel="time [s]")
    axes[0, 0].set_ylabel(f"NEES/9 (green: exact {_CONFIDENCE:.1%} band)")
    return figure


def _model_error(result: SmallBodyLandingResult) -> Figure:
    title = f"The model error the filters find, gravity {100 * result.worst:g} % too small: one run"
    figure, axes = new_figure(1, 3, size=(13.0, 4.2), title=title)
    missing, times = lacking(result)[0], result.times
    for k, (axis, label) in enumerate(zip(axes[0], ("East", "North", "Up"), strict=True)):
        for name, colour in (("predictive", ORANGE), ("EKF, acceleration", BLUE)):
            found = result.arrays["disturbance"][0, result.names.index(name), :, k]
            thin = {"linewidth": 0.5, "alpha": 0.8} if name == "predictive" else {}
            axis.plot(times, 1e3 * found, color=colour, label=name, **thin)
        axis.plot(times, 1e3 * missing[:, k], color="black", linestyle="--", label="what the model lacks")
        span = 1e3 * np.abs(missing).max()
        axis.set_ylim(-2.5 * span, 2.5 * span)
        axis.set(xlabel="time [s]", title=f"{label} [mm/s²]")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncol=3)
    return figure


def _robustness(result: SmallBodyLandingResult) -> Figure:
    s, times = result.scenario, result.times
    title = "Outage of the velocimeter, old images, errors of the map: RMSE of position"
    figure, axes = new_figure(1, 3, size=(13.5, 4.4), title=title)
    outage, latency, mapped = axes[0]
    outage.axvspan(s.outage_start, s.outage_start + s.outage_duration, color=GREY, alpha=0.2, linewidth=0)
    for k, name in enumerate(OUTAGE):
        error = rms(result.arrays["outage_square"][:, k].mean(axis=0))
        outage.plot(times, error, color=_COLOURS[result.names.index(name)], label=name)
    outage.set_yscale("log")
    outage.set(
        xlabel="time [s]",
        ylabel="[m]",
        title=f"no velocimeter, image every {s.outage_images:g} s; gravity {100 * result.worst:g} "
        "% too small",
    )
    outage.legend(loc="lower left", fontsize=8)
    values = np.sqrt(result.arrays["latency_square"].mean(axis=0))
    for column, (word, colour) in enumerate((("taken for fresh", RED), ("pose of exposure cloned", BLUE))):
        latency.plot(s.latencies, values[:, column], "o-", color=colour, label=word)
    latency.set_yscale("log")
    latency.set(xlabel="age of the images [s]", title="true gravity")
    latency.legend(loc="upper left")
    for k, kind in enumerate(MAP_ERRORS):
        error = rms(result.arrays["map_square"][:, k, :, POSITION].mean(axis=0))
        mapped.plot(times, error, color=_MAP_COLOURS[k], label=_MAP_WORDS[kind])
    mapped.set_yscale("log")
    mapped.set(xlabel="time [s]", title=f"map wrong by {s.landmark_sigma:g} m per axis, true gravity")
    mapped.legend(loc="upper right")
    return figure


def _lost(result: SmallBodyLandingResult) -> Figure:
    s = result.scenario
    title = f"Filters lost from large first errors ({result.runs} runs, {s.lost_position:g} m off at the end)"
    figure, axes = new_figure(1, 1, size=(11.0, 4.4), title=title)
    axis, names, share = axes[0, 0], result.lost_names, 100 * result.lost()
    words = (
        f"{s.large_position:g} m",
        f"{np.degrees(s.large_attitude):g}°",
        f"{s.large_position:g} m and {np.degrees(s.large_attitude):g}°",
    )
    width = 0.8 / len(STARTS)
    for k, (word, colour) in enumerate(zip(words, (GREEN, ORANGE, RED), strict=True)):
        place = np.arange(len(names)) + (k - 1) * width
        bars = axis.bar(place, share[k], width, color=colour, label=f"{word} per axis, 1σ")
        axis.bar_label(bars, fmt="%.0f", fontsize=7)
    labels = [name.replace(", ", "\n") for name in names]
    axis.set_xticks(np.arange(len(names)), labels, fontsize=8)
    axis.set(ylabel="lost [%]", ylim=(0, max(5.0, 1.15 * float(np.max(share)))))
    figure.legend(loc="outside lower center", ncol=len(STARTS))
    first = len(names) - (len(UPDATES) - 1)
    axis.axvline(first - 0.5, color=GREY, linestyle=":")
    return figure

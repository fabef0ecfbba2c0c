"""Figures of the landing, as a navigation report shows them."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, figure_style, new_figure, save_figure
from losnav.scenarios.landmark_landing.geometry import cylinder_distance, danger_crossings
from losnav.scenarios.landmark_landing.result import bound

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.landmark_landing.result import LandingResult

__all__ = ["draw_all"]

Array = NDArray[np.float64]

_SHOWN_RUNS = 40
_ACROSS = ("axes fraction", "data")
_LOWEST = 1.0  # m; below, a logarithmic altitude only stretches the last seconds
_DEGREES = np.repeat([1.0, np.degrees(1.0)], 3)
_AXES = (
    "x [m]",
    "y [m]",
    "z (up) [m]",
    "attitude, camera x [deg]",
    "attitude, camera y [deg]",
    "attitude, camera z [deg]",
)
_TRIPLE_COLOURS = (BLUE, ORANGE, GREEN, PURPLE)


def draw_all(result: LandingResult, folder: Path) -> list[Path]:
    """Write every figure into ``folder`` and return the paths."""
    figures = {
        "descent": _descent,
        "errors-time": _errors_time,
        "errors-altitude": _errors_altitude,
        "iterations": _iterations,
        "cold-start": _cold_start,
        "observability": _observability,
        "danger-cylinder": _danger_cylinder,
    }
    with figure_style():
        return [save_figure(draw(result), folder / f"{name}.png") for name, draw in figures.items()]


def _descent(result: LandingResult) -> Figure:
    from matplotlib.ticker import MultipleLocator

    descent = result.scenario.descent
    figure, axes = new_figure(
        size=(7.5, 7.0), subplot_kw={"projection": "3d"}, title="Descent to the landing site"
    )
    axis, path = axes[0, 0], descent.position
    axis.plot(*path.T, color=BLUE, label="camera path")
    axis.scatter(*descent.landmarks.T, color=RED, marker="^", s=40, label="landmarks", depthshade=False)
    for k in np.linspace(0, len(path) - 1, 6).astype(int)[:-1]:
        for landmark in descent.landmarks:
            axis.plot(*np.stack([path[k], landmark]).T, color=ORANGE, linewidth=0.6)
        # The optical axis is −z of the camera: minus the third row of the attitude matrix, in site axes.
        tip = path[k] - 60 * descent.dcm[k, 2]
        axis.plot(*np.stack([path[k], tip]).T, color=GREEN, linewidth=2.0)
        axis.scatter(*path[k], color=BLUE, s=14)
        axis.text(*(path[k] + [6, 6, 6]), f"{descent.times[k]:.0f} s", fontsize=8)
    axis.plot([], [], color=ORANGE, linewidth=0.6, label="lines of sight")
    axis.plot([], [], color=GREEN, linewidth=2.0, label="optical axis (60 m)")
    axis.set(xlabel="x [m]", ylabel="y [m]", zlabel="z (up) [m]", xlim=(-70, 50))
    axis.set_box_aspect((1, 1, 1.8), zoom=0.85)
    axis.xaxis.set_major_locator(MultipleLocator(40))
    axis.yaxis.set_major_locator(MultipleLocator(40))
    axis.view_init(elev=12, azim=-60)
    axis.legend(loc="upper left")
    return figure


def _errors_time(result: LandingResult) -> Figure:
    descent = result.scenario.descent
    shown = min(result.runs, _SHOWN_RUNS)
    title = f"Error of the pose from single images: {shown} runs and the ±3σ bound (ideal camera)"
    figure, axes = new_figure(2, 3, size=(11.0, 6.0), title=title, sharex=True)
    for k, axis in enumerate(axes.flat):
        errors = result.arrays["ml_error"][:shown, :, k].T * _DEGREES[k]
        axis.plot(descent.times, errors, color=GREY, linewidth=0.4, alpha=0.6)
        limit = 3 * result.sigma[:, k] * _DEGREES[k]
        axis.plot(descent.times, limit, color=RED, label="±3σ")
        axis.plot(descent.times, -limit, color=RED)
        axis.set_title(_AXES[k])
        axis.set_ylim(-1.35 * limit.max(), 1.35 * limit.max())
        if k >= 3:
            axis.set_xlabel("time [s]")
    axes[0, 0].plot([], [], color=GREY, linewidth=0.8, label="runs")
    axes[0, 0].legend(loc="upper right")
    return figure


def _errors_altitude(result: LandingResult) -> Figure:
    descent, camera = result.scenario.descent, result.limited()
    # The last column puts the labels of the printed limits on the free side of the curves.
    rows: tuple[tuple[str, slice, float, tuple[float, float], tuple[str, str]], ...] = (
        ("position, worst axis [m]", slice(0, 3), 1.0, (1.0, 0.1), ("bottom", "top")),
        (
            "attitude, worst axis [deg]",
            slice(3, 6),
            float(np.degrees(1.0)),
            (0.2, 0.05),
            ("bottom", "bottom"),
        ),
    )
    figure, axes = new_figure(
        1, 2, size=(11.0, 4.8), title="Error against altitude: measured rms and predicted 3σ"
    )
    above = descent.altitude > _LOWEST
    for axis, (label, part, factor, limits, sides) in zip(axes.flat, rows, strict=True):
        for name, error, sigma, colour in (
            ("ideal camera", result.arrays["ml_error"], result.sigma, BLUE),
            (
                f"half field of view {np.degrees(camera.half_fov):.0f}°",
                camera.error,
                np.sqrt(np.diagonal(camera.covariance, axis1=1, axis2=2)),
                ORANGE,
            ),
        ):
            rms = np.sqrt(np.mean(error[..., part] ** 2, axis=0)).max(axis=-1) * factor
            bound3 = 3 * sigma[:, part].max(axis=-1) * factor
            axis.loglog(
                descent.altitude[above], bound3[above], color=colour, linestyle="--", label=f"3σ, {name}"
            )
            axis.loglog(
                descent.altitude[above], rms[above], color=colour, label=f"rms of {result.runs} runs, {name}"
            )
        for limit, side in zip(limits, sides, strict=True):
            axis.axhline(limit, color=GREY, linewidth=0.8, linestyle=":")
            text = f"printed {limit:g}"
            axis.annotate(text, (0.99, limit), xycoords=_ACROSS, ha="right", va=side, fontsize=8)
        if 0 < camera.nav_off < len(descent.times):
            axis.axvline(descent.altitude[camera.nav_off - 1], color=ORANGE, linewidth=0.8, linestyle=":")
        axis.invert_xaxis()
        axis.set(xlabel="altitude [m] (descending →)", ylabel=label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=2, fontsize=8)
    axes[0, 1].annotate(
        "fixes of the limited\ncamera end",
        (descent.altitude[max(camera.nav_off - 1, 0)], 0.97),
        xycoords=("data", "axes fraction"),
        xytext=(4, 0),
        textcoords="offset points",
        va="top",
        fontsize=8,
    )
    return figure


def _iterations(result: LandingResult) -> Figure:
    descent = result.scenario.descent
    title = (
        f"Iterations with the printed stop test (λ = {result.scenario.cost_tolerance:g}), guess: previous "
        "estimate"
    )
    figure, axes = new_figure(1, 2, size=(10.5, 4.2), title=title)
    count = {name: result.arrays[f"{name}_iterations"] for name in ("glsdc", "lm")}
    edges = np.arange(max(int(c.max()) for c in count.values()) + 2) - 0.5
    centres = edges[:-1] + 0.5
    styles = (("glsdc", "GLSDC", BLUE, -0.2), ("lm", "LM (rejected trials counted)", ORANGE, 0.2))
    for name, label, colour, shift in styles:
        share = 100 * np.histogram(count[name][:, 1:], edges)[0] / count[name][:, 1:].size
        axes[0, 0].bar(
            centres + shift,
            share,
            width=0.4,
            color=colour,
            label=f"{label}: mean {count[name][:, 1:].mean():.2f}",
        )
        axes[0, 1].plot(descent.times, count[name].mean(axis=0), color=colour, label=label)
    seen = np.concatenate([c[:, 1:].ravel() for c in count.values()])
    limits = (seen.min() - 0.6, seen.max() + 0.6)
    axes[0, 0].set(
        xlabel="iterations", ylabel="share of images [%]", xticks=centres, xlim=limits, ylim=(0, 125)
    )
    axes[0, 0].set_title("all images but the first")
    axes[0, 0].legend()
    axes[0, 1].set(xlabel="time [s]", ylabel=f"mean of {result.runs} runs", ylim=(0, None))
    axes[0, 1].set_title(
        f"along the descent (first guess {result.scenario.guess_position_sigma:.0f} m, "
        f"{np.degrees(result.scenario.guess_attitude_sigma):.0f}° off)"
    )
    return figure


def _cold_start(result: LandingResult) -> Figure:
    s = result.scenario
    columns = len(s.cold_times)
    title = f"Cold starts that reach the right pose [%], {result.runs} each"
    figure, axes = new_figure(
        2, columns, size=(2.6 * columns + 1.6, 5.8), title=title, sharex=True, sharey=True
    )
    descent = s.descent_at(s.cold_times)
    for row, (name, label) in enumerate((("gn", "GLSDC"), ("lm", "LM"))):
        success = 100 * result.arrays[f"cold_{name}_success"].mean(axis=0)
        for k in range(columns):
            axis = axes[row, k]
            axis.imshow(success[k], vmin=0, vmax=100, cmap="cividis", origin="lower", aspect="auto")
            axis.grid(visible=False)
            for (i, j), value in np.ndenumerate(success[k]):
                axis.text(
                    j,
                    i,
                    f"{value:.4g}",
                    ha="center",
                    va="center",
                    color="white" if value < 60 else "black",
                    fontsize=8,
                )
            axis.set_xticks(range(len(s.cold_angles)), [f"{np.degrees(a):.0f}" for a in s.cold_angles])
            axis.set_yticks(range(len(s.cold_offsets)), [f"{o:.0f}" for o in s.cold_offsets])
            axis.set_title(f"{label}, {descent.times[k]:.0f} s ({descent.altitude[k]:.0f} m)", fontsize=9)
    figure.supxlabel("scatter of the attitude guess, 1σ per axis [deg]", fontsize=9)
    figure.supylabel("scatter of the position guess, 1σ per axis [m, scaled with the range]", fontsize=9)
    figure.colorbar(axes[0, 0].images[0], ax=axes, shrink=0.8, label="success [%]")
    return figure


def _observability(result: LandingResult) -> Figure:
    descent = result.scenario.descent
    singular = np.asarray(ln.pose_observability(descent.landmarks, descent.position).singular_values)
    title = "How well the four landmarks determine the pose (Jacobian with position × mean range)"
    figure, axes = new_figure(1, 2, size=(10.5, 4.2), title=title)
    colours = (BLUE, GREEN, ORANGE, PURPLE, RED, GREY)
    for k, colour in enumerate(colours):
        style = "--" if k % 2 else "-"
        axes[0, 0].semilogy(descent.times, singular[:, k], color=colour, linestyle=style, label=f"{k + 1}")
    axes[0, 0].set(xlabel="time [s]", ylabel="singular value")
    axes[0, 0].set_title("six singular values (they come in pairs)")
    axes[0, 0].legend(ncol=3, loc="lower right")
    condition = (singular[:, 0] / singular[:, -1]) ** 2
    axes[0, 1].semilogy(descent.altitude, condition, color=BLUE)
    axes[0, 1].invert_xaxis()
    axes[0, 1].set(xlabel="altitude [m] (descending →)", ylabel="condition number")
    axes[0, 1].set_title("scaled Fisher information")
    for k, shift, side in ((0, 8, "left"), (-1, -8, "right")):
        axes[0, 1].annotate(
            f"{condition[k]:.2g}",
            (descent.altitude[k], condition[k]),
            xytext=(shift, 6),
            textcoords="offset points",
            ha=side,
        )
    return figure


def _danger_cylinder(result: LandingResult) -> Figure:
    s = result.scenario
    # Fine steps: the singularity is a few tenths of a second wide.
    descent = s.descent_at(np.linspace(0, s.duration, 4301))
    crossings = danger_crossings(descent.landmarks, descent.times, descent.position)
    title = "With only three of the landmarks the descent crosses their danger cylinder"
    figure, axes = new_figure(2, 1, size=(8.5, 6.8), title=title, sharex=True)
    for colour, triple in zip(
        itertools.cycle(_TRIPLE_COLOURS), itertools.combinations(range(len(s.landmarks)), 3), strict=False
    ):
        part = type(descent)(descent.landmarks[list(triple)], descent.times, s.duration, descent.start)
        label = f"landmarks {', '.join(str(k + 1) for k in triple)}"
        axes[0, 0].plot(
            descent.times, cylinder_distance(part.landmarks, descent.position), color=colour, label=label
        )
        sigma = np.sqrt(np.trace(bound(s, part)[:, :3, :3], axis1=1, axis2=2))
        axes[1, 0].semilogy(descent.times, sigma, color=colour)
    everything = np.sqrt(np.trace(bound(s, descent)[:, :3, :3], axis1=1, axis2=2))
    axes[1, 0].semilogy(descent.times, everything, color="black", linestyle="--", label="all landmarks")
    axes[0, 0].axhline(0, color="black", linewidth=0.8)
    for _, time in crossings:
        axes[0, 0].plot(time, 0, "o", color="black", markersize=4)
    axes[0, 0].set(ylabel="distance from the danger cylinder [m]\n(negative inside)")
    axes[0, 0].legend()
    axes[1, 0].set(xlabel="time [s]", ylabel="1σ position [m]", ylim=(1e-4, 1e4))
    axes[1, 0].legend()
    return figure

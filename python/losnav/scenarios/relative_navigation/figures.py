"""Figures of the rendezvous, as a navigation report shows them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import nees_bounds
from losnav.plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, figure_style, new_figure, save_figure
from losnav.scenarios.relative_navigation.result import POSITION, VELOCITY, three_sigma
from losnav.scenarios.relative_navigation.study import covariance_bound

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.relative_navigation.result import RelativeNavigationResult

__all__ = ["draw_all"]

Array = NDArray[np.float64]

_SHOWN_RUNS = 20
_CONFIDENCE = 0.999  # of the bands of NEES and NIS
_MINUTES = 1 / 60
_SCALE = np.repeat([1.0, 1e3], 3)
_AXES = ("x, along track [m]", "y, −orbit normal [m]", "z, nadir [m]", "vx [mm/s]", "vy [mm/s]", "vz [mm/s]")
_COLOURS = (PURPLE, ORANGE, GREEN, RED, GREY, BLUE)


def draw_all(result: RelativeNavigationResult, folder: Path) -> list[Path]:
    """Write every figure into ``folder`` and return the paths."""
    figures = {
        "relative-trajectory": _trajectory,
        "relative-errors": _errors,
        "relative-consistency": _consistency,
        "relative-accuracy": _accuracy,
        "relative-burn": _burn,
        "relative-attitude": _attitude,
        "relative-frames": _frames,
    }
    with figure_style():
        return [save_figure(draw(result), folder / f"{name}.png") for name, draw in figures.items()]


def _trajectory(result: RelativeNavigationResult) -> Figure:
    s = result.scenario
    title = (
        "Relative motion in the target's orbital frame: the printed sign of vx leaves, the other approaches"
    )
    figure, axes = new_figure(2, 1, size=(10.5, 6.2), title=title, gridspec_kw={"height_ratios": (1.0, 0.9)})
    plane = axes[0, 0]
    for arc, velocity, colour, shift in (
        (s.printed, s.initial_velocity, ORANGE, (0, 10)),
        (s.approach, s.approach_velocity, BLUE, (0, -30)),
    ):
        path = np.concatenate([arc.start[None, :3], arc.relative[:, :3]])
        end = f"{arc.times[-1] * _MINUTES:.0f} min"
        label = f"vx = {1e3 * velocity[0]:+.1f} mm/s ({'printed' if arc is s.printed else 'approach'})"
        plane.plot(path[:, 0], path[:, 2], color=colour, label=label)
        every = max(1, round(600 / s.sampling))
        plane.plot(path[::every, 0], path[::every, 2], ".", color=colour, markersize=5)
        plane.plot(path[-1, 0], path[-1, 2], "s", color=colour, markersize=7)
        plane.annotate(
            f"end, {end}",
            path[-1, [0, 2]],
            xytext=shift,
            textcoords="offset points",
            ha="center",
            color=colour,
        )
        axes[1, 0].plot(arc.times * _MINUTES, arc.range, color=colour, label=label)
        near = int(np.argmin(arc.range))
        axes[1, 0].annotate(
            f"{arc.range[near]:.0f} m",
            (arc.times[near] * _MINUTES, arc.range[near]),
            xytext=(0, -13) if arc is s.printed else (0, 8),
            textcoords="offset points",
            ha="center",
            color=colour,
        )
    start = s.printed.start
    plane.plot(start[0], start[2], "o", color="black", markersize=6)
    plane.annotate("start", start[[0, 2]], xytext=(-6, 9), textcoords="offset points", ha="center")
    plane.plot(0, 0, "*", color=RED, markersize=13)
    plane.annotate("target", (0, 0), xytext=(9, 3), textcoords="offset points", color=RED)
    plane.plot([], [], ".", color="black", label="every 10 min")
    plane.set(xlabel="x, along track [m] (flight →)", ylabel="z [m] (nadir ↓)")
    plane.set_aspect("equal", adjustable="datalim")
    plane.invert_yaxis()
    plane.legend(loc="center", bbox_to_anchor=(0.5, 0.45))
    axes[1, 0].set(xlabel="time [min]", ylabel="range [m]", ylim=(0, None))
    return figure


def _errors(result: RelativeNavigationResult) -> Figure:
    a, times = result.arrays, result.scenario.printed.times * _MINUTES
    shown = min(result.runs, _SHOWN_RUNS)
    title = f"Errors on the printed arc: {shown} of {result.runs} runs, measured 3 × rms, the filter's ±3σ"
    figure, axes = new_figure(2, 3, size=(11.5, 6.2), title=title, sharex=True)
    rms = 3 * np.sqrt(np.mean(a["printed_error"] ** 2, axis=0)) * _SCALE
    sigma = 3 * np.sqrt(np.mean(a["printed_sigma"] ** 2, axis=0)) * _SCALE
    for k, axis in enumerate(axes.flat):
        axis.plot(times, a["printed_error"][:shown, :, k].T * _SCALE[k], color=GREY, linewidth=0.5, alpha=0.6)
        for sign in (1, -1):
            axis.plot(times, sign * sigma[:, k], color=RED)
            axis.plot(times, sign * rms[:, k], color=BLUE, linestyle="--")
        axis.set_title(_AXES[k])
        late = slice(len(times) // 10, None)
        limit = 1.25 * max(sigma[late, k].max(), rms[late, k].max())
        axis.set_ylim(-limit, limit)
        if k >= 3:
            axis.set_xlabel("time [min]")
    handles: list[Any] = [axes[0, 0].plot([], [], color=GREY, label="runs")[0]]
    handles += [axes[0, 0].plot([], [], color=RED, label="±3σ of the filter")[0]]
    handles += [axes[0, 0].plot([], [], color=BLUE, linestyle="--", label="±3 × rms over the runs")[0]]
    figure.legend(handles=handles, loc="outside lower center", ncol=3)
    return figure


def _consistency(result: RelativeNavigationResult) -> Figure:
    s, a, times = result.scenario, result.arrays, result.scenario.printed.times * _MINUTES
    band = f"{_CONFIDENCE:.1%} band of {result.runs} runs"
    title = f"Is the filter as good as it says? Means over the runs and the exact {band}"
    figure, axes = new_figure(1, 3, size=(12.5, 4.3), title=title)
    for axis, name, dof in ((axes[0, 0], "nees", 6), (axes[0, 1], "nis", 3)):
        for arc, colour, label in (("approach", BLUE, "approach"), ("printed", ORANGE, "printed arc")):
            mean = a[f"{arc}_{name}"].mean(axis=0)[: len(times)]
            axis.plot(times[: len(mean)], mean, color=colour, label=label)
        axis.axhspan(*nees_bounds(dof, result.runs, _CONFIDENCE), color=GREEN, alpha=0.25, label="band")
        axis.axhline(dof, color=GREEN, linewidth=0.8)
        axis.set(xlabel="time [min]", ylim=(0, None))
        axis.set_title(
            f"{name.upper()}, {dof} degrees of freedom, q = {s.acceleration_psd:g} m²/s³", fontsize=9
        )
    axes[0, 0].legend(loc="upper left")
    psds = [*s.psd_grid, s.acceleration_psd]
    nees = np.concatenate([a["printed_grid_nees"], a["printed_nees"][:, None]], axis=1).mean(axis=0)
    for colour, k in zip(_COLOURS, np.argsort(psds), strict=False):
        axes[0, 2].semilogy(times, nees[k], color=colour, label=f"q = {psds[k]:g}")
    axes[0, 2].axhspan(*nees_bounds(6, result.runs, _CONFIDENCE), color=GREEN, alpha=0.4)
    axes[0, 2].set(xlabel="time [min]")
    axes[0, 2].set_title("NEES on the printed arc for other process noise", fontsize=9)
    axes[0, 2].legend(loc="upper left", fontsize=7, ncol=2)
    return figure


def _accuracy(result: RelativeNavigationResult) -> Figure:
    s = result.scenario
    title = f"3 × rms (rss of the axes) of {result.runs} runs against the printed 0.15 m and 3 mm/s"
    figure, axes = new_figure(1, 3, size=(12.5, 4.6), title=title)
    bound = three_sigma(covariance_bound(s, s.duration)[:, POSITION] ** 2)
    speed = three_sigma(covariance_bound(s, s.duration)[:, VELOCITY] ** 2)
    printed = result.psd_errors()
    position = {q: three_sigma(np.mean(e[..., POSITION] ** 2, axis=0)) for q, e in printed.items()}
    velocity = {q: 1e3 * three_sigma(np.mean(e[..., VELOCITY] ** 2, axis=0)) for q, e in printed.items()}
    approach = {q: 3 * np.sqrt(e.mean(axis=0)) for q, e in result.approach_squares().items()}
    panels = (
        (axes[0, 0], s.printed.times, position, bound, 0.15, "printed arc: position [m]", (0.09, 4)),
        (axes[0, 1], s.printed.times, velocity, 1e3 * speed, 3.0, "printed arc: velocity [mm/s]", (0.15, 30)),
        (axes[0, 2], s.approach.times, approach, None, 0.15, "approach: position [m]", (0.09, 4)),
    )
    for axis, times, curves, least, limit, label, limits in panels:
        for colour, (psd, curve) in zip(_COLOURS, curves.items(), strict=False):
            axis.semilogy(times * _MINUTES, curve, color=colour, label=f"q = {psd:g}", linewidth=1.2)
        if label.startswith("printed"):
            part, unit = (POSITION, 1.0) if "position" in label else (VELOCITY, 1e3)
            aware = unit * three_sigma(np.mean(result.arrays["aware_error"][..., part] ** 2, axis=0))
            axis.semilogy(times * _MINUTES, aware, color="black", label=f"two J2 orbits, q = {s.aware_psd:g}")
        if least is not None:
            axis.semilogy(times * _MINUTES, least, "k:", label="bound (perfect linear model, q = 0)")
        axis.axhline(limit, color="black", linewidth=0.9, linestyle="--", label="printed")
        axis.set(xlabel="time [min]", ylim=limits)
        axis.set_title(label)
        _plain_decades(axis)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=9, fontsize=7.5)
    return figure


def _plain_decades(axis: Any) -> None:
    """Ticks at 1, 2, 5 with plain numbers on a short logarithmic axis."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.yaxis.set_minor_formatter(NullFormatter())


def _burn(result: RelativeNavigationResult) -> Figure:
    s, a, times = result.scenario, result.arrays, result.scenario.printed.times
    near = (times >= s.burn_start - 600) & (times <= s.burn_start + s.burn_duration + 2400)
    title = (
        f"Burn of {1e3 * s.burn_acceleration:g} mm/s² for {s.burn_duration * _MINUTES:g} min: "
        "velocity error along it, and NIS"
    )
    figure, axes = new_figure(2, 2, size=(10.5, 6.4), title=title, sharex=True, sharey="row")
    for told, words in enumerate(("the filter is not told", "the filter is told (B u in the prediction)")):
        for colour, (k, psd) in zip((BLUE, ORANGE, GREEN), enumerate(s.burn_psds), strict=False):
            error = a["burn_error"][:, k, told, :, 0].mean(axis=0)[near]
            label = f"q = {psd:g}: lag {result.burn_lags(k, told).mean():.1f} s"
            axes[0, told].plot(times[near] * _MINUTES, error, color=colour, label=label)
            nis = a["burn_nis"][:, k, told].mean(axis=0)[near]
            axes[1, told].semilogy(times[near] * _MINUTES, nis, color=colour)
        axes[0, told].set_title(words)
        axes[0, told].legend(loc="upper right")
        axes[1, told].axhspan(*nees_bounds(3, result.runs, _CONFIDENCE), color=GREEN, alpha=0.4)
        axes[1, told].set(xlabel="time [min]")
        for axis in axes[:, told]:
            axis.axvspan(
                s.burn_start * _MINUTES, (s.burn_start + s.burn_duration) * _MINUTES, color=GREY, alpha=0.15
            )
    axes[0, 0].set(ylabel="mean velocity error, x [m/s]")
    axes[1, 0].set(ylabel="mean NIS (band: 3 degrees of freedom)")
    return figure


def _attitude(result: RelativeNavigationResult) -> Figure:
    s = result.scenario
    title = "Pointing the body badly costs nothing; not knowing where it points does"
    figure, axes = new_figure(1, 1, size=(7.6, 4.6), title=title)
    axis = axes[0, 0]
    series = (
        ("control: random, 1σ", "pointing", "random", s.control_sigmas, BLUE, "o"),
        ("control: constant", "pointing", "constant", s.control_biases, GREEN, "^"),
        ("knowledge: star tracker, 1σ", "star tracker", "", s.star_tracker_sigmas, ORANGE, "s"),
    )
    for label, head, tail, angles, colour, marker in series:
        names = [n for n in result.case_names if n.startswith(head) and n.endswith(tail or ")")]
        squares = [result.case(n)["square"][:, POSITION].sum(axis=1) for n in names]
        value = [3 * np.sqrt(square.mean()) for square in squares]
        spread = [1.5 * square.std() / np.sqrt(square.size * square.mean()) * 1.96 for square in squares]
        degrees = np.degrees(angles)
        axis.errorbar(degrees, value, yerr=spread, color=colour, marker=marker, capsize=3, label=label)
    base = float(three_sigma(result.case("as published")["square"].mean(axis=0)[POSITION]))
    axis.axhline(base, color="black", linewidth=0.8, linestyle="--", label=f"as published, {base:.2f} m")
    axis.set(xscale="log", xlabel="angle per axis [deg]", ylabel="position, 3 × rms, rss [m]", ylim=(0, None))
    axis.legend(loc="upper left")
    return figure


def _frames(result: RelativeNavigationResult) -> Figure:
    s = result.scenario
    distance = np.linalg.norm(s.far_position) / 1e3
    title = f"Whose orbital frame? {distance:.0f} km apart, against the process noise"
    figure, axes = new_figure(1, 2, size=(10.5, 4.6), title=title, sharex=True)
    series = (
        ("far linear", "C_BO", "linear truth, chaser's frame", ORANGE, "-"),
        ("far linear", "C_OT", "linear truth, corrected", BLUE, "-"),
        ("far", "C_BO", "two orbits, chaser's frame", ORANGE, "--"),
        ("far", "C_OT", "two orbits, corrected", BLUE, "--"),
        ("far", "C_OT and J2", "two orbits, corrected, J2 prediction", GREEN, "--"),
    )
    for arc, frame, label, colour, style in series:
        names = {psd: f"{arc}, {frame}, q = {psd:g}" for psd in s.far_psds}
        found = {psd: result.case(name) for psd, name in names.items() if name in result.case_names}
        bias = [-float(case["bias"][:, 2].mean()) for case in found.values()]
        nees = [float(case["nees"].mean()) for case in found.values()]
        look: dict[str, Any] = {"color": colour, "linestyle": style, "marker": "o", "label": label}
        if colour == GREEN:  # it lies on the ideal
            look |= {"markersize": 11, "markerfacecolor": "none"}
        axes[0, 0].plot(list(found), bias, **look)
        axes[0, 1].loglog(list(found), nees, **look)
    radius = s.earth_radius + s.altitude
    axes[0, 0].axhline(-(s.far_position[0] ** 2) / radius, color=GREY, linewidth=0.8, linestyle=":")
    axes[0, 0].annotate(
        "−x²/R", (min(s.far_psds), -(s.far_position[0] ** 2) / radius), va="bottom", color=GREY
    )
    axes[0, 0].set(xscale="log", xlabel="q [m²/s³]", ylabel="mean z error, estimate minus truth [m]")
    axes[0, 1].axhline(6, color=GREEN, linewidth=4, alpha=0.4)
    axes[0, 1].set(xlabel="q [m²/s³]", ylabel="mean NEES (6 if consistent)")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=3)
    return figure

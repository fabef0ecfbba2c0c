"""Figures of Sun-only navigation, as a navigation report shows them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import nees_bounds
from losnav.plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, figure_style, new_figure, save_figure
from losnav.scenarios.sun_line_of_sight.arcs import bound, compare, rss
from losnav.scenarios.sun_line_of_sight.orbit import anomalies, curve
from losnav.scenarios.sun_line_of_sight.result import ARCS, KM, POSITION, VELOCITY
from losnav.scenarios.sun_line_of_sight.study import kept_epochs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult

__all__ = ["draw_all"]

Array = NDArray[np.float64]

_SHOWN_RUNS = 20
_CONFIDENCE = 0.999  # of the bands of NEES and NIS
_DAY = 86400.0
_COLOURS = (PURPLE, BLUE, GREEN, ORANGE, RED, "#56B4E9", GREY, "black")
_SYSTEMS = {"backward": "system 1: backward, low degree", "forward": "system 2: forward, high degree"}
_HUE = {"backward": BLUE, "forward": ORANGE}
_GRID = 121  # points of a surface each way
_LINEAR = 1000.0  # km


def draw_all(result: SunLineOfSightResult, folder: Path) -> list[Path]:
    """Write every figure into ``folder`` and return the paths."""
    figures = {
        "sun-degree": _degree,
        "sun-surfaces": _surfaces,
        "sun-errors": _errors,
        "sun-accuracy": _accuracy,
        "sun-index": _index,
        "sun-consistency": _consistency,
        "sun-large-errors": _large_errors,
    }
    with figure_style():
        return [save_figure(draw(result), folder / f"{name}.png") for name, draw in figures.items()]


# --- the degree ----------------------------------------------------------------------------------------


def _degree(result: SunLineOfSightResult) -> Figure:
    s, f = result.scenario, np.degrees(anomalies())
    title = f"Observability degree along the orbit, unit of length {s.unit_length / KM / 1e8:.4g}e8 km"
    figure, axes = new_figure(2, 2, size=(11.0, 7.4), title=title, sharex=True)
    panels: tuple[tuple[str, str, tuple[Any, ...], Any], ...] = (
        ("the orbit, several orders", "order", (3, 4, 5), lambda x: f"derivatives up to {x}"),
        ("semi-major axis", "semi_major_axis", s.semi_major_axes, lambda x: f"a = {x / KM / 1e8:g}e8 km"),
        ("eccentricity", "eccentricity", s.eccentricities, lambda x: f"e = {x:g}"),
        ("inclination", "inclination", s.inclinations, lambda x: f"i = {np.degrees(x):.0f}°"),
    )
    for axis, (words, name, values, label) in zip(axes.flat, panels, strict=True):
        for k, (colour, value) in enumerate(zip(_COLOURS, values, strict=False)):
            look: dict[str, Any] = {"color": colour, "label": label(value)}
            if name == "inclination":  # they lie on each other
                look |= {"linewidth": 7.0 - 1.4 * k, "alpha": 0.7}
            axis.semilogy(f, curve(s, **{name: value}), **look)
        axis.set_title(words)
        axis.set_xlim(0, 360)
        axis.set_xticks(range(0, 361, 60))
        axis.legend(fontsize=7.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for axis in axes[1]:
        axis.set_xlabel("true anomaly [°]: perihelion, aphelion, perihelion")
    for axis in axes[:, 0]:
        axis.set_ylabel("degree δ = σ_min/σ_max")
    return figure


def _surfaces(result: SunLineOfSightResult) -> Figure:
    from matplotlib.colors import LogNorm

    s = result.scenario
    title = "Observability degree: the ridge moves with the semi-major axis only because the unit is fixed"
    figure, axes = new_figure(1, 3, size=(13.0, 4.6), title=title)
    f = np.linspace(0.0, 2 * np.pi, _GRID)
    fixed = f"unit of length {s.unit_length / KM / 1e8:.4g}e8 km"
    a = np.linspace(0.5, 4.0, _GRID)[:, None] * s.unit_length
    e = np.linspace(0.02, 0.95, _GRID)[:, None]
    panels = (
        (a / KM / 1e8, curve(s, f, semi_major_axis=a), "semi-major axis [1e8 km]", fixed),
        (
            a / KM / 1e8,
            curve(s, f, semi_major_axis=a, unit_length=np.broadcast_to(a, (_GRID, _GRID))),
            "semi-major axis [1e8 km]",
            "unit of length = semi-major axis",
        ),
        (e, curve(s, f, eccentricity=e), "eccentricity", fixed),
    )
    for axis, (y, values, label, words) in zip(axes.flat, panels, strict=True):
        mesh = axis.pcolormesh(
            np.degrees(f), y[:, 0], values, norm=LogNorm(1e-3, 1.0), cmap="viridis", shading="gouraud"
        )
        levels = [10.0**k for k in np.arange(-3, 0.1, 0.5)]
        axis.contour(np.degrees(f), y[:, 0], values, levels=levels, colors="white", linewidths=0.6)
        axis.set(xlabel="true anomaly [°]", ylabel=label)
        axis.set_xticks(range(0, 361, 90))
        axis.set_title(words)
        axis.grid(False)
    figure.colorbar(mesh, ax=axes[0, 2], label="degree δ")
    return figure


# --- errors --------------------------------------------------------------------------------------------


def _errors(result: SunLineOfSightResult) -> Figure:
    days, shown = result.times / _DAY, min(result.runs, _SHOWN_RUNS)
    title = (
        f"Errors of position, {shown} of {result.runs} runs (linear up to {_LINEAR:g} km, logarithmic beyond)"
    )
    figure, axes = new_figure(2, 3, size=(12.5, 6.4), title=title, sharex=True, sharey="row")
    for row, arc in zip(axes, ARCS, strict=True):
        error = result.arrays[f"{arc}_error"][..., POSITION] / KM
        sigma = 3 * np.sqrt(np.mean(result.arrays[f"{arc}_sigma"][..., POSITION] ** 2, axis=0)) / KM
        least = 3 * np.sqrt(np.diagonal(result.bound(arc), axis1=-2, axis2=-1)[:, POSITION]) / KM
        for k, axis in enumerate(row):
            axis.plot(days, error[:shown, :, k].T, color=GREY, linewidth=0.5, alpha=0.6)
            for sign in (1, -1):
                axis.plot(days, sign * sigma[:, k], color=RED)
                axis.plot(days, sign * least[:, k], color="black", linestyle=":", linewidth=1.8)
            axis.set_title(f"{_SYSTEMS[arc].split(',')[0]}, {'xyz'[k]}")
        row[0].set_ylabel("true − estimate [km]")
        row[0].set_yscale("symlog", linthresh=_LINEAR)
        row[0].set_ylim(-1.5 * sigma.max(), 1.5 * sigma.max())
        decades = 10.0 ** np.arange(3, np.ceil(np.log10(sigma.max())) + 1)
        row[0].set_yticks([*-decades[::-1], 0.0, *decades])
        row[0].set_yticks([], minor=True)
    for axis in axes[1]:
        axis.set_xlabel("time since the start, either way [d]")
    handles = [axes[0, 0].plot([], [], color=GREY, label="runs")[0]]
    handles += [axes[0, 0].plot([], [], color=RED, label="±3σ of the filter")[0]]
    handles += [axes[0, 0].plot([], [], color="black", linestyle=":", label="±3 × Cramér–Rao bound")[0]]
    figure.legend(handles=handles, loc="outside lower center", ncol=3)
    return figure


def _accuracy(result: SunLineOfSightResult) -> Figure:
    s, days = result.scenario, result.times / _DAY
    title = f"The system of low degree is the better one: rms of {result.runs} runs on the Cramér–Rao bound"
    figure, axes = new_figure(1, 2, size=(11.5, 4.9), title=title)
    printed = {"backward": (450.0, 75.0), "forward": (147.0, 29.0)}
    for k, (part, unit, label) in enumerate(
        ((POSITION, 1 / KM, "position, rss [km]"), (VELOCITY, 1e3, "velocity, rss [mm/s]"))
    ):
        axis = axes[0, k]
        for arc in ARCS:
            colour = _HUE[arc]
            rms = unit * np.sqrt(result.squares(arc, part).mean(axis=0))
            axis.semilogy(days, rms, color=colour, label=f"{_SYSTEMS[arc]}, rms")
            every = np.abs(s.forward.times) / _DAY
            least = unit * rss(bound(s, arc))[k]
            thin = slice(kept_epochs(s)[0], None, max(1, len(every) // 400))
            axis.semilogy(every[thin], least[thin], color="black", linestyle=":", linewidth=1.8)
            axis.plot(days[-1], printed[arc][k], "*", color=colour, markersize=12, clip_on=False, zorder=5)
        axis.plot([], [], "k:", linewidth=1.8, label="Cramér–Rao bound")
        axis.plot([], [], "*", color=GREY, markersize=12, label="printed final errors")
        axis.set(xlabel="time since the start, either way [d]", xlim=(0, days[-1]))
        axis.set_title(label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=4)
    return figure


def _index(result: SunLineOfSightResult) -> Figure:
    s, c = result.scenario, compare(result.scenario)
    title = (
        f"What predicts the error? {s.arcs} arcs of {s.duration / _DAY:.0f} days: an index should fall to "
        f"the right"
    )
    figure, axes = new_figure(1, 4, size=(13.5, 4.2), title=title, sharey=True)
    panels = (
        ("degree", "observability degree δ (mean)"),
        ("condition", "condition of the information, 1/κ"),
        ("horizon", f"σ_min, rows × Tᵏ/k!, T = {s.horizon / _DAY:.0f} d (mean)"),
        ("gramian", "σ_min of the arc's information"),
    )
    for axis, (name, label) in zip(axes.flat, panels, strict=True):
        values = getattr(c, name)
        position, velocity = c.correlations(name)
        points = axis.scatter(
            values,
            c.position / KM,
            c=np.degrees(c.anomaly),
            cmap="twilight",
            s=60,
            edgecolors="black",
            vmin=0,
            vmax=360,
        )
        axis.plot(
            np.append(values, values[0]), np.append(c.position, c.position[0]) / KM, color=GREY, zorder=0
        )
        axis.set(xscale="linear" if name == "condition" else "log", yscale="log", xlabel=label)
        good = max(position, velocity) < -0.5
        axis.set_title(
            f"rank correlation {position:+.2f}, velocity {velocity:+.2f}",
            fontsize=8.5,
            color=GREEN if good else RED,
        )
        _plain(*([axis.yaxis] if name == "condition" else [axis.xaxis, axis.yaxis]))
    axes[0, 0].set_ylabel("Cramér–Rao bound at the end, position [km]")
    figure.colorbar(points, ax=axes[0, 3], label="true anomaly at the start [°]", ticks=range(0, 361, 90))
    return figure


def _plain(*lines: Any) -> None:
    """Plain numbers on short logarithmic axes."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for line in lines:
        line.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        line.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        line.set_minor_formatter(NullFormatter())


def _consistency(result: SunLineOfSightResult) -> Figure:
    a, days = result.arrays, result.times / _DAY
    title = f"Is the filter as good as it says? Means over {result.runs} runs, exact {_CONFIDENCE:.1%} bands"
    figure, axes = new_figure(1, 3, size=(13.0, 4.4), title=title)
    span = len(result.scenario.forward.times) / len(days)
    for axis, name, dof, count in (
        (axes[0, 0], "nees", 6, result.runs),
        (axes[0, 1], "nis", 2, result.runs * span),
    ):
        for arc in ARCS:
            axis.plot(
                days, a[f"{arc}_{name}"].mean(axis=0), color=_HUE[arc], label=_SYSTEMS[arc].split(",")[0]
            )
        low, high = nees_bounds(dof, max(1, int(count)), _CONFIDENCE)
        axis.axhspan(low, high, color=GREEN, alpha=0.25, label="band")
        axis.axhline(dof, color=GREEN, linewidth=0.8)
        axis.set(xlabel="time since the start [d]", ylim=(dof - 2 * (dof - low), dof + 2 * (high - dof)))
        axis.set_title(
            f"{name.upper()}, {dof} degrees of freedom" + (", means of windows" if dof == 2 else "")
        )
    axes[0, 0].legend(loc="upper right", fontsize=8)
    axis = axes[0, 2]
    for words, colour in (("ignored", RED), ("modelled", GREEN)):
        found = result.arc(f"aberration {words}")
        axis.semilogy(days, found["nees"].mean(axis=0), color=colour, label=f"NEES, aberration {words}")
        axis.semilogy(days, found["nis"].mean(axis=0), color=colour, linestyle="--", label=f"NIS, {words}")
    for level in (6.0, 2.0):
        axis.axhline(level, color="black", linewidth=0.8, linestyle=":")
    axis.set(xlabel="time since the start [d]")
    axis.set_title("Aberration: the innovations see nothing")
    axis.legend(loc="center right", fontsize=8)
    return figure


def _large_errors(result: SunLineOfSightResult) -> Figure:
    s, days = result.scenario, result.times / _DAY
    title = (
        f"First error {s.large_factor:g} times larger: median of {result.runs} runs and half of them about it"
    )
    figure, axes = new_figure(1, 3, size=(13.0, 4.4), title=title)
    looks = (("once", RED, "linearised once"), ("iterated", BLUE, f"linearised {s.iterations} times"))
    for axis, arc in zip(axes[0], ARCS, strict=False):
        for words, colour, label in looks:
            distance = np.sqrt(result.squares(f"large error, {words}, {arc}")) / KM
            low, middle, high = np.quantile(distance, (0.25, 0.5, 0.75), axis=0)
            axis.fill_between(days, low, high, color=colour, alpha=0.2, linewidth=0)
            axis.semilogy(days, middle, color=colour, label=label)
        least = rss(result.bound(arc))[0] / KM
        axis.semilogy(days, least, "k:", linewidth=1.8, label="Cramér–Rao bound, 1 × error")
        axis.set(xlabel="time since the start [d]")
        axis.set_title(f"{_SYSTEMS[arc].split(',')[0]}: error of position [km]")
    axes[0, 0].legend(loc="upper right", fontsize=8)
    axis = axes[0, 2]
    for words, colour, label in looks:
        for arc, style in (("backward", "-"), ("forward", "--")):
            nis = result.arc(f"large error, {words}, {arc}")["nis"].mean(axis=0)
            axis.semilogy(days, nis, color=colour, linestyle=style, label=f"{label}, {arc}")
    axis.axhline(2.0, color="black", linewidth=0.8, linestyle=":")
    axis.set(xlabel="time since the start [d]")
    _plain(axis.yaxis)
    axis.set_title("mean NIS (2 if consistent)")
    axis.legend(loc="upper right", fontsize=8)
    return figure

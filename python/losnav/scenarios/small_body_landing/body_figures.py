"""Figures with the body in them: the descent over it, and what its harmonics are worth near it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav.plotting import BLUE, GREEN, ORANGE, RED, new_figure
from losnav.scenarios.small_body_landing.result import POSITION
from losnav.scenarios.small_body_landing.study import final_epochs
from losnav.scenarios.small_body_landing.truth import direction, fly, nearby_errors, shape_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult

__all__ = ["draw_descent", "draw_field"]

Array = NDArray[np.float64]

_KM = 1e-3
_LIGHT = np.array([0.55, -0.6, 0.58])
_MOMENTS = 5


def _solid(figure: Figure, place: Any, title: str) -> Any:
    axis: Any = figure.add_subplot(place, projection="3d")
    axis.set_title(title)
    return axis


def _surface(axis: Any, corners: Array, colours: Any, zoom: float = 1.0) -> None:
    """Faces (M, 3, 3), shaded by the sun from one side."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]

    axis.add_collection3d(Poly3DCollection(corners, facecolors=colours, edgecolors="none"))
    low, high = corners.reshape(-1, 3).min(axis=0), corners.reshape(-1, 3).max(axis=0)
    axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axis.set_box_aspect(high - low, zoom=zoom)


def _shaded(normals: Array, colour: Array) -> Array:
    """Colours (M, 3) or one, darker where the face looks away from the sun."""
    light = 0.35 + 0.65 * np.clip(normals @ (_LIGHT / np.linalg.norm(_LIGHT)), 0.0, 1.0)
    return np.asarray(np.clip(light[:, np.newaxis] * colour, 0.0, 1.0))


def draw_descent(result: SmallBodyLandingResult) -> Figure:
    """The body with the site, and the descent over the landmarks."""
    s, shape, flight = result.scenario, shape_of(result.scenario.shape), fly(result.scenario)
    title = f"Descent to the tip of the body ({shape.name})"
    figure, axes = new_figure(1, 1, size=(13.0, 5.6), title=title)
    axes[0, 0].remove()
    grid = figure.add_gridspec(1, 2, width_ratios=(1.0, 1.15))
    body = _solid(figure, grid[0], "body-fixed axes [km]: the descent in red")
    _surface(body, shape.corners * _KM, _shaded(shape.normals(), np.array([0.75, 0.7, 0.62])), 1.35)
    site = shape.radius(direction(s)) * direction(s)
    start = site + flight.site.site_from_fixed.T @ np.array(s.start_position)
    line = np.stack([site, start]) * _KM
    body.plot(*line.T, color=RED, linewidth=2.0, zorder=10)
    body.plot(*line[1:].T, "o", color=RED, markersize=5, zorder=11)
    body.set(xlabel="x", ylabel="y", zlabel="z", xlim=(-line.max(), line.max()))
    body.view_init(elev=20, azim=-35)
    _over_landmarks(
        _solid(figure, grid[1], "site frame [m]: landmarks (those used: blue) and images"), result
    )
    return figure


def _over_landmarks(axis: Any, result: SmallBodyLandingResult) -> None:
    flight = fly(result.scenario)
    path, marks = flight.descent.position, flight.catalogue
    used = flight.catalogue[flight.used]
    axis.plot(*marks.T, ".", color=ORANGE, markersize=4)
    axis.plot(*used.T, ".", color=BLUE, markersize=6)
    axis.plot(*path.T, color=RED, linewidth=2.0)
    for k in np.linspace(0, 0.75 * (len(flight.times) - 1), _MOMENTS).astype(int):
        where, three = flight.state.position[k], flight.chosen[k]
        for i in three[three >= 0]:
            axis.plot(*np.stack([where, used[i]]).T, color=GREEN, linewidth=0.7, alpha=0.8)
        axis.plot(*where[:, np.newaxis], "o", color=RED, markersize=4)
        axis.text(*where, f"  {flight.times[k]:.0f} s", fontsize=8)
    axis.set(xlabel="East", ylabel="North", zlabel="Up", zlim=(0, 1.05 * path[:, 2].max()))
    axis.view_init(elev=16, azim=-60)
    axis.set_box_aspect((1.0, 1.0, 0.8))


def draw_field(result: SmallBodyLandingResult) -> Figure:
    """Error of the harmonics over the body, and the filters on the polyhedron."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    shape, error = shape_of(result.scenario.shape), 100 * nearby_errors(result.scenario)
    title = f"Harmonics of degree 4 near the surface ({shape.name})"
    figure, axes = new_figure(1, 2, size=(13.0, 4.8), title=title)
    axes[0, 0].remove()
    axis = _solid(figure, axes[0, 0].get_subplotspec(), "body-fixed axes [km]")
    norm, colours = LogNorm(10.0, max(1000.0, float(error.max()))), colormaps["viridis"]
    tint = np.asarray(colours(norm(error)))[:, :3]
    _surface(axis, shape.corners * _KM, 0.55 * tint + 0.45 * _shaded(shape.normals(), tint))
    axis.view_init(elev=22, azim=-48)
    figure.colorbar(
        ScalarMappable(norm, colours),
        ax=axis,
        shrink=0.7,
        location="bottom",
        label="error of gravity 20 m above [%]",
    )
    bars = axes[0, 1]
    last = final_epochs(result.scenario)
    square = result.arrays["near_square"][:, :, -last:, POSITION].mean(axis=(0, 2))
    shown = len(result.names) - 1
    drawn = bars.barh(np.arange(shown), np.sqrt(square[:shown]), color=BLUE)
    bars.bar_label(drawn, fmt=" %.2f")
    bars.set_yticks(np.arange(shown), result.names[:shown])
    bars.invert_yaxis()
    bars.set_xscale("log")
    bars.set_xlim(0.3 * float(np.sqrt(square[:shown].min())), 2.0 * float(np.sqrt(square[:shown].max())))
    bars.set(xlabel="position RMSE at the end [m]", title="truth this polyhedron, filter its harmonics")
    return figure

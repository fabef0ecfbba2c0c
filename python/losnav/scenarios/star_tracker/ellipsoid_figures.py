"""Covariance ellipsoids in three dimensions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.plotting import BLUE, GREEN, ORANGE, PURPLE, new_figure
from losnav.scenarios.star_tracker.judging import ARCSEC

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.scenarios.star_tracker import StarTracker
    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["ellipsoids"]

Array = NDArray[np.float64]

_HEAD_COLOURS = (BLUE, GREEN, ORANGE)
_NARROW = 30.0  # deg
_ORTHOGONAL = math.pi / 2
_FUSED = "#303030"


def ellipsoids(result: StarTrackerResult) -> Figure:
    """Heads, their intersection and the fused ellipsoid: whole, and seen from near by."""
    from matplotlib.ticker import MaxNLocator

    s = result.scenario
    title = "1σ covariance ellipsoids of three heads, their intersection, and the fused one"
    figure, axes = new_figure(
        1, 3, size=(13.5, 4.7), title=title, subplot_kw={"projection": "3d", "computed_zorder": False}
    )
    across, about = s.head_sigma / ARCSEC, s.head_sigma * s.boresight_ratio / ARCSEC
    panels = (
        (90.0, 1.02 * about, True, "90° apart: each head knows least about its boresight"),
        (90.0, 1.3 * across, False, "90° apart, near by: fused inside the intersection"),
        (_NARROW, 1.02 * about, True, f"{_NARROW:.0f}° apart: the weak axes nearly coincide"),
    )
    for axis, (degrees, limit, whole, words) in zip(axes.flat, panels, strict=True):
        sweep = star_tracker.separation_sweep([s.head_covariance] * 3, math.radians(degrees))
        if whole:
            for mounting, colour in zip(sweep.mountings, _HEAD_COLOURS, strict=True):
                _surface(axis, _ellipsoid(mounting @ s.head_covariance @ mounting.T), colour, 0.30)
        _surface(axis, _ellipsoid(sweep.covariance), _FUSED, 0.95)
        if not whole:
            directions = _sphere(121, 61)
            cut = star_tracker.intersection_intercept([s.head_covariance] * 3, sweep.mountings, directions)
            _surface(axis, cut[..., None] / ARCSEC * directions, PURPLE, 0.34)
            radii = cut / ARCSEC
        axis.set(xlim=(-limit, limit), ylim=(-limit, limit), zlim=(-limit, limit))
        axis.set(xlabel="x [arcsec]", ylabel="y [arcsec]", zlabel="z [arcsec]")
        axis.set_box_aspect((1, 1, 1), zoom=0.95)
        for side in (axis.xaxis, axis.yaxis, axis.zaxis):
            side.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        axis.view_init(elev=22, azim=38)
        axis.set_title(words, fontsize=9)
    fused = float(star_tracker.separation_sweep([s.head_covariance] * 3, _ORTHOGONAL).sigma[2] / ARCSEC)
    _ellipsoid_legend(figure, s, fused, radii)
    return figure


def _ellipsoid(covariance: Array) -> Array:
    """Points of the 1-sigma ellipsoid, arcsec, as dense at the tips as at the waist."""
    values, axes = np.linalg.eigh(covariance)
    directions = (_sphere(49, 33) * np.sqrt(values)) @ axes.T
    return star_tracker.ellipsoid_points(covariance, directions) / ARCSEC


def _ellipsoid_legend(figure: Figure, s: StarTracker, fused: float, cut: Array) -> None:
    from matplotlib.patches import Patch

    sigma, k = s.head_sigma / ARCSEC, s.boresight_ratio
    handles = [
        Patch(
            color=colour,
            alpha=0.5,
            label=f"head {n + 1} ({sigma:.2f}″, {sigma * k:.1f}″ about its boresight)",
        )
        for n, colour in enumerate(_HEAD_COLOURS)
    ]
    handles += [
        Patch(
            color=PURPLE,
            alpha=0.5,
            label=f"intersection at 90° (radius {cut.min():.2f}″ to {cut.max():.2f}″)",
        ),
        Patch(color=_FUSED, label=f"fused (radius {fused:.2f}″ at 90°)"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncol=3, fontsize=8)


def _sphere(around: int, along: int) -> Array:
    """Directions on a grid of longitude and latitude, (along, around, 3)."""
    longitude, latitude = np.meshgrid(
        np.linspace(0, 2 * np.pi, around), np.linspace(-np.pi / 2, np.pi / 2, along)
    )
    across = np.cos(latitude)
    return np.stack([across * np.cos(longitude), across * np.sin(longitude), np.sin(latitude)], axis=-1)


def _surface(axis: Any, points: Array, colour: str, alpha: float) -> None:
    axis.plot_surface(
        *np.moveaxis(points, -1, 0),
        color=colour,
        alpha=alpha,
        rcount=points.shape[0],
        ccount=points.shape[1],
        linewidth=0,
        zorder=1,
    )

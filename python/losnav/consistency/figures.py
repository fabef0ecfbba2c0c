"""Figures of the consistency tests."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from losnav.plotting import BLUE, GREY, ORANGE, RED, figure_style, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from losnav.consistency.normalised_errors import NormalisedErrors
    from losnav.consistency.whiteness import Autocorrelation

__all__ = ["correlations", "normalised_errors"]

# Single runs drawn behind their average.
_RUNS = 20
# A value this many times the band's upper edge needs a logarithmic axis.
_TALL = 8.0


def normalised_errors(test: NormalisedErrors, path: str | os.PathLike[str] | None) -> Figure | Path:
    """Average over the runs, its band, a few runs behind it."""
    with figure_style():
        figure, grid = new_figure(size=(8.0, 4.2))
        axes = grid[0, 0]
        runs = test.value.reshape(-1, test.value.shape[-1])
        if len(runs) > 1:
            axes.plot(test.time, runs[:_RUNS].T, color=GREY, lw=0.5, alpha=0.3)
        axes.fill_between(
            test.time,
            test.lower,
            test.upper,
            color=BLUE,
            alpha=0.15,
            lw=0,
            label=f"{100 * test.confidence:g} %",
        )
        axes.plot(test.time, test.expected, color=BLUE, lw=1.0, label="expected")
        axes.plot(
            test.time, test.average, color=ORANGE, label="mean over the runs" if len(runs) > 1 else test.name
        )
        out = ~test.inside & (test.expected > 0)
        axes.plot(test.time[out], test.average[out], ".", color=RED, ms=4, label="outside")
        axes.set(xlabel="time, s", ylabel=test.name)
        _scale(axes, test)
        axes.set_title(test.summary().splitlines()[0], loc="left")
        axes.legend(ncols=4, loc="upper right")
        return figure if path is None else save_figure(figure, Path(path))


def _scale(axes, test: NormalisedErrors) -> None:  # type: ignore[no-untyped-def]
    """From zero to where the average and its band fit; logarithmic where a linear axis would flatten them."""
    top = float(np.nanmax(test.upper, initial=1.0))
    highest = float(np.nanmax(test.average, initial=0.0))
    if highest > _TALL * top:
        axes.set_yscale("log")
        axes.set_ylim(0.1 * float(np.nanmin(test.lower[test.expected > 0.0], initial=1.0)), 5.0 * highest)
    else:
        axes.set_ylim(0.0, 1.35 * max(top, highest))


def correlations(test: Autocorrelation, path: str | os.PathLike[str] | None) -> Figure | Path:
    """One panel for each component."""
    with figure_style():
        told = [k for k in range(test.value.shape[1]) if not np.isnan(test.value[:, k]).all()]
        figure, grid = new_figure(
            len(told) or 1, 1, size=(8.0, 1.2 + 1.7 * (len(told) or 1)), sharex=True, sharey=True
        )
        for axes, k in zip(grid[:, 0], told, strict=False):
            bound = test.bound[:, k]
            axes.fill_between(test.lags, -bound, bound, color=BLUE, alpha=0.15, lw=0, step="mid")
            axes.axhline(0.0, color=BLUE, lw=1.0)
            outside = np.abs(test.value[:, k]) > bound
            axes.vlines(test.lags, 0.0, test.value[:, k], color=np.where(outside, RED, ORANGE), lw=2.0)
            axes.set_ylabel(f"component {k}")
        grid[-1, 0].set(xlabel="lag, measurements", xlim=(0.0, test.lags[-1] + 1.0))
        grid[-1, 0].xaxis.get_major_locator().set_params(integer=True)
        grid[0, 0].set_title(test.summary().splitlines()[0].split(": the")[0], loc="left")
        return figure if path is None else save_figure(figure, Path(path))

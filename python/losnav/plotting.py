"""Figures for reports: one look, no global state, matplotlib only when asked for.

Figures are made without ``pyplot``: nothing is shown and no backend is chosen.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from losnav.errors import LosnavError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "AXIS_COLOURS",
    "BLUE",
    "GREEN",
    "GREY",
    "ORANGE",
    "PURPLE",
    "RED",
    "figure_style",
    "new_figure",
    "plain_ticks",
    "save_figure",
]

# Okabe and Ito's palette: distinguishable with every common form of colour blindness, and in print.
BLUE, ORANGE, GREEN, RED, PURPLE, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#7F7F7F"
#: Of x, y and z.
AXIS_COLOURS = (BLUE, GREEN, RED)

_STYLE: dict[str, Any] = {
    "font.size": 9.0,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10.0,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "lines.linewidth": 1.4,
}


@contextlib.contextmanager
def figure_style() -> Iterator[None]:
    """Draw in losnav's look within this context.

    Raises
    ------
    LosnavError
        If matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context
    except ImportError:
        raise LosnavError("figures need matplotlib: pip install 'losnav[plot]'") from None
    style: Any = _STYLE
    with rc_context(style):
        yield


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    size: tuple[float, float] = (8.0, 5.0),
    title: str = "",
    **options: Any,
) -> tuple[Figure, Any]:
    """Make a figure with a grid of axes, inside :func:`figure_style`.

    Parameters
    ----------
    rows, columns : int
        Grid of axes.
    size : (float, float)
        Width and height, inches.
    title : str
        Title of the whole figure.
    **options
        Passed to :meth:`matplotlib.figure.Figure.subplots`.

    Returns
    -------
    figure, axes
        ``axes`` is an array of shape (rows, columns).
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, dpi=130, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    if title:
        figure.suptitle(title, fontsize=11, fontweight="bold")
    return figure, axes


def plain_ticks(axis: Any, ticks: tuple[float, ...]) -> None:
    """Plain numbers on a logarithmic y axis."""
    axis.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_yticks([], minor=True)


def save_figure(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG, whole or not at all, and return its path."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.tmp")
    # No software version in the file: the same data give the same bytes.
    figure.savefig(temporary, format="png", metadata={"Software": None})
    temporary.replace(path)
    return path

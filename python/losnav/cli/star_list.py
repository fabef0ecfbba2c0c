"""Star lists: one CSV line for each star seen, what the camera measured beside what the catalogue says.

With a header line, columns stand in any order and unknown ones are ignored:

* measured: ``bx, by, bz`` (unit vector in camera axes) or ``u, v`` (pixels);
* catalogue: ``rx, ry, rz`` (unit vector) or ``ra, dec`` (degrees);
* optional: ``id``; ``sigma`` (rad), ``sigma_arcsec`` or ``sigma_px`` (1-sigma per axis of that star);
  ``mag`` or ``magnitude``.

Without a header, lines are ``bx, by, bz, rx, ry, rz``, or the same after an ``id``. Stars without an id are
called by their line. Empty lines and lines from a # on are skipped. Every error names file, line and column.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from losnav.cli.measurements import Observations, is_number, read_lines
from losnav.errors import InvalidInputError

__all__ = ["ARCSEC", "StarList", "read_stars"]

Array = NDArray[np.float64]

#: One second of arc, rad.
ARCSEC = math.pi / (180 * 3600)

# Same as the solver's: a longer or shorter vector is a mistake, not a direction.
_UNIT_TOLERANCE = 1e-2
_MEASURED = (("bx", "by", "bz"), ("u", "v"))
_CATALOGUE = (("rx", "ry", "rz"), ("ra", "dec"))
_SIGMA = ("sigma", "sigma_arcsec", "sigma_px")
_MAGNITUDE = ("mag", "magnitude")
_WANTED = "bx,by,bz or u,v; rx,ry,rz or ra,dec; and if known id, sigma, mag"
_RANGE = {"ra": (-180.0, 360.0), "dec": (-90.0, 90.0)}


@dataclass(frozen=True)
class StarList:
    """Matched stars of one image.

    Attributes
    ----------
    measured : Observations
        Names of the stars with their unit vectors in camera axes (N, 3) or pixels (N, 2).
    reference : (N, 3) array
        Catalogue directions, unit vectors.
    sigma : (N,) array or None
        1-sigma per axis as the file gives it.
    sigma_unit : {"rad", "px"}
        Unit of ``sigma``.
    magnitude : (N,) array or None
        NaN where the cell is empty.
    """

    measured: Observations
    reference: Array
    sigma: Array | None
    sigma_unit: str
    magnitude: Array | None


@dataclass(frozen=True)
class _Layout:
    """Where each column stands, and how many cells a line has at least."""

    index: dict[str, int]

    def of(self, choices: tuple[tuple[str, ...], ...]) -> tuple[str, ...] | None:
        return next((names for names in choices if all(name in self.index for name in names)), None)

    def first(self, names: tuple[str, ...]) -> str | None:
        return next((name for name in names if name in self.index), None)


def read_stars(path: Path, *, repeated: bool = False) -> StarList:
    """Read a star list.

    Parameters
    ----------
    path : Path
    repeated : bool
        Whether an id may come twice (wrong identifications do that); such stars are told apart by their line.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, a column is missing, a cell is not a number in its range, a vector is not
        of unit length, or an id comes twice.
    """
    lines = read_lines(path, _WANTED)
    layout, skipped = _layout(f"{path}:{lines[0][0]}", lines[0][1])
    if len(lines) == skipped:
        raise InvalidInputError(f"{path}: expected stars after the header, got none")
    places = [f"{path}:{number}" for number, _ in lines[skipped:]]
    cells = [row for _, row in lines[skipped:]]
    for place, row in zip(places, cells, strict=True):
        if len(row) <= max(layout.index.values()):
            raise InvalidInputError(
                f"{place}: expected at least {max(layout.index.values()) + 1} columns, got {len(row)}"
            )
    measured, catalogue = layout.of(_MEASURED) or _MEASURED[0], layout.of(_CATALOGUE) or _CATALOGUE[0]
    names = _names([number for number, _ in lines[skipped:]], places, cells, layout, repeated)
    values = _numbers(places, cells, layout, measured)
    if len(measured) == 3:
        values = _unit(places, values, measured)
    directions = _numbers(places, cells, layout, catalogue)
    unit = _unit(places, directions, catalogue) if len(catalogue) == 3 else _from_angles(directions)
    column, magnitude = layout.first(_SIGMA), layout.first(_MAGNITUDE)
    return StarList(
        Observations(names, values, tuple(places)),
        unit,
        _sigmas(places, cells, layout, column),
        "px" if column == "sigma_px" else "rad",
        None if magnitude is None else _numbers(places, cells, layout, (magnitude,))[:, 0],
    )


def _layout(place: str, first: list[str]) -> tuple[_Layout, int]:
    """Columns from a header or from the first line of numbers, and the lines taken."""
    count = len(first)
    if count > 1 and all(is_number(cell) for cell in first[1:]):
        if count not in (6, 7):
            raise InvalidInputError(
                f"{place}: expected a header, or bx,by,bz,rx,ry,rz with or without an id before them, got "
                f"{count} columns of numbers"
            )
        shift = count - 6
        columns = {name: shift + k for k, name in enumerate((*_MEASURED[0], *_CATALOGUE[0]))}
        return _Layout({**columns, "id": 0} if shift else columns), 0
    names = [cell.lower() for cell in first]
    known = {name for group in (*_MEASURED, *_CATALOGUE, _SIGMA, _MAGNITUDE, ("id",)) for name in group}
    if twice := next((name for name in names if name in known and names.count(name) > 1), None):
        raise InvalidInputError(f"{place}: expected each column once, got {twice!r} again")
    layout = _Layout({name: names.index(name) for name in names if name in known})
    for choices in (_MEASURED, _CATALOGUE):
        if layout.of(choices) is None:
            wanted = " or ".join(",".join(names) for names in choices)
            raise InvalidInputError(f"{place}: expected columns {wanted}, got {','.join(first)!r}")
    given = [name for name in _SIGMA if name in layout.index]
    if len(given) > 1:
        raise InvalidInputError(f"{place}: expected one column of sigmas, got {' and '.join(given)}")
    return layout, 1


def _names(
    numbers: list[int], places: list[str], cells: list[list[str]], layout: _Layout, repeated: bool
) -> tuple[str, ...]:
    if "id" not in layout.index:
        return tuple(f"line {number}" for number in numbers)
    names = [row[layout.index["id"]] for row in cells]
    seen: dict[str, str] = {}
    for place, name in zip(places, names, strict=True):
        if not name:
            raise InvalidInputError(f"{place}: id: expected a name, got an empty cell")
        if seen.setdefault(name, place) != place and not repeated:
            raise InvalidInputError(
                f"{place}: id: expected each id once, got {name!r} again (first at {seen[name]}); --robust "
                "chooses"
            )
    return tuple(
        f"{name} (line {number})" if names.count(name) > 1 else name
        for name, number in zip(names, numbers, strict=True)
    )


def _numbers(places: list[str], cells: list[list[str]], layout: _Layout, columns: tuple[str, ...]) -> Array:
    """Finite numbers of some columns, (N, columns)."""
    values = np.empty((len(cells), len(columns)))
    for k, (place, row) in enumerate(zip(places, cells, strict=True)):
        for j, column in enumerate(columns):
            text = row[layout.index[column]]
            if column in _MAGNITUDE and not text:
                values[k, j] = math.nan
                continue
            if not (is_number(text) and math.isfinite(float(text))):
                kind = "a finite number of degrees" if column in _RANGE else "a finite number"
                raise InvalidInputError(f"{place}: {column}: expected {kind}, got {text!r}")
            values[k, j] = float(text)
            low, high = _RANGE.get(column, (-math.inf, math.inf))
            if not low <= values[k, j] <= high:
                raise InvalidInputError(
                    f"{place}: {column}: expected degrees from {low:g} to {high:g}, got {text}"
                )
    return values


def _unit(places: list[str], vectors: Array, columns: tuple[str, ...]) -> Array:
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(vectors, axis=1)
    for place, norm in zip(places, norms, strict=True):
        if not abs(norm - 1) <= _UNIT_TOLERANCE:
            raise InvalidInputError(
                f"{place}: {','.join(columns)}: expected a unit vector, got one of length {norm:.6g}"
            )
    return np.asarray(vectors / norms[:, None])


def _from_angles(angles: Array) -> Array:
    """Unit vectors of right ascension and declination in degrees."""
    ra, dec = np.radians(angles.T)
    return np.column_stack([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def _sigmas(places: list[str], cells: list[list[str]], layout: _Layout, column: str | None) -> Array | None:
    if column is None:
        return None
    values = _numbers(places, cells, layout, (column,))[:, 0]
    for place, value in zip(places, values, strict=True):
        if not value > 0:
            raise InvalidInputError(f"{place}: {column}: expected a positive number, got {value:g}")
    return values * ARCSEC if column == "sigma_arcsec" else values

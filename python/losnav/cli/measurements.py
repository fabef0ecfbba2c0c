"""Measurement files: landmarks and observations as CSV, pixels turned into lines of sight.

Landmarks are lines ``id, x, y, z`` (metres); observations ``id, ux, uy, uz`` (unit vectors in camera axes) or
``id, u, v`` (pixels). A header line is optional; with one, columns may come in any order and others are
ignored. Empty lines and lines from a # on are skipped. Every error names file and line.

Pixels follow the pinhole of losnav, with radial distortion in normalised coordinates:

    [x_d, y_d] = [x, y] (1 + k1 r² + k2 r⁴),   r² = x² + y²,   [x, y] = [X/Z, Y/Z],   [u, v] = [f_x x_d + c_x,
    f_y y_d + c_y]

with x right, y down and the boresight towards +z (OpenCV's convention). Bundle Adjustment in the Large (BAL)
has y up and the camera looking along −z: for its pixels, give ``v`` with the opposite sign and turn its
rotation by ``diag(1, −1, −1)``.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from losnav import noise
from losnav.errors import InvalidInputError

__all__ = ["Camera", "Observations", "is_number", "read_landmarks", "read_lines", "read_observations"]

Array = NDArray[np.float64]

# Same as the solver's: a longer or shorter vector is a mistake, not a direction.
_UNIT_TOLERANCE = 1e-2
_MAX_NEWTON = 50
# A pixel farther out is within 2 minutes of arc of the image plane: a mistake in the units of the focal
# length.
_MAX_FOCAL_LENGTHS = 2000.0


@dataclass(frozen=True)
class Row:
    """One data line: its identifier, numbers, and place for error messages."""

    id: str
    values: tuple[float, ...]
    place: str


@dataclass(frozen=True)
class Observations:
    """What was seen: identifiers, and unit vectors (N, 3) or pixels (N, 2) with the place of each in its
    file."""

    ids: tuple[str, ...]
    values: Array
    places: tuple[str, ...]

    @property
    def pixels(self) -> bool:
        """Whether the values are pixels."""
        return bool(self.values.shape[1] == 2)


@dataclass(frozen=True)
class Camera:
    """Pinhole with radial distortion.

    Attributes
    ----------
    focal : (fx, fy)
        Focal lengths, px.
    centre : (cx, cy)
        Principal point, px.
    distortion : (k1, k2)
        Radial coefficients in normalised coordinates.
    undistortion : (k1, k2)
        Coefficients of the inverse model of plate solvers, ``[x, y] = [x_d, y_d] (1 + k1 r_d² + k2 r_d⁴)``;
        at most one of the two models.
    """

    focal: tuple[float, float]
    centre: tuple[float, float] = (0.0, 0.0)
    distortion: tuple[float, float] = (0.0, 0.0)
    undistortion: tuple[float, float] = (0.0, 0.0)

    def los(self, observations: Observations) -> Array:
        """Unit vectors in camera axes of all pixels, (N, 3).

        Raises
        ------
        InvalidInputError
            If a pixel lies at 90 degrees off axis for all practical purposes, or the distortion model has no
            image there (beyond the radius where it folds back).
        """
        with np.errstate(over="ignore"):
            distorted = (observations.values - np.array(self.centre)) / np.array(self.focal)
        far = np.flatnonzero(~(np.abs(distorted) <= _MAX_FOCAL_LENGTHS).all(axis=1))
        if far.size:
            raise InvalidInputError(
                f"{observations.places[far[0]]}: expected a pixel within {_MAX_FOCAL_LENGTHS:g} focal "
                f"lengths of the principal point, got {observations.values[far[0]].tolist()}"
            )
        plane = np.empty_like(distorted)
        for k, (place, point) in enumerate(zip(observations.places, distorted, strict=True)):
            scale = self._undistorted(math.hypot(*point))
            if scale is None:
                raise InvalidInputError(
                    f"{place}: expected a pixel inside the range of the distortion model, got "
                    f"{observations.values[k].tolist()}"
                )
            plane[k] = scale * point
        rays = np.column_stack([plane, np.ones(len(plane))])
        return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))

    def _undistorted(self, radius: float) -> float | None:
        """Ratio r/r_d that undoes the distortion at distorted radius r_d, by Newton's method; None where it
        folds."""
        if self.undistortion != (0.0, 0.0):
            square = radius * radius
            scale = 1 + self.undistortion[0] * square + self.undistortion[1] * square * square
            slope = 1 + 3 * self.undistortion[0] * square + 5 * self.undistortion[1] * square * square
            return scale if slope > 0 and 0 < scale < math.inf else None
        if radius == 0.0 or self.distortion == (0.0, 0.0):
            return 1.0
        k1, k2 = self.distortion
        r = radius
        for _ in range(_MAX_NEWTON):
            square = r * r
            slope = 1 + 3 * k1 * square + 5 * k2 * square * square
            if not 0 < slope < math.inf:
                return None
            step = (r * (1 + k1 * square + k2 * square * square) - radius) / slope
            r -= step
            if abs(step) <= 1e-15 * radius:
                return r / radius
        # Within rounding of the fold Newton may alternate in the last digit; anything more is no solution.
        return r / radius if abs(step) < 1e-12 * radius else None

    def covariance(self, los: Array, sigma_px: float) -> Array:
        """Covariance of each LOS for white pixel noise, rad², (N, 3) -> (N, 3, 3).

        That of a flat detector with square pixels; distortion is neglected. The mean variance is added along
        the LOS, where it does not act, to make the matrices invertible.
        """
        covariance = noise.focal_plane(los, sigma_px / math.sqrt(self.focal[0] * self.focal[1]))
        along = 0.5 * np.trace(covariance, axis1=1, axis2=2)
        return np.asarray(covariance + along[:, None, None] * los[:, :, None] * los[:, None, :])


def read_landmarks(path: Path) -> dict[str, tuple[float, ...]]:
    """Positions by identifier, m.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, a line is malformed, or an identifier comes twice.
    """
    return {row.id: row.values for row in _read(path, (("x", "y", "z"),))}


def read_observations(path: Path) -> Observations:
    """Unit vectors or pixels by identifier, in the order of the file.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, a line is malformed or no direction, or an identifier comes twice.
    """
    rows = _read(path, (("ux", "uy", "uz"), ("u", "v")))
    values = np.array([row.values for row in rows])
    if values.shape[1] == 3:
        norms = np.linalg.norm(values, axis=1)
        for row, norm in zip(rows, norms, strict=True):
            if not abs(norm - 1) <= _UNIT_TOLERANCE:
                raise InvalidInputError(
                    f"{row.place}: expected a unit vector for {row.id!r}, got one of length {norm:.6g}"
                )
        values = values / norms[:, None]
    return Observations(tuple(row.id for row in rows), values, tuple(row.place for row in rows))


def read_lines(path: Path, wanted: str) -> list[tuple[int, list[str]]]:
    """Line numbers and stripped cells of a CSV file, without comments and empty lines.

    Raises
    ------
    InvalidInputError
        If the file cannot be read or holds no line; the message says what was ``wanted``.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = [(number, _cells(cells)) for number, cells in enumerate(csv.reader(file), start=1)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidInputError(f"{path}: expected a readable CSV file, got: {reason}") from None
    lines = [(number, cells) for number, cells in lines if any(cells)]
    if not lines:
        raise InvalidInputError(f"{path}: expected lines {wanted}, got none")
    return lines


def _read(path: Path, layouts: tuple[tuple[str, ...], ...]) -> list[Row]:
    wanted = " or ".join(", ".join(("id", *layout)) for layout in layouts)
    lines = read_lines(path, wanted)
    columns, header = _columns(f"{path}:{lines[0][0]}", lines[0][1], layouts, wanted)
    rows, seen = [], dict[str, str]()
    for number, cells in lines[header:]:
        row = _row(f"{path}:{number}", cells, columns, wanted)
        if row.id in seen:
            raise InvalidInputError(
                f"{row.place}: expected each id once, got {row.id!r} again (first at {seen[row.id]})"
            )
        seen[row.id] = row.place
        rows.append(row)
    if not rows:
        raise InvalidInputError(f"{path}: expected lines {wanted} after the header, got none")
    return rows


def _cells(cells: list[str]) -> list[str]:
    """Stripped cells up to a comment."""
    kept = []
    for cell in cells:
        text, comment, _ = cell.partition("#")
        kept.append(text.strip())
        if comment:
            break
    return kept


def _columns(
    place: str, cells: list[str], layouts: tuple[tuple[str, ...], ...], wanted: str
) -> tuple[tuple[int, ...] | int, int]:
    """Where the columns are, from a header (indices) or from the first data line (their count); and the lines
    taken."""
    if all(is_number(cell) for cell in cells[1:]) and len(cells) > 1:
        if len(cells) - 1 not in {len(layout) for layout in layouts}:
            raise InvalidInputError(f"{place}: expected columns {wanted}, got {len(cells)} of them")
        return len(cells), 0
    names = [cell.lower() for cell in cells]
    for layout in layouts:
        if all(names.count(name) == 1 for name in ("id", *layout)):
            return tuple(names.index(name) for name in ("id", *layout)), 1
    raise InvalidInputError(
        f"{place}: expected columns {wanted} (numbers, or a header with these names), got {','.join(cells)!r}"
    )


def _row(place: str, cells: list[str], columns: tuple[int, ...] | int, wanted: str) -> Row:
    if isinstance(columns, int):
        if len(cells) != columns:
            raise InvalidInputError(
                f"{place}: expected {columns} columns as on the first line ({wanted}), got {len(cells)}"
            )
        columns = tuple(range(columns))
    if len(cells) <= max(columns):
        raise InvalidInputError(f"{place}: expected at least {max(columns) + 1} columns, got {len(cells)}")
    identifier, *texts = (cells[k] for k in columns)
    if not identifier:
        raise InvalidInputError(f"{place}: expected an id, got an empty one")
    for text in texts:
        if not (is_number(text) and math.isfinite(float(text))):
            raise InvalidInputError(f"{place}: expected finite numbers for {identifier!r}, got {text!r}")
    return Row(identifier, tuple(float(text) for text in texts), place)


def is_number(text: str) -> bool:
    """Whether a cell is a number (finite or not)."""
    try:
        float(text)
    except ValueError:
        return False
    return True

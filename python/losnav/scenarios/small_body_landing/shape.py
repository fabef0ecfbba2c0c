"""A body of constant density with flat faces: a built-in one, or a shape from a file.

The built-in shape is made up: an ellipsoid of 31.8 x 11.2 x 11.2 km, about as large as Eros, with a bend of
2 km, so that it has tips and a waist; it is not a model of any real surface. A file, ``.npz`` with
``vertices`` (N, 3) and ``faces`` (M, 3), or Wavefront ``.obj``, in metres or kilometres, brings a real one;
its axes must be the body-fixed axes of the scenario.

Harmonics of the shape by integration over the tetrahedra on its faces, exactly: the solid harmonics are
polynomials, and a polynomial homogeneous of degree n over a tetrahedron with its apex at the origin is
``1/(n + 3)`` of its integral over the base, for which seven points are exact to degree 5.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from losnav.errors import InvalidInputError

__all__ = ["Shape", "built_in", "read_shape"]

Array = NDArray[np.float64]

_SEMI_AXES = np.array([15.9e3, 5.6e3, 5.6e3])  # m
_BEND = 2e3  # m, how far the tips stand aside
_SUBDIVISIONS = 3
# Largest body in kilometres; whatever is smaller than this is not in metres.
_KILOMETRES = 1e3

# Radon's rule on a triangle: barycentric coordinates and weights, exact to degree 5.
_R15 = np.sqrt(15.0)
_NEAR, _FAR = (6 - _R15) / 21, (6 + _R15) / 21
_CORNERS = np.array(
    [[1 / 3, 1 / 3, 1 / 3]]
    + [np.roll([1 - 2 * a, a, a], k).tolist() for a in (_NEAR, _FAR) for k in range(3)]
)
_WEIGHTS = np.array([0.225, *[(155 - _R15) / 1200] * 3, *[(155 + _R15) / 1200] * 3])


@dataclass(frozen=True, eq=False)
class Shape:
    """A closed surface of triangles, seen from outside counterclockwise.

    Attributes
    ----------
    vertices : (N, 3) array
        Body-fixed, origin at the centre of mass, m.
    faces : (M, 3) array of int
        Indices of vertices.
    name : str
    """

    vertices: Array
    faces: NDArray[np.intp]
    name: str

    @cached_property
    def corners(self) -> Array:
        """Corners of the faces, (M, 3, 3), m."""
        return self.vertices[self.faces]

    @cached_property
    def volume(self) -> float:
        """m^3."""
        return float(self._determinants.sum() / 6)

    @cached_property
    def _determinants(self) -> Array:
        return np.asarray(np.linalg.det(self.corners))

    @cached_property
    def largest_radius(self) -> float:
        """Of the sphere round the centre that holds the body, m: harmonics converge outside it."""
        return float(np.linalg.norm(self.vertices, axis=1).max())

    def radius(self, direction: Array) -> float:
        """Distance from the centre to the surface along a unit vector, m; the outermost crossing."""
        # direction * t = a + u (b - a) + w (c - a)
        a, b, c = np.moveaxis(self.corners, 1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            system = np.stack([np.broadcast_to(direction, a.shape), a - b, a - c], axis=-1)
            solvable = np.abs(np.linalg.det(system)) > 0.0
            t, u, w = np.linalg.solve(system[solvable], a[solvable][..., np.newaxis])[..., 0].T
        edge = 1e-9
        hit = (t > 0) & (u >= -edge) & (w >= -edge) & (u + w <= 1 + edge)
        if not hit.any():
            raise InvalidInputError("shape: expected a closed surface round the origin, found a hole")
        return float(t[hit].max())

    def normals(self) -> Array:
        """Unit normals of the faces, outward, (M, 3)."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        normal = np.cross(b - a, c - a)
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def harmonics(self, degree: int, reference: float) -> tuple[Array, Array]:
        """Unnormalised ``C`` and ``S`` up to ``degree`` (at most 5) for constant density, (degree "
        "+ 1, degree + 1)."""
        points = np.einsum("kc,mcx->mkx", _CORNERS, self.corners)
        c, s = np.zeros((2, degree + 1, degree + 1))
        mass = self.volume
        for n, values in enumerate(_solid_harmonics(points / reference, degree)):
            for m, value in enumerate(values):
                # det/6 is the volume of a tetrahedron, 3/(n + 3) the integral along its rays.
                total = self._determinants @ (value @ _WEIGHTS) / 6 * 3 / (n + 3) / mass
                factor = (2 - (m == 0)) * _factorial_ratio(n, m)
                c[n, m], s[n, m] = factor * total.real, factor * total.imag
        return c, s


def _factorial_ratio(n: int, m: int) -> float:
    """(n - m)!/(n + m)!."""
    return float(1.0 / np.prod(np.arange(n - m + 1, n + m + 1, dtype=np.float64)))


def _solid_harmonics(points: Array, degree: int) -> list[list[Any]]:
    """``r^n P_nm(sin latitude) exp(i m longitude)`` of points (..., 3), unnormalised, no "
    "Condon-Shortley phase."""
    x, y, z = np.moveaxis(points, -1, 0)
    r2, plane = x * x + y * y + z * z, x + 1j * y
    table: list[list[Any]] = [[np.ones_like(plane)]]
    for n in range(1, degree + 1):
        row = []
        for m in range(n):
            before = table[n - 2][m] if m <= n - 2 else 0.0
            row.append(((2 * n - 1) * z * table[n - 1][m] - (n + m - 1) * r2 * before) / (n - m))
        row.append((2 * n - 1) * plane * table[n - 1][n - 1])
        table.append(row)
    return table


def built_in() -> Shape:
    """The made-up shape of the module's description, about its own centre of mass and principal axes."""
    sphere, faces = _sphere(_SUBDIVISIONS)
    vertices = sphere * _SEMI_AXES
    vertices[:, 1] += _BEND * sphere[:, 0] ** 2
    return _centred(vertices, faces, "made-up shape of Eros's size")


def read_shape(path: str) -> Shape:
    """Shape from a file; see the module.

    Raises
    ------
    InvalidInputError
        If the file cannot be read as a shape, or the shape does not hold its own centre.
    """
    try:
        if path.endswith(".npz"):
            with np.load(path) as stored:
                vertices, faces = stored["vertices"], stored["faces"]
        else:
            vertices, faces = _wavefront(Path(path).read_text(encoding="utf-8"))
        vertices, faces = np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.intp)
    except (OSError, KeyError, ValueError, IndexError) as error:
        raise InvalidInputError(f"shape: cannot read {path}: {error}") from error
    well = vertices.ndim == faces.ndim == 2 and vertices.shape[1] == faces.shape[1] == 3 and len(faces) >= 4
    if not well or not np.isfinite(vertices).all() or faces.min() < 0 or faces.max() >= len(vertices):
        raise InvalidInputError(f"shape: expected vertices (N, 3) and faces (M, 3) in {path}")
    if np.abs(vertices).max() < _KILOMETRES:
        vertices *= 1e3
    shape = Shape(vertices, faces, Path(path).stem)
    if not shape.volume > 0:
        raise InvalidInputError("shape: expected faces counterclockwise from outside; the volume is negative")
    return shape


def _wavefront(text: str) -> tuple[list[list[float]], list[list[int]]]:
    """Vertices and triangles of an OBJ file."""
    lines = [line.split() for line in text.splitlines()]
    vertices = [[float(number) for number in line[1:4]] for line in lines if line[:1] == ["v"]]
    faces = [[int(entry.split("/")[0]) - 1 for entry in line[1:4]] for line in lines if line[:1] == ["f"]]
    return vertices, faces


def _centred(vertices: Array, faces: NDArray[np.intp], name: str) -> Shape:
    """The shape about its centre of mass, with its principal axes: x the long one, z the short one."""
    shape = Shape(vertices, faces, name)
    a, b, c = np.moveaxis(shape.corners, 1, 0)
    center = shape._determinants @ (a + b + c) / 24 / shape.volume
    shape = Shape(vertices - center, faces, name)
    points = np.einsum("kc,mcx->mkx", _CORNERS, shape.corners)
    moment = np.einsum("m,k,mki,mkj->ij", shape._determinants, _WEIGHTS, points, points)
    axes = np.linalg.eigh(moment)[1][:, ::-1].T
    axes *= np.sign(np.diagonal(axes))[:, np.newaxis]
    axes[2] = np.cross(axes[0], axes[1])
    return Shape(shape.vertices @ axes.T, faces, name)


def _sphere(subdivisions: int) -> tuple[Array, NDArray[np.intp]]:
    """Unit sphere from an octahedron whose faces are cut in four."""
    vertices = [
        (1.0, 0.0, 0.0),
        (-1.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, -1.0, 0.0),
        (0.0, 0.0, 1.0),
        (0.0, 0.0, -1.0),
    ]
    points = [np.array(vertex) for vertex in vertices]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(subdivisions):
        middles: dict[tuple[int, int], int] = {}

        def middle(i: int, j: int, middles: dict[tuple[int, int], int] = middles) -> int:
            key = (min(i, j), max(i, j))
            if key not in middles:
                point = points[i] + points[j]
                points.append(point / np.linalg.norm(point))
                middles[key] = len(points) - 1
            return middles[key]

        cut = []
        for i, j, k in faces:
            a, b, c = middle(i, j), middle(j, k), middle(k, i)
            cut += [(i, a, c), (a, j, b), (c, b, k), (a, b, c)]
        faces = cut
    return np.array(points), np.array(faces, dtype=np.intp)

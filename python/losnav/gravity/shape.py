"""Shape models from files."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from losnav._arrays import FloatArray, finite
from losnav.errors import InvalidInputError


def read_shape(path: str | Path, *, unit: float = 1.0) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Vertices and faces of a shape model in a text file of ``v x y z`` and ``f i j k`` lines.

    Wavefront OBJ, and the plate models of the Planetary Data System that are written like it; other lines are
    skipped. Indices count from 1 as in OBJ, or from 0 if an index 0 occurs. Faces of more than three corners
    are cut into triangles.

    Parameters
    ----------
    path : str or Path
        The file.
    unit : float
        Metres in the unit of the file: 1000.0 for kilometres.

    Returns
    -------
    vertices : (V, 3)
        m.
    faces : (F, 3)
        Indices of vertices, from 0: for :class:`Polyhedron`.

    Raises
    ------
    InvalidInputError
        On a line that cannot be read (it is named), or a file without a shape.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import losnav as ln
    >>> text = "v 1 0 0\\nv 0 1 0\\nv 0 0 1\\nv 0 0 0\\nf 1 2 3\\nf 1 3 4\\nf 1 4 2\\nf 2 4 3\\n"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "shape.obj"
    ...     _ = path.write_text(text)
    ...     vertices, faces = ln.gravity.read_shape(path, unit=1000.0)
    >>> ln.gravity.Polyhedron(vertices, faces, density=2000.0).contains([100.0, 100.0, 100.0])
    np.True_
    """
    scale = finite(unit, "unit")
    if scale.ndim or not scale > 0.0:
        raise InvalidInputError(f"unit: expected a number > 0, got {unit!r}")
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    with open(path, encoding="utf-8", errors="replace") as file:
        for number, line in enumerate(file, 1):
            kind, *words = line.split() or [""]
            try:
                if kind == "v":
                    x, y, z = (float(word) for word in words[:3])
                    vertices.append([x, y, z])
                elif kind == "f":
                    # Of "corner/texture/normal" the corner.
                    first, *others = (int(word.split("/")[0]) for word in words)
                    faces += [[first, a, b] for a, b in pairwise(others)]
            except ValueError as error:
                raise InvalidInputError(f"{path}, line {number}: cannot be read: {line.strip()!r}") from error
    if not vertices or not faces:
        raise InvalidInputError(f"{path}: expected lines 'v x y z' and 'f i j k', found no shape")
    table = np.array(faces, dtype=np.int64)
    if table.min() > 0:
        table -= 1
    return float(scale) * finite(vertices, "vertices"), table

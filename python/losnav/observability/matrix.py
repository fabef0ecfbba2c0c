"""Rank, degree and weak directions of any matrix whose columns are the components of a state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, finite, vectors
from losnav.errors import InvalidInputError

IntArray: TypeAlias = npt.NDArray[np.int64]
Self_ = TypeVar("Self_", bound="Observability")

# What rounding of a matrix that comes out of a model leaves of a singular value that is zero, beside the
# largest: Lie matrices of high order and many states up to 2e-12.
ROUNDING = 1e-11
# A share of a direction that is not worth a word.
NEGLIGIBLE_SHARE = 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Observability:
    """How well ``N`` state components are determined; every array has the batch shape ``(...)``.

    Attributes
    ----------
    rank : int or (...)
        Components that can be known.
    singular_values : (..., N)
        Of the scaled matrix, largest first; zeros where it has fewer rows than columns.
    degree : float or (...)
        Smallest over largest singular value, in [0, 1]; 0 if nothing can be known about some direction.
    directions : (..., N, N)
        Columns: directions of the state, best known first, in the state's own units, each as long as one unit
        vector after division by ``scale``.
    labels : tuple of str
        Names of the components.
    scale : (..., N)
        Size of one unit of each component.
    """

    rank: int | IntArray
    singular_values: FloatArray
    degree: float | FloatArray
    directions: FloatArray
    labels: tuple[str, ...]
    scale: FloatArray

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape; ``()`` for one problem."""
        return self.singular_values.shape[:-1]

    @property
    def weakest(self) -> FloatArray:
        """Direction known worst (or not at all), ``(..., N)``."""
        return self.directions[..., -1]

    @property
    def unobservable(self) -> Any:
        """Basis of what cannot be known, ``(N, N - rank)``: ``matrix @ unobservable`` is zero.

        An object array of such bases for a batch, whose members may differ in rank.
        """
        if not self.shape:
            return self.directions[:, int(self.rank) :]
        bases = np.empty(self.shape, dtype=object)
        for index in np.ndindex(self.shape):
            bases[index] = self[index].unobservable
        return bases

    def __getitem__(self: Self_, index: Any) -> Self_:
        """One problem of a batch, or several."""
        lead = np.empty(self.shape)[index].shape
        changes = {}
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray) and value.shape[: len(self.shape)] == self.shape != ():
                taken = value[index]
                changes[field.name] = taken if np.ndim(taken) or lead else plain(taken)
        return replace(self, **changes)

    def __repr__(self) -> str:
        name = type(self).__name__
        if self.shape:
            return f"{name}(shape={self.shape}, {_ranks(self)})"
        return f"{name}(rank {self.rank} of {len(self.labels)}, degree {self.degree:.3g})"

    def __str__(self) -> str:
        return _summary(self) if self.shape else "\n".join(self._lines())

    def _lines(self) -> list[str]:
        count = len(self.labels)
        units = " (directions in units of the scale)" if np.any(self.scale != 1.0) else ""
        lines = [f"rank {self.rank} of {count}{units}"]
        lost = self.unobservable / self.scale[:, np.newaxis]
        if lost.size:
            return lines + [f"unobservable: {_combination(v, self.labels)}" for v in _echelon(lost)]
        lines.append(f"degree {self.degree:.3g} (smallest over largest singular value)")
        return [*lines, f"weakest: {_combination(self.weakest / self.scale, self.labels)}"]


def degree(matrix: ArrayLike) -> Any:
    """Observability degree: smallest over largest singular value, in [0, 1].

    Parameters
    ----------
    matrix : (..., M, N)
        Columns are state components. With fewer rows than columns the degree is 0.

    Returns
    -------
    float or (...)

    Raises
    ------
    InvalidInputError
        If the matrix is not finite or has no columns.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.observability.degree([[2.0, 0.0], [0.0, 1.0]])
    0.5
    """
    return plain(ratio(_singular(_matrix(matrix))[0]))


def analyze(
    matrix: ArrayLike,
    labels: Sequence[str] | None = None,
    scale: ArrayLike | None = None,
    *,
    tolerance: float | None = None,
) -> Observability:
    """What a matrix can tell about the state its columns stand for.

    Parameters
    ----------
    matrix : (..., M, N)
        Stacked Jacobian, Lie matrix or the like; rows in units of their noise if rows are to be compared.
    labels : N names, optional
        Names of the components; ``x0, x1, ...`` otherwise.
    scale : (N,), optional
        Typical size of each component. The columns are multiplied by it, so that rank and degree do not
        depend on the units of the state.
    tolerance : float, optional
        A singular value below this part of the largest counts as zero; 1e-11 otherwise, what a few hundred
        operations in double precision leave of a zero.

    Returns
    -------
    Observability
        ``print`` it: rank, degree, and the weak or lost directions by their labels.

    Raises
    ------
    InvalidInputError
        On a matrix that is not finite, labels or scale of the wrong length, a scale that is not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> print(ln.observability.analyze([[1.0, 1.0, 0.0], [0.0, 0.0, 2.0]], labels=["x", "y", "z"]))
    rank 2 of 3
    unobservable: x - y
    """
    array = _matrix(matrix)
    count = array.shape[-1]
    sizes = np.ones(count) if scale is None else vectors(scale, "scale", count)
    if sizes.ndim != 1 or not (sizes > 0.0).all():
        raise InvalidInputError(f"scale: expected {count} positive numbers, got {sizes}")
    names = tuple(f"x{k}" for k in range(count)) if labels is None else tuple(str(name) for name in labels)
    if len(names) != count:
        raise InvalidInputError(f"labels: expected {count} names, one for each column, got {len(names)}")
    values, right = _singular(array * sizes)
    floor = ROUNDING if tolerance is None else float(tolerance)
    return Observability(
        rank=plain((values > floor * values[..., :1]).sum(axis=-1)),
        singular_values=values,
        degree=plain(ratio(values)),
        directions=sizes[:, np.newaxis] * right,
        labels=names,
        scale=np.broadcast_to(sizes, values.shape),
    )


# --- numbers and words -----------------------------------------------------------------------------------


def _matrix(value: ArrayLike) -> FloatArray:
    array = finite(value, "matrix")
    if array.ndim < 2 or array.shape[-1] < 1:
        raise InvalidInputError(f"matrix: expected shape (..., M, N), N at least one, got {array.shape}")
    return array


def _singular(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``(..., N)`` values, zeros included, and ``(..., N, N)`` right vectors as columns."""
    missing = max(matrix.shape[-1] - matrix.shape[-2], 0)
    tall = np.concatenate([matrix, np.zeros((*matrix.shape[:-2], missing, matrix.shape[-1]))], axis=-2)
    _, values, right = np.linalg.svd(tall, full_matrices=False)
    return values, np.swapaxes(right, -1, -2)


def ratio(values: FloatArray) -> FloatArray:
    largest = values[..., 0]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(largest > 0.0, values[..., -1] / largest, np.where(np.isnan(largest), np.nan, 0.0))


def plain(value: Any) -> Any:
    """A Python number where there is no batch."""
    return value if np.ndim(value) or not isinstance(value, np.ndarray | np.generic) else value.item()


def _echelon(basis: FloatArray) -> FloatArray:
    """The same space by vectors with few components each, for reading: reduced row echelon form."""
    rows: FloatArray = basis.T.copy()
    for k in range(len(rows)):
        pivot = np.unravel_index(np.abs(rows[k:]).argmax(), rows[k:].shape)
        rows[[k, k + pivot[0]]] = rows[[k + pivot[0], k]]
        rows[k] /= rows[k, pivot[1]]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, pivot[1]] * rows[k]
    return rows


def _combination(vector: FloatArray, labels: tuple[str, ...]) -> str:
    """``0.8 x - 0.6 y``; equal parts without numbers, small parts not at all."""
    top = np.abs(vector).max()
    shares = zip(vector / top, labels, strict=True)
    parts = [(c, name) for c, name in shares if abs(c) > NEGLIGIBLE_SHARE]
    if parts[0][0] < 0.0:
        parts = [(-c, name) for c, name in parts]
    text = ""
    for c, name in parts:
        sign = (" + " if c > 0.0 else " - ") if text else ""
        text += f"{sign}{'' if abs(c) > 0.995 else f'{abs(c):.2g} '}{name}"
    return text


def _ranks(result: Observability) -> str:
    """``rank 6 in 215, 5 in 1``."""
    found, counts = np.unique(result.rank, return_counts=True)
    return "rank " + ", ".join(f"{r} in {c}" for r, c in zip(found[::-1], counts[::-1], strict=True))


def _summary(result: Observability) -> str:
    size = int(np.prod(result.shape))
    if not size:
        return f"no problems (shape {result.shape})"
    spread = np.where(np.isnan(result.degree), np.inf, result.degree)
    worst = np.unravel_index(int(spread.argmin()), result.shape)
    index = ", ".join(str(int(k)) for k in worst)
    lines = [
        f"{size} problems (shape {result.shape}): {_ranks(result)}",
        f"degree {np.nanmin(spread):.3g} to {np.max(spread[np.isfinite(spread)], initial=0.0):.3g}",
        f"weakest problem [{index}]: " + str(result[worst]).replace("\n", "\n  "),
    ]
    return "\n".join(lines)

"""How well several heads know one attitude: information adds, in the axes of the fusion frame.

    F = sum_n S_n [ sum_i (1/sigma_ni^2) (I - b_ni b_ni') ] S_n'                     (X14)
    P = ( sum_n S_n P_n^-1 S_n' )^-1,     P_n covariance of head n in its own axes   (X17)

``S_n`` (``mountings``) takes head axes to fusion axes. Both are covariances of the small rotation
``dalpha`` in fusion axes, rad. (X17) needs every head to have an attitude of its own; a head that sees one
star has none, but informs about two axes all the same: (X14) counts it.

Sources: Shuster & Oh, J. Guidance and Control 4 (1981); Xiong, Wu & Cheng, J. Chinese Inertial Technology 24
(2016). Leaves out: noise that is not isotropic about its line of sight (for that see
:meth:`Head.information`), mounting errors (:mod:`losnav.star_tracker.mounting`), and anything
of second order in the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, as_float64, broadcast, positive, rotations, units
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError, UnobservableError

__all__ = [
    "fused_covariance",
    "fused_covariance_from_stars",
    "fused_information",
    "star_information",
]

# Smallest over largest eigenvalue below which a matrix of doubles has no inverse.
SINGULAR = 1e-14
# Numbers whose products and inverses stay in range; a covariance is the square of one.
SMALLEST, LARGEST = 1e-50, 1e50


def star_information(body_vectors: ArrayLike, sigma: ArrayLike = 1.0) -> FloatArray:
    """Information of one head's stars about its attitude, ``sum (1/sigma^2) (I - b b')`` (equation X14).

    Parameters
    ----------
    body_vectors : (..., N, 3)
        Unit vectors in head axes; N may be 0 or 1.
    sigma : scalar, (N,) or (..., N)
        1-sigma noise per axis across each direction, rad.

    Returns
    -------
    (..., 3, 3)
        In head axes, 1/rad^2. Of rank 2 for a single star, zero without stars: an answer, not an error.

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, a ``sigma`` that is not positive, or shapes that do not fit.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.star_tracker.star_information([[0.0, 0.0, 1.0]], 0.5)
    array([[4., 0., 0.],
           [0., 4., 0.],
           [0., 0., 0.]])
    """
    b = units(body_vectors, "body_vectors")
    if b.ndim < 2:
        raise InvalidInputError(f"body_vectors: expected shape (..., N, 3), got {b.shape}")
    spread = in_scale(positive(sigma, "sigma"), "sigma")
    try:
        weight = np.broadcast_to(spread, np.broadcast_shapes(spread.shape, b.shape[:-1])) ** -2.0
    except ValueError as error:
        raise InvalidInputError(
            f"sigma: expected a scalar or a shape that broadcasts with {b.shape[:-1]}, got {spread.shape}"
        ) from error
    unit = b / np.linalg.norm(b, axis=-1, keepdims=True)
    outer = np.einsum("...n,...ni,...nj->...ij", weight, unit, unit)
    return np.asarray(weight.sum(axis=-1)[..., np.newaxis, np.newaxis] * np.eye(3) - outer)


def fused_information(informations: ArrayLike, mountings: ArrayLike) -> FloatArray:
    """Information of all heads in fusion axes, ``sum S_n F_n S_n'`` (equations X14, X17).

    Parameters
    ----------
    informations : (..., N, 3, 3)
        Of each head in its own axes, 1/rad^2; singular ones are welcome.
    mountings : (N, 3, 3) or (..., N, 3, 3)
        Fusion from head.

    Returns
    -------
    (..., 3, 3)
        In fusion axes, 1/rad^2.

    Raises
    ------
    InvalidInputError
        On a matrix that is not symmetric positive semidefinite, no rotation, or counts that differ.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> one_star = ln.star_tracker.star_information([[0.0, 0.0, 1.0]])
    >>> turned = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]        # the second head looks along fusion x
    >>> ln.star_tracker.fused_information([one_star, one_star], [np.eye(3), turned])
    array([[1., 0., 0.],
           [0., 2., 0.],
           [0., 0., 1.]])
    """
    shape, (f, s) = with_mountings(
        ("informations", in_scale(checked_covariances(informations, "informations"), "informations", 2)),
        mountings,
    )
    return _summed(f, s).reshape((*shape, 3, 3))


def fused_covariance(covariances: ArrayLike, mountings: ArrayLike) -> FloatArray:
    """Covariance of the fused attitude from those of the heads, ``(sum S_n P_n^-1 S_n')^-1`` (equation X17).

    Parameters
    ----------
    covariances : (..., N, 3, 3)
        Attitude covariance of each head in its own axes, rad^2, positive definite.
    mountings : (N, 3, 3) or (..., N, 3, 3)
        Fusion from head.

    Returns
    -------
    (..., 3, 3)
        Of ``dalpha`` in fusion axes, rad^2.

    Raises
    ------
    InvalidInputError
        On a matrix that is no covariance or singular, no rotation, or counts that differ.

    Examples
    --------
    Three equal orthogonal heads, 2.5" across and 17.5" about their boresights: equal in all axes.

    >>> import numpy as np
    >>> import losnav as ln
    >>> head = np.diag([2.5, 2.5, 17.5]) ** 2                               # any unit: here arcsec^2
    >>> x, y, z = np.eye(3)
    >>> mountings = [np.column_stack(axes) for axes in [(x, y, z), (y, z, x), (z, x, y)]]
    >>> fused = ln.star_tracker.fused_covariance([head] * 3, mountings)
    >>> np.sqrt(np.diag(fused)).round(3)
    array([1.759, 1.759, 1.759])
    """
    shape, (f, s) = with_mountings(
        ("covariances", inverse_covariances(covariances, "covariances")), mountings
    )
    return inverse_information(_summed(f, s).reshape((*shape, 3, 3)))


def fused_covariance_from_stars(
    mountings: ArrayLike,
    body_vectors: Sequence[ArrayLike],
    sigmas: ArrayLike | Sequence[ArrayLike] = 1.0,
    *,
    on_error: Literal["raise", "nan"] = "raise",
) -> FloatArray:
    """Covariance of the fused attitude from the stars themselves (equation X14): heads may see 0 or 1.

    Parameters
    ----------
    mountings : (N, 3, 3)
        Fusion from head.
    body_vectors : sequence of N arrays (..., N_n, 3)
        Unit vectors of each head in its own axes.
    sigmas : scalar, or sequence of N scalars or arrays (N_n,)
        1-sigma noise per axis, rad.
    on_error : {"raise", "nan"}
        What a problem of a batch does whose stars leave a rotation free.

    Returns
    -------
    (..., 3, 3)
        Of ``dalpha`` in fusion axes, rad^2.

    Raises
    ------
    InvalidInputError
        On bad arguments.
    UnobservableError
        If all stars together lie in one direction; the message says which rotation is free.

    Examples
    --------
    One star in each of three orthogonal heads, 5":

    >>> import numpy as np
    >>> import losnav as ln
    >>> x, y, z = np.eye(3)
    >>> mountings = [np.column_stack(axes) for axes in [(x, y, z), (y, z, x), (z, x, y)]]
    >>> stars = [[z], [z], [z]]
    >>> covariance = ln.star_tracker.fused_covariance_from_stars(mountings, stars, 5.0)
    >>> np.sqrt(np.diag(covariance)).round(3)
    array([3.536, 3.536, 3.536])
    """
    spreads = per_head(sigmas, len(body_vectors), "sigmas")
    informations = []
    for n, (stars, sigma) in enumerate(zip(body_vectors, spreads, strict=True)):
        try:
            informations.append(star_information(stars, sigma))
        except InvalidInputError as error:
            raise renamed(error, {"body_vectors": f"body_vectors[{n}]", "sigma": f"sigmas[{n}]"}) from None
    try:
        stacked = np.stack(np.broadcast_arrays(*informations), axis=-3)
    except ValueError as error:
        shapes = ", ".join(str(f.shape[:-2]) for f in informations)
        raise InvalidInputError(f"body_vectors: leading dimensions do not broadcast: {shapes}") from error
    return inverse_information(fused_information(stacked, mountings), on_error)


def symmetric(matrix: FloatArray) -> FloatArray:
    """Symmetric to the last bit, as a covariance should be."""
    return np.asarray(0.5 * (matrix + np.swapaxes(matrix, -1, -2)))


def inverse_covariances(value: ArrayLike, name: str) -> FloatArray:
    """Inverses of positive definite ``(..., 3, 3)``; refuses singular ones, naming the first."""
    array = in_scale(checked_covariances(value, name), name, 2)
    inverse, singular = _inverse(array)
    if singular.any():
        index = [int(i) for i in np.argwhere(singular)[0]]
        raise InvalidInputError(
            f"{name}{index or ''}: expected a positive definite matrix, got a singular one; "
            "a head with fewer than two stars has no covariance: use the stars themselves"
        )
    return inverse


def inverse_information(information: FloatArray, on_error: str = "raise") -> FloatArray:
    """Covariance of an information matrix; says what is free where there is none."""
    if on_error not in ("raise", "nan"):
        raise InvalidInputError(f'on_error: expected "raise" or "nan", got {on_error!r}')
    inverse, singular = _inverse(information)
    if on_error == "nan":
        inverse[singular] = np.nan
        return inverse
    if singular.any():
        index = tuple(int(i) for i in np.argwhere(singular)[0])
        _, axes = np.linalg.eigh(information[index])
        axis = ", ".join(f"{x:.3f}" for x in axes[:, 0])
        where = f" (problem {list(index)} of the batch)" if index else ""
        raise UnobservableError(
            f"attitude: rotation about fusion axis [{axis}] is free, expected stars in two directions{where}"
        )
    return inverse


def in_scale(array: FloatArray, name: str, core: int = 0) -> FloatArray:
    """Refuse what leaves the range of numbers when squared or inverted; matrices by their largest entry."""
    size = np.abs(array).max(axis=tuple(range(-core, 0)), initial=0.0) if core else np.abs(array)
    power = 2 if core == 2 else 1
    bad = (size > LARGEST**power) | ((size > 0.0) & (size < SMALLEST**power))
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        raise InvalidInputError(
            f"{name}{list(index) or ''}: expected a size between {SMALLEST**power:g} and {LARGEST**power:g}, "
            f"got {size[index]:g}"
        )
    return array


def per_head(value: Any, count: int, name: str, *, scalar: bool = True) -> list[Any]:
    """One entry for each head, of a sequence with as many; with ``scalar`` also one value for all."""
    if not isinstance(value, list | tuple):
        if scalar and np.ndim(value) == 0:
            return [value] * count
        array = as_float64(value, name)
        if not array.ndim:
            raise InvalidInputError(f"{name}: expected {count} entries, one for each head, got one number")
        value = list(array)
    entries = list(value)
    if len(entries) != count:
        raise InvalidInputError(f"{name}: expected {count} entries, one for each head, got {len(entries)}")
    return entries


def renamed(error: InvalidInputError, names: dict[str, str]) -> InvalidInputError:
    """The same complaint under the name the caller's argument has."""
    text = str(error)
    for inner, outer in names.items():
        if text.startswith(inner):
            return InvalidInputError(outer + text[len(inner) :])
    return error


def _inverse(array: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Inverses, and which matrices have none; those are left as identities."""
    # Of order one, products of entries neither overflow nor underflow.
    largest = np.abs(array).max(axis=(-2, -1), keepdims=True)
    scale = np.where(largest > 0.0, largest, 1.0)
    unit = array / scale
    singular = ~(np.linalg.eigvalsh(unit)[..., 0] > SINGULAR)
    safe = np.where(singular[..., np.newaxis, np.newaxis], np.eye(3), unit)
    return symmetric(np.linalg.inv(safe)) / scale, singular


def _summed(f: FloatArray, s: FloatArray) -> FloatArray:
    return symmetric((s @ f @ np.swapaxes(s, -1, -2)).sum(axis=-3))


def with_mountings(
    named: tuple[str, FloatArray], mountings: ArrayLike
) -> tuple[tuple[int, ...], tuple[FloatArray, FloatArray]]:
    """Batch shape and flat ``(B, N, 3, 3)`` of matrices and mountings with one entry for each head."""
    name, matrices = named
    s = rotations(mountings, "mountings")
    if matrices.ndim < 3 or s.ndim < 3:
        short, got = (name, matrices.shape) if matrices.ndim < 3 else ("mountings", s.shape)
        raise InvalidInputError(f"{short}: expected shape (..., N, 3, 3), got {got}")
    same_count(s, matrices.shape[-3], "mountings", 3)
    shape, (flat, turns) = broadcast((name, matrices, 3), ("mountings", s, 3))
    return shape, (flat, turns)


def same_count(array: FloatArray, count: int, name: str, core: int) -> None:
    """Refuse an array without one entry for each head."""
    if array.ndim < core or array.shape[-core] != count:
        raise InvalidInputError(
            f"{name}: expected {count} entries, one for each head, got shape {array.shape}"
        )

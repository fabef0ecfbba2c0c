"""Image-level fusion: the stars of all heads turned into fusion axes, one attitude problem.

    J(A) = 1/2 sum_n sum_i |S_n b_ni - A r_ni|^2 / sigma_ni^2                              (equation X1)

Two stars in all suffice, from whatever heads, and far apart they are worth more than many in one. Where every
head has an attitude of its own the result is that of :func:`fuse_attitudes`; image-level fusion wins with
fewer stars.

Noise that is not the same in all directions across a star (:class:`PixelNoise`, an uncertain catalogue) is no
Wahba problem; then

    min sum (S b - A r)' W (S b - A r),   W inverse of the star's covariance across it               (T7)

by Newton steps from Wahba's answer, ``covariance=`` of :func:`losnav.solve_attitude`. In a 20-degree field
this changes the covariance by 3 %, in a 60-degree field by a quarter; the attitude hardly.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from losnav._arrays import UNIT_TOLERANCE, ArrayLike, FloatArray, as_float64, positive, units
from losnav._arrays import covariances as checked_covariances
from losnav.attitude_determination import AttitudeSolution, solve_attitude, solve_attitude_robust
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import unit
from losnav.star_tracker.covariance import in_scale, per_head, symmetric
from losnav.star_tracker.heads import Head, checked_heads
from losnav.star_tracker.star_noise import QuestNoise

__all__ = ["by_head", "fuse"]

Method: TypeAlias = Literal["quest", "q-method", "svd", "foam", "esoq2"]
OnError: TypeAlias = Literal["raise", "nan"]


def fuse(
    heads: Sequence[Head],
    body_vectors: Sequence[ArrayLike],
    catalogue_vectors: Sequence[ArrayLike],
    sigmas: ArrayLike | Sequence[ArrayLike | None] | None = None,
    method: Method = "quest",
    *,
    covariances: Sequence[ArrayLike] | None = None,
    robust: bool = False,
    max_outlier_ratio: float = 0.6,
    seed: int = 0,
    on_error: OnError = "raise",
) -> AttitudeSolution:
    """Attitude of the fusion frame from the stars of all heads together.

    Parameters
    ----------
    heads : sequence of N Head
        Their mountings, and their noise models where ``sigmas`` does not say otherwise.
    body_vectors : sequence of N arrays (..., N_n, 3)
        Measured unit vectors of each head in its own axes. A head may be empty.
    catalogue_vectors : sequence of N arrays (N_n, 3) or (..., N_n, 3)
        The same stars in the reference frame.
    sigmas : scalar, or sequence of N scalars or arrays (N_n,), optional
        1-sigma noise per axis, rad; None (for all or for one head) is the noise of the head itself.
    method : {"quest", "q-method", "svd", "foam", "esoq2"}
        Solver, as for :func:`losnav.solve_attitude`.
    covariances : sequence of N arrays (..., N_n, 3, 3), optional
        Covariance of each star in head axes, rad^2, instead of ``sigmas``; of rank 2 or 3, what it says along
        the star is ignored.
    robust : bool
        Find out which stars are taken for others and leave them out, :func:`losnav.solve_attitude_robust`:
        ``inliers`` of the result, :func:`by_head` sorts them by head. One noise for every star then, the root
        mean square of its covariance.
    max_outlier_ratio, seed : float, int
        Of the robust search.
    on_error : {"raise", "nan"}
        What an invalid problem of a batch does.

    Returns
    -------
    AttitudeSolution
        ``dcm`` is fusion from reference, ``covariance`` that of ``dalpha`` in fusion axes. With stars in one
        direction only, ``rank`` is 2 and ``free_axis`` says which rotation is free.

    Raises
    ------
    InvalidInputError
        Naming the argument, the head and the rule broken; also if no head has a star.

    Examples
    --------
    One star in each of three orthogonal heads:

    >>> import numpy as np
    >>> import losnav as ln
    >>> arcsec = np.radians(1 / 3600)
    >>> heads = [ln.star_tracker.Head.looking(z, noise=5 * arcsec) for z in np.eye(3)]
    >>> stars = [[[0.0, 0.0, 1.0]]] * 3
    >>> catalogue = [head.boresight[np.newaxis] for head in heads]            # the truth is the identity
    >>> solution = ln.star_tracker.fuse(heads, stars, catalogue)
    >>> (np.sqrt(np.diag(solution.covariance)) / arcsec).round(3)
    array([3.536, 3.536, 3.536])
    """
    mounted = checked_heads(heads)
    stars = stars_of(mounted, body_vectors, catalogue_vectors, lenient=on_error == "nan")
    imaged = stars[0]
    if on_error == "nan":
        imaged = [np.where(np.isnan(b), [0.0, 0.0, 1.0], b) for b in imaged]
    if covariances is None:
        noises = per_head(sigmas, len(mounted), "sigmas")
        inputs = list(zip(mounted, imaged, noises, strict=True))
        deviations = [star_sigma(*entry, n) for n, entry in enumerate(inputs)]
        spreads = []
        if not all(_round(*entry) for entry in inputs):
            spreads = [star_covariance(*i, d) for i, d in zip(inputs, deviations, strict=True)]
    else:
        deviations, spreads = _given(mounted, imaged, covariances)
    body = _joined([_turned(h, b) for h, b in zip(mounted, stars[0], strict=True)], "body_vectors")
    reference = _joined(stars[1], "catalogue_vectors")
    if not body.shape[-2]:
        raise InvalidInputError("body_vectors: expected at least one star in any head, got none")
    if robust:
        if body.shape[-2] < 2:
            raise InvalidInputError("body_vectors: expected at least 2 stars in all heads for robust, got 1")
        return solve_attitude_robust(
            body,
            reference,
            sigma=_joined(deviations, "sigmas", 1),
            max_outlier_ratio=max_outlier_ratio,
            seed=seed,
            on_error=on_error,
        )
    if not spreads:
        sigma = _joined(deviations, "sigmas", 1)
        return solve_attitude(body, reference, sigma=sigma, method=method, on_error=on_error)
    turned = [h.mounting @ r @ h.mounting.T for h, r in zip(mounted, spreads, strict=True)]
    spread = _joined(turned, "covariances", 3)
    return solve_attitude(body, reference, covariance=spread, method=method, on_error=on_error)


def by_head(flags: npt.NDArray[Any], body_vectors: Sequence[ArrayLike]) -> list[npt.NDArray[Any]]:
    """What belongs to all stars together, ``inliers`` of a robust fusion, sorted by head.

    Parameters
    ----------
    flags : (..., N_1 + ... + N_N)
        One value for each star, heads in order.
    body_vectors : sequence of N arrays (..., N_n, 3)
        As given to :func:`fuse`.

    Returns
    -------
    list of N arrays (..., N_n)

    Raises
    ------
    InvalidInputError
        If there are not as many values as stars.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> stars = [np.zeros((2, 3)), np.zeros((0, 3)), np.zeros((1, 3))]
    >>> ln.star_tracker.by_head(np.array([True, False, True]), stars)
    [array([ True, False]), array([], dtype=bool), array([ True])]
    """
    counts = [0 if np.size(b) == 0 else np.shape(b)[-2] for b in body_vectors]
    if flags.shape[-1:] != (sum(counts),):
        raise InvalidInputError(f"flags: expected {sum(counts)} values, as many as stars, got {flags.shape}")
    return np.split(flags, np.cumsum(counts)[:-1], axis=-1)


def stars_of(
    heads: list[Head], body_vectors: Any, catalogue_vectors: Any, *, lenient: bool = False
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Checked unit vectors of every head, empty ones ``(0, 3)``; lenient: what is no unit becomes NaN."""
    lists = []
    for value, name in ((body_vectors, "body_vectors"), (catalogue_vectors, "catalogue_vectors")):
        entries = []
        for n, entry in enumerate(per_head(value, len(heads), name, scalar=False)):
            array = as_float64([] if entry is None else entry, f"{name}[{n}]")
            if array.size == 0 and array.ndim == 1:
                array = np.empty((0, 3))
            if array.ndim < 2 or array.shape[-1] != 3:
                raise InvalidInputError(f"{name}[{n}]: expected shape (..., N, 3), got {array.shape}")
            entries.append(array)
        lists.append(_checked(entries, name, lenient))
    for n, (b, r) in enumerate(zip(*lists, strict=True)):
        if b.shape[-2] != r.shape[-2]:
            raise InvalidInputError(
                f"catalogue_vectors[{n}]: expected the head's {b.shape[-2]} stars, got {r.shape[-2]}"
            )
    return lists[0], lists[1]


def _checked(entries: list[FloatArray], name: str, lenient: bool) -> list[FloatArray]:
    """Unit vectors, all heads looked at together; one by one only to say which is none."""
    flat = np.concatenate([entry.reshape(-1, 3) for entry in entries])
    with np.errstate(all="ignore"):
        good = np.abs(np.sqrt(np.einsum("ni,ni->n", flat, flat)) - 1.0) <= UNIT_TOLERANCE
    if good.all():
        return entries
    if not lenient:
        return [units(entry, f"{name}[{n}]") for n, entry in enumerate(entries)]
    edges = np.cumsum([0, *(entry.size // 3 for entry in entries)])
    flags = [good[a:b].reshape(e.shape[:-1]) for (a, b), e in zip(pairwise(edges), entries, strict=True)]
    return [np.where(f[..., np.newaxis], e, np.nan) for f, e in zip(flags, entries, strict=True)]


def star_sigma(head: Head, stars: FloatArray, noise: Any, number: int) -> FloatArray:
    """Standard deviations ``(..., N)`` of a head's stars: as given, else by the head's model."""
    if noise is None:
        return head.model.sigma(stars)
    sigma = in_scale(positive(noise, f"sigmas[{number}]"), f"sigmas[{number}]")
    try:
        return np.broadcast_to(sigma, np.broadcast_shapes(sigma.shape, stars.shape[:-1]))
    except ValueError as error:
        raise InvalidInputError(
            f"sigmas[{number}]: expected a scalar or a shape that broadcasts with {stars.shape[:-1]}, "
            f"got {sigma.shape}"
        ) from error


def star_covariance(head: Head, stars: FloatArray, noise: Any, sigma: FloatArray) -> FloatArray:
    """Covariances ``(..., N, 3, 3)`` of a head's stars: isotropic where a number was given."""
    if noise is None:
        return head.model.covariance(stars)
    return np.asarray(sigma[..., np.newaxis, np.newaxis] ** 2 * np.eye(3))


def _round(head: Head, stars: FloatArray, noise: Any) -> bool:
    """Whether one number says all about the noise of a head's stars."""
    return noise is not None or isinstance(head.model, QuestNoise) or not stars.size


def _given(
    heads: list[Head], stars: list[FloatArray], covariances: Sequence[ArrayLike]
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Root mean square across each star, and the covariances across it."""
    deviations, spreads = [], []
    for n, (b, value) in enumerate(
        zip(stars, per_head(covariances, len(heads), "covariances", scalar=False), strict=True)
    ):
        if not b.size:
            deviations.append(np.empty(b.shape[:-1]))
            spreads.append(np.empty((*b.shape, 3)))
            continue
        spread = in_scale(checked_covariances(value, f"covariances[{n}]"), f"covariances[{n}]", 2)
        try:
            spread = np.broadcast_to(spread, np.broadcast_shapes(spread.shape, (*b.shape, 3)))
        except ValueError as error:
            raise InvalidInputError(
                f"covariances[{n}]: expected a shape that broadcasts with {(*b.shape, 3)}, got {spread.shape}"
            ) from error
        along = unit(b)
        across = np.eye(3) - along[..., :, np.newaxis] * along[..., np.newaxis, :]
        spread = across @ spread @ across
        total = np.trace(spread, axis1=-2, axis2=-1)
        if not (total > 0.0).all():
            raise InvalidInputError(f"covariances[{n}]: expected a spread across every star, got zero")
        deviations.append(np.sqrt(0.5 * total))
        spreads.append(symmetric(spread))
    return deviations, spreads


def _turned(head: Head, stars: FloatArray) -> FloatArray:
    return np.asarray(stars @ head.mounting.T)


def _joined(arrays: list[FloatArray], name: str, core: int = 2) -> FloatArray:
    """All heads along the axis of the stars, the ``core``-th from the end."""
    try:
        lead = np.broadcast_shapes(*(a.shape[: a.ndim - core] for a in arrays))
    except ValueError as error:
        shapes = ", ".join(str(a.shape[: a.ndim - core]) for a in arrays)
        raise InvalidInputError(f"{name}: leading dimensions do not broadcast: {shapes}") from error
    full = [np.broadcast_to(a, (*lead, *a.shape[a.ndim - core :])) for a in arrays]
    return np.concatenate(full, axis=-core)

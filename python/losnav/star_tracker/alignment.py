"""In-flight alignment: the mountings of the heads relative to one of them, from stars seen over many frames.

The angle between a star in head 1 and a star in head 2 does not depend on the attitude, so every frame in
which both see stars tells how the heads are mounted. All frames together, with an attitude ``A_k`` of its
own for each:

    min sum_k sum_n sum_i e' W e,     e = exp(-[mu_n x]) S_n b_kni - exp(-[xi_k x]) A_k r_kni         (T8)

To first order ``e = e0 - [p x] (xi_k - mu_n)``, ``p = A_k r``. With ``H_kn = sum_i [p x]' W [p x]``,
``g_kn = sum_i [p x]' W e0``, ``T_k = sum_n H_kn`` the attitudes drop out:

    M_nm = sum_k (delta_nm H_kn - H_kn T_k^-1 H_km),   M mu = sum_k (H_kn T_k^-1 sum_m g_km - g_kn)   (T9)

1. Attitude of every frame with the mountings as they are (frames that have none are left out).
2. (T9); turn mountings and attitudes; again until the step is rounding.
3. Covariance of all mountings ``M^-1``: what M does not know is said, not invented.

``mu`` is in fusion axes, true minus estimate: the true mounting is ``exp(-[mu x])`` times the estimated one.

Sources: Shuster & Pitone, J. Guidance 14 (1991); Pittelkau, J. Guidance 24 (2001), for alignment as an
estimation problem; the elimination of the attitudes is Schur's complement. Leaves out: drift within the
batch (take shorter batches, with the last result as ``prior``), gyros that link the frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav import attitude
from losnav._arrays import ArrayLike, FloatArray
from losnav.attitude_determination import solve_attitude
from losnav.consistency import chi2_sf
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import cross_matrices, rotation_matrices, unit
from losnav.star_tracker.covariance import per_head, symmetric
from losnav.star_tracker.field import whole
from losnav.star_tracker.fusion import star_covariance, star_sigma, stars_of
from losnav.star_tracker.heads import Head, checked_heads
from losnav.star_tracker.star_noise import tangent_weights

__all__ = ["Alignment", "align_heads"]

MAX_ITERATIONS = 20
# A step below this is rounding, rad.
STEP = 1e-13
# Eigenvalue of M over its largest below which a direction counts as unknown.
UNKNOWN = 1e-10
ARCSEC = float(np.radians(1.0 / 3600.0))


@dataclass(frozen=True, eq=False, repr=False)
class Alignment:
    """Mountings of N heads estimated in flight.

    Attributes
    ----------
    mountings : (N, 3, 3)
        Fusion from head; that of the reference head is the given one.
    corrections : (N, 3)
        From the given mountings to these: ``mu``, rad, fusion axes.
    covariance : (3 N, 3 N)
        Of ``mu`` of all heads in order, rad^2, fusion axes; zero for the reference head, NaN for heads of
        which some direction is unknown.
    rank : int
        Directions known, of ``3 (N - 1)``.
    unobservable : (3 N, 3 (N - 1) - rank)
        Columns: combinations of ``mu`` that the frames do not tell, left as they were given.
    chi2, dof : float, int
        Of the residuals of the frames used, and of the corrections about the prior if there is one.
    frames : (K,) bool
        Frames used: at least two stars in different directions.
    attitudes : (K, 3, 3)
        Fusion from reference in each frame, NaN where not used.
    iterations : int
    converged : bool
        The iteration arrived, and every direction of every head is known.
    given : tuple of Head
        The heads as they were given.
    reference : int
        The head whose mounting defines the fusion frame.
    """

    mountings: FloatArray
    corrections: FloatArray
    covariance: FloatArray
    rank: int
    unobservable: FloatArray
    chi2: float
    dof: int
    frames: npt.NDArray[np.bool_]
    attitudes: FloatArray
    iterations: int
    converged: bool
    given: tuple[Head, ...]
    reference: int

    @property
    def sigma(self) -> FloatArray:
        """1-sigma of every head's ``mu``, ``(N, 3)``, rad."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(-1, 3))

    @property
    def p_value(self) -> float:
        """Probability of a larger ``chi2`` if noise and stars are as stated; 1 without redundancy."""
        return float(chi2_sf(self.chi2, self.dof)) if self.dof > 0 else 1.0

    @property
    def heads(self) -> tuple[Head, ...]:
        """The heads with these mountings and their covariances."""
        blocks = [self.covariance[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] for n in range(len(self.given))]
        known = [None if np.isnan(block).any() or not block.any() else symmetric(block) for block in blocks]
        return tuple(
            replace(head, mounting=mounting, mounting_covariance=block)
            for head, mounting, block in zip(self.given, self.mountings, known, strict=True)
        )

    def __repr__(self) -> str:
        count = 3 * (len(self.given) - 1)
        return (
            f"Alignment({len(self.given)} heads, {int(self.frames.sum())} of {len(self.frames)} frames, rank "
            f"{self.rank} of {count}, chi2={self.chi2:.6g} for {self.dof} dof, converged={self.converged})"
        )

    def __str__(self) -> str:
        lines = [repr(self)]
        for n, head in enumerate(self.given):
            moved = ", ".join(f"{x / ARCSEC:.2f}" for x in self.corrections[n])
            spread = ", ".join(f"{x / ARCSEC:.2f}" for x in self.sigma[n])
            state = "reference" if n == self.reference else f"turned by [{moved}] arcsec, 1-sigma [{spread}]"
            lines.append(f"head {head.name or n}: {state}")
        lines += [f"unknown: {_words(column, self.given)}" for column in self.unobservable.T]
        return "\n".join(lines)


def align_heads(
    heads: Sequence[Head],
    body_vectors: Sequence[Sequence[ArrayLike | None]],
    catalogue_vectors: Sequence[Sequence[ArrayLike | None]],
    sigmas: ArrayLike | Sequence[ArrayLike | None] | None = None,
    *,
    reference: int = 0,
    prior: bool = False,
) -> Alignment:
    """Mountings of the heads relative to one of them, from identified stars of many frames (T8, T9).

    Parameters
    ----------
    heads : sequence of N Head
        Nominal mountings, right to a degree or so; noise models where ``sigmas`` does not say otherwise.
    body_vectors : K frames, each a sequence of N arrays (N_kn, 3)
        Measured unit vectors in head axes. A head without stars in a frame is empty or None.
    catalogue_vectors : K frames, each a sequence of N arrays (N_kn, 3)
        The same stars in the reference frame.
    sigmas : scalar, or sequence of N scalars, optional
        1-sigma noise per star and axis of each head, rad; None is the noise of the head itself.
    reference : int
        Head that keeps its mounting and so defines the fusion frame.
    prior : bool
        Take the ``mounting_covariance`` of the other heads, where there is one, as what is known before.

    Returns
    -------
    Alignment
        ``mountings``, ``corrections``, ``covariance``, ``heads``; ``print`` it for a line on each head. What
        the frames do not tell stays as given and is listed in ``unobservable``; ``converged`` is then False.

    Raises
    ------
    InvalidInputError
        On bad arguments, fewer than two heads, or no frame with two stars.

    Examples
    --------
    Head B has drifted by 20 arcseconds since it was measured on the ground; thirty frames of eight stars:

    >>> import numpy as np
    >>> import losnav as ln
    >>> arcsec = np.radians(1 / 3600)
    >>> rng = np.random.default_rng(1)
    >>> a, b = (ln.star_tracker.Head.looking(z, np.radians(20), 7 * arcsec, name)
    ...         for z, name in [([0, 0, 1], "A"), ([1, 0, 0], "B")])
    >>> drift = ln.attitude.dcm_from_mrp(np.array([5, -20, 10]) * arcsec / 4)
    >>> frames, catalogues = [], []
    >>> for attitude in ln.attitude.dcm_from_mrp(rng.uniform(-0.5, 0.5, (30, 3))):
    ...     true = [a.stars(8, rng), b.stars(8, rng)]
    ...     catalogues.append([true[0] @ attitude, true[1] @ (drift @ b.mounting).T @ attitude])
    ...     frames.append([a.measure(true[0], rng), b.measure(true[1], rng)])
    >>> print(ln.star_tracker.align_heads([a, b], frames, catalogues))
    Alignment(2 heads, 30 of 30 frames, rank 3 of 3, chi2=... for 867 dof, converged=True)
    head A: reference
    head B: turned by [...] arcsec, 1-sigma [3.44, 0.64, 3.41]
    """
    mounted = checked_heads(heads)
    count = len(mounted)
    if count < 2:
        raise InvalidInputError(f"heads: expected at least 2 to align, got {count}")
    if whole(reference, "reference", 0) >= count:
        raise InvalidInputError(f"reference: expected a head from 0 to {count - 1}, got {reference!r}")
    stars = _gathered(mounted, body_vectors, catalogue_vectors, sigmas)
    start = _attitudes(mounted, stars)
    used = np.asarray(np.isfinite(start).all(axis=(-2, -1)))
    if not used.any():
        raise InvalidInputError("body_vectors: expected a frame with stars in two directions, got none")
    known = _prior(mounted, reference) if prior else np.zeros((count, 3, 3))
    return _solved(mounted, stars.of(used), start, reference, known)


@dataclass(frozen=True)
class _Stars:
    """All stars of all frames in one row: frame, head, direction, catalogue, weight in head axes, sigma."""

    frame: npt.NDArray[np.int64]
    head: npt.NDArray[np.int64]
    body: FloatArray
    catalogue: FloatArray
    weight: FloatArray
    sigma: FloatArray
    frames: int

    def of(self, used: npt.NDArray[np.bool_]) -> _Stars:
        """Those of some frames."""
        keep = used[self.frame]
        names = ("frame", "head", "body", "catalogue", "weight", "sigma")
        changes: dict[str, Any] = {name: getattr(self, name)[keep] for name in names}
        return replace(self, **changes)


def _gathered(heads: list[Head], body_vectors: Any, catalogue_vectors: Any, sigmas: Any) -> _Stars:
    frames, others = list(body_vectors), list(catalogue_vectors)
    if len(frames) != len(others) or not frames:
        raise InvalidInputError(
            "body_vectors, catalogue_vectors: expected the same number of frames, at least one, got "
            f"{len(frames)} and {len(others)}"
        )
    noises = per_head(sigmas, len(heads), "sigmas")
    parts: list[list[FloatArray]] = [[] for _ in range(6)]
    for k, (frame, other) in enumerate(zip(frames, others, strict=True)):
        try:
            b, r = stars_of(heads, frame, other)
            inputs = zip(heads, b, noises, strict=True)
            sigma = [star_sigma(*entry, n) for n, entry in enumerate(inputs)]
        except InvalidInputError as error:
            raise InvalidInputError(f"frame {k}: {error}") from error
        for n in range(len(heads)):
            if b[n].ndim != 2 or r[n].ndim != 2:
                rule = f"body_vectors[{n}]: expected shape (N, 3)"
                raise InvalidInputError(f"frame {k}: {rule}, got {b[n].shape}")
            size = np.ones(len(b[n]))
            spread = star_covariance(heads[n], b[n], noises[n], sigma[n])
            entry = (k * size, n * size, b[n], r[n], spread, sigma[n])
            for part, value in zip(parts, entry, strict=True):
                part.append(np.asarray(value))
    rows = [np.concatenate(part) for part in parts]
    frame, head = rows[0].astype(np.int64), rows[1].astype(np.int64)
    weights = tangent_weights(rows[2], rows[4])
    return _Stars(frame, head, unit(rows[2]), unit(rows[3]), weights, rows[5], len(frames))


def _attitudes(heads: list[Head], stars: _Stars) -> FloatArray:
    """Start of every frame, ``(K, 3, 3)``; NaN where its stars leave a rotation free."""
    turns = np.stack([h.mounting for h in heads])
    body = np.einsum("mij,mj->mi", turns[stars.head], stars.body)
    edges = np.searchsorted(stars.frame, np.arange(stars.frames + 1))
    dcms = np.full((stars.frames, 3, 3), np.nan)
    for k, (first, last) in enumerate(pairwise(edges)):
        if last - first >= 2:
            rows = slice(first, last)
            solution = solve_attitude(body[rows], stars.catalogue[rows], sigma=stars.sigma[rows])
            if solution.rank == 3:
                dcms[k] = solution.dcm
    return dcms


def _solved(
    heads: list[Head], stars: _Stars, start: FloatArray, reference: int, known: FloatArray
) -> Alignment:
    used = np.asarray(np.isfinite(start).all(axis=(-2, -1)))
    nominal = np.stack([h.mounting for h in heads])
    mountings, dcms = nominal.copy(), np.where(used[:, np.newaxis, np.newaxis], start, np.eye(3))
    free = np.delete(np.arange(len(heads)), reference)
    step, iterations = np.inf, 0
    while step >= STEP and iterations < MAX_ITERATIONS:
        iterations += 1
        h, g, _ = _normal(stars, mountings, dcms, len(heads))
        turned = attitude.rotation_error(mountings, nominal)
        mu, inverse, information = _schur(h[used], g[used], known, turned, free)
        xi = np.zeros((stars.frames, 3))
        coupled = g[used].sum(axis=1) + np.einsum("knij,nj->ki", h[used], mu)
        xi[used] = np.einsum("kij,kj->ki", inverse, coupled)
        mountings, dcms = rotation_matrices(mu) @ mountings, rotation_matrices(xi) @ dcms
        step = float(np.abs(mu).max())
    _, _, chi2 = _normal(stars, mountings, dcms, len(heads))
    turned = attitude.rotation_error(mountings, nominal)
    chi2 += float(np.einsum("ni,nij,nj->", turned, known, turned))
    covariance, basis = _knowledge(information, free, len(heads))
    rank = 3 * len(free) - basis.shape[1]
    # A prior is three more measurements.
    dof = 2 * len(stars.frame) + 3 * int(known.any(axis=(1, 2)).sum()) - 3 * int(used.sum()) - rank
    return Alignment(
        mountings=mountings,
        corrections=turned,
        covariance=covariance,
        rank=rank,
        unobservable=basis,
        chi2=chi2,
        dof=dof,
        frames=used,
        attitudes=np.where(used[:, np.newaxis, np.newaxis], dcms, np.nan),
        iterations=iterations,
        converged=step < STEP and not basis.shape[1],
        given=tuple(heads),
        reference=reference,
    )


def _normal(
    stars: _Stars, mountings: FloatArray, dcms: FloatArray, count: int
) -> tuple[FloatArray, FloatArray, float]:
    """``H (K, N, 3, 3)``, ``g (K, N, 3)`` and chi2 at these mountings and attitudes."""
    turns = mountings[stars.head]
    predicted = np.einsum("mij,mj->mi", dcms[stars.frame], stars.catalogue)
    residual = np.einsum("mij,mj->mi", turns, stars.body) - predicted
    weight = turns @ stars.weight @ np.swapaxes(turns, -1, -2)
    rows = cross_matrices(predicted)
    weighted = np.swapaxes(rows, -1, -2) @ weight
    h, g = np.zeros((stars.frames, count, 3, 3)), np.zeros((stars.frames, count, 3))
    np.add.at(h, (stars.frame, stars.head), weighted @ rows)
    np.add.at(g, (stars.frame, stars.head), np.einsum("mij,mj->mi", weighted, residual))
    return h, g, float(np.einsum("mi,mij,mj->", residual, weight, residual))


def _schur(
    h: FloatArray, g: FloatArray, known: FloatArray, turned: FloatArray, free: npt.NDArray[np.int64]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Step ``mu (N, 3)``, ``T^-1 (K, 3, 3)``, and M of the free heads; unknown directions do not move."""
    count = h.shape[1]
    inverse = np.asarray(np.linalg.inv(h.sum(axis=1)), dtype=np.float64)
    through = h @ inverse[:, np.newaxis]
    blocks = -np.einsum("knij,kmjl->nmil", through, h)
    blocks[np.arange(count), np.arange(count)] += h.sum(axis=0) + known
    right = np.einsum("knij,kj->ni", through, g.sum(axis=1)) - g.sum(axis=0)
    right -= np.einsum("nij,nj->ni", known, turned)
    part = blocks[np.ix_(free, free)].transpose(0, 2, 1, 3).reshape(3 * len(free), 3 * len(free))
    information = symmetric(part)
    values, axes = np.linalg.eigh(information)
    inside = values > UNKNOWN * max(values[-1], np.finfo(float).tiny)
    scaled = np.where(inside, 1.0 / np.where(inside, values, 1.0), 0.0)
    mu = np.zeros((count, 3))
    mu[free] = (axes @ (scaled * (axes.T @ right[free].ravel()))).reshape(-1, 3)
    return mu, inverse, information


def _knowledge(
    information: FloatArray, free: npt.NDArray[np.int64], count: int
) -> tuple[FloatArray, FloatArray]:
    """Covariance ``(3 N, 3 N)`` and a basis of what is unknown, of all heads."""
    values, axes = np.linalg.eigh(information)
    inside = values > UNKNOWN * max(values[-1], np.finfo(float).tiny)
    part = (axes[:, inside] / values[inside]) @ axes[:, inside].T
    lost = axes[:, ~inside]
    # A head of which any direction is unknown has no covariance.
    heads = np.repeat((lost.reshape(len(free), 3, -1) ** 2).sum(axis=(1, 2)) > UNKNOWN, 3)
    part[heads] = part[:, heads] = np.nan
    rows = (3 * free[:, np.newaxis] + np.arange(3)).ravel()
    covariance, basis = np.zeros((3 * count, 3 * count)), np.zeros((3 * count, lost.shape[1]))
    covariance[np.ix_(rows, rows)], basis[rows] = symmetric(part), lost
    return covariance, basis


def _prior(heads: list[Head], reference: int) -> FloatArray:
    """Information about each mounting known before, ``(N, 3, 3)``."""
    known = np.zeros((len(heads), 3, 3))
    for n, head in enumerate(heads):
        if n != reference and head.mounting_covariance is not None:
            try:
                known[n] = np.linalg.inv(head.mounting_covariance)
            except np.linalg.LinAlgError as error:
                raise InvalidInputError(
                    f"heads[{n}]: expected a positive definite mounting_covariance as prior"
                ) from error
    return known


def _words(column: FloatArray, heads: tuple[Head, ...]) -> str:
    """A combination of rotations, each head's as an axis."""
    parts = []
    for n, head in enumerate(heads):
        axis = column[3 * n : 3 * n + 3]
        if np.linalg.norm(axis) > 1e-3:
            components = ", ".join(f"{x:.2f}" for x in axis)
            parts.append(f"head {head.name or n} about [{components}]")
    return " with ".join(parts)

"""Attitude-level fusion: heads that each have an attitude, combined and checked against each other.

1. Bring the attitude of head n and its covariance into fusion axes: ``S_n A_n``, ``R_n = S_n P_n S_n' + C_n``
   with ``C_n`` the covariance of the mounting.
2. Fuse: ``A`` with ``sum R_n^-1 xi_n = 0``, ``xi_n`` the rotation from ``A`` to ``S_n A_n``;
   ``P = (sum R_n^-1)^-1``, ``chi2 = sum xi_n' R_n^-1 xi_n``.
3. Compare each head with the fusion of the others: ``chi2_n = d' (R_n + P_others)^-1 d`` has 3 degrees of
   freedom if all are right (T13). Beyond the quantile of ``1 - false_alarm / heads`` there is a
   contradiction.
4. Find the smallest set of heads without which the rest agree (``chi2`` within the quantile of
   ``1 - false_alarm``). If there is one such set, its heads are wrong, and named. If there are several, the
   geometry cannot tell them apart: all their heads are suspects.
5. Leave out whoever is suspected, as long as a head remains that is not.

That a contradiction is seen and the wrong head cleared of it is no likelier than ``false_alarm``. Three
narrow orthogonal heads often leave two: the axis in dispute is known to these two, and to the third only
about its boresight, too badly to judge. For covariances that are right, step 2 gives what image-level
fusion gives (equation X17) wherever every head sees at least two stars; a head with one star can only take
part in :func:`fuse`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav import attitude
from losnav._arrays import ArrayLike, FloatArray, as_float64, broadcast, rotations
from losnav.attitude_determination import AttitudeSolution
from losnav.consistency import chi2_quantile
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import rotation_matrices
from losnav.star_tracker.covariance import inverse_covariances, symmetric
from losnav.star_tracker.fused_attitude import BoolArray, FusedAttitude
from losnav.star_tracker.heads import Head, checked_heads

__all__ = ["fuse_attitudes"]

# The mean of a few rotations converges quadratically at small angles; this bounds it at large ones.
MAX_ITERATIONS = 50
# A step below this is rounding, rad.
STEP = 1e-14


def fuse_attitudes(
    heads: Sequence[Head],
    attitudes: ArrayLike | Sequence[ArrayLike | AttitudeSolution | None],
    covariances: ArrayLike | Sequence[ArrayLike | None] | None = None,
    *,
    false_alarm: float = 1e-3,
    exclude: bool = True,
) -> FusedAttitude:
    """Information filter over the heads' own attitudes, with a chi-square check of each against the others.

    Parameters
    ----------
    heads : sequence of N Head
        Their mountings, mounting covariances and names are used.
    attitudes : (..., N, 3, 3), sequence of N (3, 3), or of N AttitudeSolution
        ``dcm`` of each head, head from reference. None or NaN: this head is blind, as is one whose solution
        did not converge.
    covariances : (N, 3, 3), (..., N, 3, 3) or sequence of N (3, 3), optional
        Attitude covariance of each head in its own axes, rad^2, positive definite; that of a blind head is
        ignored. None: those of the solutions.
    false_alarm : float
        Probability of a contradiction although all heads are right, and of clearing the one that is not.
    exclude : bool
        Leave suspected heads out. False: only report them.

    Returns
    -------
    FusedAttitude
        ``dcm``, ``quaternion``, ``mrp``, ``covariance``, ``chi2``, ``dof`` as every attitude solution, and
        ``head_chi2``, ``head_p_value``, ``used``, ``blind``, ``suspects``, ``faulty`` and ``suspected``
        (names), ``consistent``. ``print`` it for a line on each head.

    Raises
    ------
    InvalidInputError
        On matrices that are no rotations or no covariances, or counts that differ.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> arcsec = np.radians(1 / 3600)
    >>> heads = [ln.star_tracker.Head.looking(z, name=n) for z, n in zip(np.eye(3), "ABC")]
    >>> attitudes = np.array([head.mounting.T for head in heads])         # the truth is the identity
    >>> attitudes[1] = ln.attitude.dcm_from_mrp([90 * arcsec / 4, 0, 0]) @ attitudes[1]
    >>> covariance = np.diag([2.5, 2.5, 17.5]) ** 2 * arcsec**2
    >>> fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [covariance] * 3)
    >>> fused.faulty
    ('B',)
    >>> print(str(fused).splitlines()[2])
    head B: left out, contradicts the others (chi2 654.5 for 3 dof, p = 1.5e-141, off by 90 arcsec)

    Twenty arcseconds are seen as clearly, but here they may be those of C:

    >>> attitudes[1] = ln.attitude.dcm_from_mrp([20 * arcsec / 4, 0, 0]) @ heads[1].mounting.T
    >>> ln.star_tracker.fuse_attitudes(heads, attitudes, [covariance] * 3).suspected
    ('B', 'C')
    """
    mounted = checked_heads(heads)
    if not 0.0 < false_alarm < 1.0:
        raise InvalidInputError(f"false_alarm: expected a probability in (0, 1), got {false_alarm}")
    shape, dcms, spreads, blind = fusion_inputs(mounted, attitudes, covariances)
    used = ~blind
    comparison = _Comparison(dcms, spreads, used)
    alarms = ~comparison.agree(false_alarm)
    suspects, decided = np.zeros_like(blind), ~alarms
    if alarms.any():
        suspects[alarms], decided[alarms] = _suspects(
            dcms[alarms], spreads[alarms], used[alarms], false_alarm
        )
    # Nobody is left out where nobody would remain.
    excluded = suspects & (used & ~suspects).any(axis=-1, keepdims=True) & exclude
    if excluded.any():
        comparison = _Comparison(dcms, spreads, used & ~excluded)
    result = _result(comparison, blind, suspects, _names(mounted))
    agree = comparison.agree(false_alarm)
    return replace(result, excluded=excluded, decided=decided, consistent=agree).reshaped(shape)


class _Comparison:
    """The fusion of the heads in use, and each head against the others; flat batch ``(B, N)``."""

    def __init__(self, dcms: FloatArray, spreads: FloatArray, used: BoolArray) -> None:
        count = used.shape[-1]
        self.used = used
        weights = np.asarray(np.linalg.inv(spreads), dtype=np.float64)
        self.dcm, self.covariance, self.converged = _fusion(dcms, weights, used)
        self.chi2 = _total(dcms, weights, used, self.dcm)
        # Problem (b, n) is that of all heads in use but n.
        without = used[:, np.newaxis, :] & ~np.eye(count, dtype=bool)
        size = len(used) * count
        many, heavy = np.repeat(dcms, count, axis=0), np.repeat(weights, count, axis=0)
        others, spread, _ = _fusion(many, heavy, without.reshape(size, count))
        others, spread = others.reshape(-1, count, 3, 3), spread.reshape(-1, count, 3, 3)
        comparable = np.asarray(without.any(axis=-1))
        self.disagreement = _errors(dcms, others)
        together = np.linalg.inv(
            np.where(comparable[..., np.newaxis, np.newaxis], spread + spreads, np.eye(3))
        )
        chi2 = np.einsum("bni,bnij,bnj->bn", self.disagreement, together, self.disagreement)
        self.head_chi2 = np.where(comparable, chi2, np.nan)
        self.disagreement[~comparable] = np.nan

    def agree(self, false_alarm: float) -> BoolArray:
        """No head in use contradicts the others."""
        worst = np.where(self.used, np.nan_to_num(self.head_chi2), 0.0).max(axis=-1)
        return np.asarray(worst <= _limits(self.used.sum(axis=-1), false_alarm))


def _suspects(
    dcms: FloatArray, spreads: FloatArray, used: BoolArray, false_alarm: float
) -> tuple[BoolArray, BoolArray]:
    """Heads of the smallest sets without which the rest agree, all where there is none; is there just one?"""
    batch, count = used.shape
    weights = np.asarray(np.linalg.inv(spreads), dtype=np.float64)
    suspects, sets = used.copy(), np.zeros(batch, dtype=np.int64)
    for size in range(1, count - 1):
        found, pending = np.zeros_like(used), sets == 0
        for subset in combinations(range(count), size):
            gone = np.isin(np.arange(count), subset)
            rest = used & ~gone
            number = rest.sum(axis=-1)
            rows = np.flatnonzero(pending & used[:, gone].all(axis=-1) & (number >= 2))
            if not len(rows):
                continue
            mean, _, _ = _fusion(dcms[rows], weights[rows], rest[rows])
            chi2 = _total(dcms[rows], weights[rows], rest[rows], mean)
            limit = np.array([_quantile(1.0 - false_alarm, 3 * (int(k) - 1)) for k in number[rows]])
            explained = rows[chi2 <= limit]
            found[explained] |= gone
            sets[explained] += 1
        settled = found.any(axis=-1)
        suspects[settled] = found[settled]
    return suspects, sets == 1


def _total(dcms: FloatArray, weights: FloatArray, used: BoolArray, mean: FloatArray) -> FloatArray:
    """``sum xi' R^-1 xi`` over the heads in use."""
    error = _errors(dcms, mean[:, np.newaxis])
    each = np.einsum("bni,bnij,bnj->bn", error, weights, error)
    return np.asarray(np.where(used, each, 0.0).sum(axis=-1))


@lru_cache(maxsize=64)
def _quantile(probability: float, dof: int) -> float:
    return float(chi2_quantile(probability, dof))


def _limits(number: npt.NDArray[np.int64], false_alarm: float) -> FloatArray:
    """Quantile for the largest of ``number`` statistics; two heads share one."""
    tests = np.where(number > 2, number, 1)
    return np.array([_quantile(1.0 - false_alarm / int(t), 3) for t in tests])


def _fusion(
    dcms: FloatArray, weights: FloatArray, used: BoolArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Weighted mean of ``(B, N, 3, 3)``, its covariance, whether it was reached; NaN without heads."""
    any_used = np.asarray(used.any(axis=-1))
    masked = np.where(used[..., np.newaxis, np.newaxis], weights, 0.0)
    total = masked.sum(axis=-3)
    covariance = symmetric(np.linalg.inv(np.where(any_used[:, np.newaxis, np.newaxis], total, np.eye(3))))
    mean = dcms[np.arange(len(dcms)), used.argmax(axis=-1)]
    done = np.zeros(len(dcms), dtype=bool)
    for _ in range(MAX_ITERATIONS):
        error = _errors(dcms, mean[:, np.newaxis])
        step = np.einsum("bij,bnjk,bnk->bi", covariance, masked, error)
        mean = rotation_matrices(step) @ mean
        done = np.linalg.norm(step, axis=-1) < STEP
        if done.all():
            break
    mean[~any_used], covariance[~any_used] = np.nan, np.nan
    return mean, covariance, any_used & done


def _errors(true: FloatArray, estimate: FloatArray) -> FloatArray:
    """Rotation errors with the estimate broadcast; zero where the estimate is NaN."""
    known = np.isfinite(estimate).all(axis=(-2, -1), keepdims=True)
    # Products of rotations drift from orthonormality by rounding only.
    return np.asarray(attitude.rotation_error(true, np.where(known, estimate, np.eye(3))))


def fusion_inputs(
    heads: list[Head], attitudes: Any, covariances: Any
) -> tuple[tuple[int, ...], FloatArray, FloatArray, BoolArray]:
    """Batch shape, flat ``S_n A_n`` and ``R_n`` ``(B, N, 3, 3)``, blind heads ``(B, N)``."""
    count = len(heads)
    turns = np.stack([h.mounting for h in heads])
    attitudes, covariances = _of_solutions(attitudes, covariances, count)
    dcms = _stacked(attitudes, count, "attitudes")
    spreads = _stacked(covariances, count, "covariances")
    try:
        lead = np.broadcast_shapes(dcms.shape[:-3], spreads.shape[:-3])
    except ValueError as error:
        raise InvalidInputError(
            f"attitudes, covariances: leading dimensions {dcms.shape[:-3]} and {spreads.shape[:-3]} "
            "do not broadcast"
        ) from error
    dcms = np.broadcast_to(dcms, (*lead, count, 3, 3))
    spreads = np.broadcast_to(spreads, (*lead, count, 3, 3))
    blind = np.asarray(np.isnan(dcms).all(axis=(-2, -1)))
    hidden = blind[..., np.newaxis, np.newaxis]
    dcms = rotations(np.where(hidden, np.eye(3), dcms), "attitudes")
    spreads = np.where(hidden, np.eye(3), spreads)
    inverse_covariances(spreads, "covariances")
    mounting = np.stack(
        [np.zeros((3, 3)) if h.mounting_covariance is None else h.mounting_covariance for h in heads]
    )
    turned = turns @ spreads @ np.swapaxes(turns, -1, -2) + mounting
    shape, (flat, flat_spreads, flat_blind) = broadcast(
        ("attitudes", turns @ dcms, 3),
        ("covariances", symmetric(turned), 3),
        ("attitudes", np.asarray(blind, dtype=np.float64), 1),
    )
    return shape, flat, flat_spreads, flat_blind > 0


def _of_solutions(attitudes: Any, covariances: Any, count: int) -> tuple[Any, Any]:
    """Arrays of solutions, where solutions were given."""
    given = isinstance(attitudes, list | tuple) and any(hasattr(a, "dcm") for a in attitudes)
    if covariances is None and not given:
        raise InvalidInputError("covariances: expected those of the attitudes, got None and no solutions")
    if not given:
        return attitudes, covariances
    if len(attitudes) != count:
        raise InvalidInputError(
            f"attitudes: expected {count} entries, one for each head, got {len(attitudes)}"
        )
    dcms, spreads = [], []
    for entry in attitudes:
        known = np.asarray(getattr(entry, "converged", False))[..., np.newaxis, np.newaxis]
        dcms.append(np.where(known, getattr(entry, "dcm", np.eye(3)), np.nan))
        spreads.append(getattr(entry, "covariance", np.eye(3)))
    try:
        stacked = [np.stack(np.broadcast_arrays(*arrays), axis=-3) for arrays in (dcms, spreads)]
    except ValueError as error:
        shapes = ", ".join(str(d.shape[:-2]) for d in dcms)
        raise InvalidInputError(f"attitudes: leading dimensions do not broadcast: {shapes}") from error
    return stacked[0], stacked[1] if covariances is None else covariances


def _stacked(value: Any, count: int, name: str) -> FloatArray:
    """``(..., N, 3, 3)``; None among the entries becomes NaN."""
    if isinstance(value, list | tuple):
        entries = [
            np.full((3, 3), np.nan) if v is None else as_float64(v, f"{name}[{n}]")
            for n, v in enumerate(value)
        ]
        shapes = {e.shape for e in entries}
        if len(shapes) > 1:
            raise InvalidInputError(f"{name}: expected {count} matrices (3, 3), got shapes {sorted(shapes)}")
        value = np.stack(entries) if entries else np.empty((0, 3, 3))
    array = as_float64(value, name)
    if array.ndim < 3 or array.shape[-3:] != (count, 3, 3):
        raise InvalidInputError(f"{name}: expected shape (..., {count}, 3, 3), got {array.shape}")
    return array


def _names(heads: list[Head]) -> tuple[str, ...]:
    return tuple(h.name or str(n) for n, h in enumerate(heads))


def _result(
    comparison: _Comparison, blind: BoolArray, suspects: BoolArray, names: tuple[str, ...]
) -> FusedAttitude:
    """Flat batch; who was left out, and whether the rest agree, is still open."""
    used = comparison.used
    return FusedAttitude(
        dcm=comparison.dcm,
        covariance=comparison.covariance,
        chi2=np.where(used.any(axis=-1), comparison.chi2, np.nan),
        dof=np.maximum(3 * (used.sum(axis=-1) - 1), 0),
        head_chi2=np.where(blind, np.nan, comparison.head_chi2),
        disagreement=np.where(blind[..., np.newaxis], np.nan, comparison.disagreement),
        used=used,
        blind=blind,
        suspects=suspects,
        excluded=np.zeros_like(blind),
        consistent=np.ones(len(used), dtype=bool),
        converged=comparison.converged,
        decided=np.ones(len(used), dtype=bool),
        names=names,
    )

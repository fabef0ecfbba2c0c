"""How large a fault of one head the cross-check of the others sees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, vectors
from losnav.consistency import chi2_quantile, chi2_sf
from losnav.errors import InvalidInputError
from losnav.star_tracker.crosscheck import fusion_inputs
from losnav.star_tracker.field import whole
from losnav.star_tracker.heads import Head, checked_heads

__all__ = ["detection_power"]


def detection_power(
    heads: Sequence[Head],
    covariances: ArrayLike,
    head: int,
    bias: ArrayLike,
    *,
    false_alarm: float = 1e-3,
) -> FloatArray:
    """Probability that the cross-check of :func:`fuse_attitudes` sees a bias of one head, named or not.

    Noncentral chi-square with 3 degrees of freedom and noncentrality ``b' (R_n + P_others)^-1 b``, beyond the
    quantile of ``1 - false_alarm / heads``.

    Parameters
    ----------
    heads : sequence of N Head
    covariances : (N, 3, 3)
        Attitude covariance of each head in its own axes, rad^2.
    head : int
        The biased one, counted from 0.
    bias : (..., 3)
        Its error in fusion axes, rad.
    false_alarm : float
        Probability of a contradiction although all heads are right.

    Returns
    -------
    (...)
        That the biased head's own ``head_chi2`` exceeds its limit.

    Raises
    ------
    InvalidInputError
        On bad arguments, or fewer than two heads.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> heads = [ln.star_tracker.Head.looking(z) for z in np.eye(3)]
    >>> covariance = np.diag([2.5, 2.5, 17.5]) ** 2                        # any unit: here arcsec^2
    >>> ln.star_tracker.detection_power(heads, [covariance] * 3, 0, [[0, 0, 5], [0, 0, 20]]).round(3)
    array([0.006, 0.943])
    """
    mounted = checked_heads(heads)
    count = len(mounted)
    if count < 2:
        raise InvalidInputError(f"heads: expected at least 2 to compare, got {count}")
    if whole(head, "head", 0) >= count:
        raise InvalidInputError(f"head: expected a head from 0 to {count - 1}, got {head!r}")
    _, _, spreads, _ = fusion_inputs(mounted, [h.mounting.T for h in mounted], covariances)
    others = np.linalg.inv(np.delete(spreads[0], head, axis=0)).sum(axis=0)
    weight = np.linalg.inv(spreads[0, head] + np.linalg.inv(others))
    b = vectors(bias, "bias")
    noncentrality = np.einsum("...i,ij,...j->...", b, weight, b)
    limit = float(chi2_quantile(1.0 - false_alarm / count, 3))
    return np.asarray(np.vectorize(_noncentral_sf, otypes=[np.float64])(limit, noncentrality))[()]


def _noncentral_sf(limit: float, noncentrality: float) -> float:
    """Survival function of the noncentral chi-square with 3 degrees of freedom: Poisson mixture."""
    half = 0.5 * noncentrality
    spread = 10.0 * np.sqrt(half + 1.0) + 10.0
    terms = np.arange(max(0, int(half - spread)), int(half + spread) + 1)
    log_factorials = np.concatenate([[0.0], np.cumsum(np.log(np.arange(1, terms[-1] + 1)))])[terms]
    weights = np.exp(terms * np.log(half) - half - log_factorials) if half > 0 else 1.0 * (terms == 0)
    return float(min(1.0, weights @ np.asarray(chi2_sf(limit, 3 + 2 * terms))))

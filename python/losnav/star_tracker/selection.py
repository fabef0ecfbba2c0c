"""Which m of n stars to keep: the subset whose fused covariance is smallest.

    F(subset) = F0 + sum_{i in subset} (1/sigma_i^2) (I - b_i b_i')        (X14), F0 what is known already

``criterion``: "trace" (A-optimal, the mean variance), "determinant" (D-optimal, the ellipsoid's volume),
"worst" (E-optimal, the weakest axis).

1. "greedy": the best pair, then one star at a time, each the best addition.
2. "exchange" (Fedorov 1972, Mitchell 1974): from there, swap a chosen star for another as long as that helps.
   Stops at a set no single swap improves: nearly always the best one.
3. "exhaustive": all subsets, for small sets and as a yardstick.

With vectors of several heads turned into fusion axes the choice is that for the fused attitude.
"""

from __future__ import annotations

import math
from itertools import combinations, islice
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from losnav._arrays import ArrayLike, FloatArray, positive, units
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker.covariance import in_scale
from losnav.star_tracker.field import whole

__all__ = ["select_stars"]

Criterion: TypeAlias = Literal["trace", "determinant", "worst"]
Method: TypeAlias = Literal["greedy", "exchange", "exhaustive"]
IntArray = npt.NDArray[np.int64]
# Subsets looked at in one go by the exhaustive search, and the most it takes on.
BLOCK, MOST = 20_000, 5_000_000
# A swap must gain more than rounding.
GAIN = 1e-12
# Share of the mean information below which an axis counts as unknown.
UNKNOWN = 1e-13


def select_stars(
    body_vectors: ArrayLike,
    count: int,
    *,
    sigma: ArrayLike = 1.0,
    criterion: Criterion = "trace",
    method: Method = "exchange",
    information: ArrayLike | None = None,
) -> IntArray:
    """Indices of the stars that serve the attitude best.

    Parameters
    ----------
    body_vectors : (N, 3)
        Unit vectors; of several heads in fusion axes, ``b @ head.mounting.T``.
    count : int
        How many to keep, at least 2 (1 where ``information`` is given).
    sigma : scalar or (N,)
        1-sigma noise per axis, rad.
    criterion : {"trace", "determinant", "worst"}
        Of the covariance: sum of the variances, volume of the ellipsoid, variance of the weakest axis.
    method : {"exchange", "greedy", "exhaustive"}
        See the module. "exhaustive" looks at all subsets and refuses more than five million.
    information : (3, 3), optional
        What is known before, 1/rad^2, in the same axes: other heads, a gyro.

    Returns
    -------
    (count,) int
        Ascending indices into ``body_vectors``.

    Raises
    ------
    InvalidInputError
        On bad arguments, or more stars asked for than there are.

    Examples
    --------
    Six stars near the boresight, four at the corners: the corners tell about the roll.

    >>> import numpy as np
    >>> import losnav as ln
    >>> plane = np.vstack([0.01 * np.arange(12).reshape(6, 2), [[1, 1], [1, -1], [-1, 1], [-1, -1]]]) * 0.17
    >>> stars = np.column_stack([plane, np.ones(10)])
    >>> stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    >>> ln.star_tracker.select_stars(stars, 4)
    array([6, 7, 8, 9])
    """
    b = units(body_vectors, "body_vectors")
    if b.ndim != 2:
        raise InvalidInputError(f"body_vectors: expected shape (N, 3), got {b.shape}")
    number = whole(count, "count", 2 if information is None else 1)
    if number > len(b):
        raise InvalidInputError(f"count: expected at most the {len(b)} stars there are, got {number}")
    spread = in_scale(positive(sigma, "sigma"), "sigma")
    if spread.shape not in ((), (len(b),)):
        raise InvalidInputError(f"sigma: expected a scalar or shape ({len(b)},), got {spread.shape}")
    if criterion not in ("trace", "determinant", "worst"):
        raise InvalidInputError(f'criterion: expected "trace", "determinant" or "worst", got {criterion!r}')
    prior = np.zeros((3, 3))
    if information is not None:
        prior = in_scale(checked_covariances(information, "information"), "information", 2)
        if prior.shape != (3, 3):
            raise InvalidInputError(f"information: expected shape (3, 3), got {prior.shape}")
    each = _each(b, spread)
    # Of order one, whatever the unit.
    scale = np.abs(each).max()
    each, prior = each / scale, prior / scale
    if method == "exhaustive":
        chosen = _exhaustive(each, prior, number, criterion)
    elif method in ("greedy", "exchange"):
        chosen = _greedy(each, prior, number, criterion)
        if method == "exchange":
            chosen = _exchange(each, prior, chosen, criterion)
    else:
        raise InvalidInputError(f'method: expected "exchange", "greedy" or "exhaustive", got {method!r}')
    return np.sort(chosen)


def _each(b: FloatArray, sigma: FloatArray) -> FloatArray:
    """Information of every star, ``(N, 3, 3)``."""
    unit = b / np.linalg.norm(b, axis=1, keepdims=True)
    weight = np.broadcast_to((sigma / sigma.min()) ** -2.0, len(b))
    return np.asarray(
        weight[:, np.newaxis, np.newaxis] * (np.eye(3) - unit[:, :, np.newaxis] * unit[:, np.newaxis, :])
    )


def _cost(information: FloatArray, criterion: Criterion) -> FloatArray:
    """What is to be small; infinite for a set that leaves an axis unknown."""
    values = np.linalg.eigvalsh(information)
    known = values[..., 0] > UNKNOWN * values[..., 2]
    safe = np.where(known[..., np.newaxis], values, 1.0)
    if criterion == "trace":
        cost = (1.0 / safe).sum(axis=-1)
    else:
        cost = 1.0 / (safe.prod(axis=-1) if criterion == "determinant" else safe[..., 0])
    return np.asarray(np.where(known, cost, np.inf))


def _greedy(each: FloatArray, prior: FloatArray, count: int, criterion: Criterion) -> IntArray:
    total, chosen = prior, list[int]()
    if count >= 2 and not np.isfinite(_cost(prior, criterion)):
        first, second = np.triu_indices(len(each), 1)
        pair = _best(_cost(prior + each[first] + each[second], criterion))
        chosen = [int(first[pair]), int(second[pair])]
        total = prior + each[chosen].sum(axis=0)
    while len(chosen) < count:
        cost = _cost(total + each, criterion)
        cost[chosen] = np.nan
        star = _best(cost)
        chosen.append(star)
        total = total + each[star]
    return np.array(chosen, dtype=np.int64)


def _best(cost: FloatArray) -> int:
    """The least number; the first that is one where all are infinite."""
    return int(np.nanargmin(np.minimum(cost, np.finfo(float).max)))


def _exchange(each: FloatArray, prior: FloatArray, chosen: IntArray, criterion: Criterion) -> IntArray:
    """Best single swap, again and again; every step lowers the cost, so it ends."""
    chosen = chosen.copy()
    others = np.setdiff1d(np.arange(len(each)), chosen)
    if not len(others):
        return chosen
    total = prior + each[chosen].sum(axis=0)
    cost = float(_cost(total, criterion))
    while True:
        swaps = _cost(total - each[chosen][:, np.newaxis] + each[others], criterion)
        out, new = np.unravel_index(_best(swaps), swaps.shape)
        if not swaps[out, new] < cost * (1.0 - GAIN):
            return chosen
        chosen[out], others[new] = others[new], chosen[out]
        total = prior + each[chosen].sum(axis=0)
        cost = float(_cost(total, criterion))


def _exhaustive(each: FloatArray, prior: FloatArray, count: int, criterion: Criterion) -> IntArray:
    number = math.comb(len(each), count)
    if number > MOST:
        raise InvalidInputError(f"method: exhaustive would look at {number} subsets, more than {MOST}")
    subsets = combinations(range(len(each)), count)
    best, chosen = np.inf, np.arange(count)
    while block := list(islice(subsets, BLOCK)):
        index = np.array(block, dtype=np.int64)
        cost = _cost(prior + each[index].sum(axis=1), criterion)
        least = _best(cost)
        if cost[least] < best:
            best, chosen = float(cost[least]), index[least]
    return chosen

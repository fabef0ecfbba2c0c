"""What a wrong or uncertain mounting does to the fused attitude: (X14) and (X17) assume perfect ones.

Let the true mounting be ``exp(-[mu_n x]) S_n``; then

    bias = P sum_n S_n P_n^-1 S_n' mu_n                                              (T1)
    P_total = P + sum_n G_n C_n G_n',     G_n = P S_n P_n^-1 S_n'                    (T2)

for ``mu_n`` of covariance ``C_n``. Five arcseconds of one of three orthogonal heads across its boresight turn
the answer by 2.5", about its boresight by 0.05". Fusion does not remove them; :func:`align_heads` estimates
them in flight.
"""

from __future__ import annotations

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, broadcast, vectors
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker.covariance import (
    fused_covariance,
    in_scale,
    inverse_covariances,
    inverse_information,
    same_count,
    symmetric,
    with_mountings,
)

__all__ = ["consider_covariance", "mounting_bias", "mounting_sensitivity"]


def mounting_sensitivity(covariances: ArrayLike, mountings: ArrayLike) -> FloatArray:
    """How much of each head's mounting error goes into the fused attitude: ``G_n = P S_n P_n^-1 S_n'`` (T1).

    Parameters
    ----------
    covariances : (..., N, 3, 3)
        Attitude covariance of each head in its own axes, rad^2, positive definite.
    mountings : (N, 3, 3) or (..., N, 3, 3)
        Fusion from head.

    Returns
    -------
    (..., N, 3, 3)
        Derivative of the attitude error by the mounting error of head n, both in fusion axes; the matrices of
        all heads add up to the identity.

    Raises
    ------
    InvalidInputError
        As :func:`fused_covariance`.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> gains = ln.star_tracker.mounting_sensitivity([np.eye(3), np.eye(3)], [np.eye(3), np.eye(3)])
    >>> np.diagonal(gains, axis1=-2, axis2=-1)             # two equal heads: half of either error
    array([[0.5, 0.5, 0.5],
           [0.5, 0.5, 0.5]])
    """
    informations = inverse_covariances(covariances, "covariances")
    shape, (f, s) = with_mountings(("covariances", informations), mountings)
    turned = s @ f @ np.swapaxes(s, -1, -2)
    gains = inverse_information(symmetric(turned.sum(axis=-3)))[..., np.newaxis, :, :] @ turned
    return np.asarray(gains.reshape((*shape, *gains.shape[-3:])))


def mounting_bias(covariances: ArrayLike, mountings: ArrayLike, errors: ArrayLike) -> FloatArray:
    """Attitude error caused by mounting errors: ``sum_n G_n mu_n`` (T1).

    Parameters
    ----------
    covariances, mountings
        As for :func:`mounting_sensitivity`.
    errors : (..., N, 3)
        ``mu_n``, rad, fusion axes: the true mounting is ``exp(-[mu_n x]) S_n``.

    Returns
    -------
    (..., 3)
        Error ``dalpha`` of the fused attitude, rad, fusion axes.

    Raises
    ------
    InvalidInputError
        As :func:`fused_covariance`, or on errors of another shape.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> pair = [np.eye(3), np.eye(3)]
    >>> ln.star_tracker.mounting_bias(pair, pair, [[0.0, 0.0, 0.0], [0.0, 5.0, 0.0]])
    array([0. , 2.5, 0. ])
    """
    gains = mounting_sensitivity(covariances, mountings)
    mu = vectors_per_head(errors, gains.shape[-3], "errors")
    shape, (g, m) = broadcast(("covariances", gains, 3), ("errors", mu, 2))
    return np.asarray(np.einsum("bnij,bnj->bi", g, m).reshape((*shape, 3)))


def consider_covariance(
    covariances: ArrayLike, mountings: ArrayLike, mounting_covariances: ArrayLike
) -> FloatArray:
    """Covariance of the fused attitude when the mountings are uncertain and their errors ignored (T2).

    The weights are those of (X17), which know nothing of the mountings. Weights that do:
    :func:`fuse_attitudes` with heads that carry a ``mounting_covariance``.

    Parameters
    ----------
    covariances, mountings
        As for :func:`mounting_sensitivity`.
    mounting_covariances : (..., N, 3, 3)
        Covariance of ``mu_n`` in fusion axes, rad^2, independent from head to head; zero for a head that
        defines the fusion frame.

    Returns
    -------
    (..., 3, 3)
        In fusion axes, rad^2.

    Raises
    ------
    InvalidInputError
        As :func:`fused_covariance`.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> pair = [np.eye(3), np.eye(3)]
    >>> ln.star_tracker.consider_covariance(pair, pair, [0 * np.eye(3), 4 * np.eye(3)]).diagonal()
    array([1.5, 1.5, 1.5])
    """
    gains = mounting_sensitivity(covariances, mountings)
    spread = checked_covariances(mounting_covariances, "mounting_covariances")
    in_scale(spread, "mounting_covariances", 2)
    same_count(spread, gains.shape[-3], "mounting_covariances", 3)
    shape, (g, c) = broadcast(("covariances", gains, 3), ("mounting_covariances", spread, 3))
    added = (g @ c @ np.swapaxes(g, -1, -2)).sum(axis=-3).reshape((*shape, 3, 3))
    return symmetric(fused_covariance(covariances, mountings) + added)


def vectors_per_head(value: ArrayLike, count: int, name: str) -> FloatArray:
    """Finite ``(..., N, 3)`` with one row for each head."""
    array = in_scale(vectors(value, name), name, 1)
    if array.ndim < 2 or array.shape[-2] != count:
        raise InvalidInputError(f"{name}: expected shape (..., {count}, 3), got {array.shape}")
    return array

"""Heads that expose at different moments: every star brought to one epoch with the gyro's rate.

A body that turns at ``w`` (rad/s, body axes) sees fixed stars move as ``b(t + dt) = exp(-[w dt x]) b(t)``.
At 1 degree per second and 50 ms between two heads that is 180", a hundred times what the fusion promises. A
rolling shutter is the same with a time for each star.

The rate's own error ``sigma_w`` leaves ``sigma_w dt``, common to all stars of a head: 0.18" at 50 ms for a
gyro good to 0.001 deg/s. It adds ``dt^2 C_w`` to the head's covariance (:func:`epoch_covariance`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, units, vectors
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import rotation_matrices, unit
from losnav.star_tracker.covariance import per_head, renamed
from losnav.star_tracker.heads import Head, checked_heads

__all__ = ["epoch_covariance", "to_epoch"]


def to_epoch(
    heads: Sequence[Head],
    body_vectors: Sequence[ArrayLike],
    times: Sequence[ArrayLike],
    rate: ArrayLike,
    epoch: float = 0.0,
) -> list[FloatArray]:
    """Directions of all heads as they would have been measured at one epoch.

    Parameters
    ----------
    heads : sequence of N Head
        Their mountings take the rate into head axes.
    body_vectors : sequence of N arrays (N_n, 3)
        Unit vectors in head axes; a head may be empty.
    times : sequence of N scalars or arrays (N_n,)
        When each head was exposed, or each star (rolling shutter), s.
    rate : (3,)
        Angular rate of the body relative to the stars, fusion axes, rad/s, constant from the earliest time to
        the latest.
    epoch : float
        Moment to bring them to, s, on the clock of ``times``.

    Returns
    -------
    list of N arrays (N_n, 3)

    Raises
    ------
    InvalidInputError
        On vectors that are not unit, or times that do not fit.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> heads = [ln.star_tracker.Head.looking([0.0, 0.0, 1.0])] * 2
    >>> rate = np.radians([0.0, 1.0, 0.0])
    >>> late = [[np.sin(-rate[1] * 0.05), 0.0, np.cos(rate[1] * 0.05)]]     # the same star, 50 ms later
    >>> first, second = ln.star_tracker.to_epoch(heads, [[[0.0, 0.0, 1.0]], late], [0.0, 0.05], rate)
    >>> round(float(np.degrees(late[0][0])) * 3600, 3), bool(np.abs(second - first).max() < 1e-15)
    (-180.0, True)
    """
    mounted = checked_heads(heads)
    omega = vectors(rate, "rate")
    if omega.shape != (3,):
        raise InvalidInputError(f"rate: expected shape (3,), got {omega.shape}")
    moment = finite(epoch, "epoch")
    if moment.ndim:
        raise InvalidInputError(f"epoch: expected one number, got shape {moment.shape}")
    stars = per_head(body_vectors, len(mounted), "body_vectors", scalar=False)
    stamps = per_head(times, len(mounted), "times")
    result = []
    for n, (head, b, t) in enumerate(zip(mounted, stars, stamps, strict=True)):
        try:
            direction = units(b, "body_vectors")
        except InvalidInputError as error:
            raise renamed(error, {"body_vectors": f"body_vectors[{n}]"}) from None
        if direction.ndim != 2:
            raise InvalidInputError(f"body_vectors[{n}]: expected shape (N, 3), got {direction.shape}")
        stamp = finite(t, f"times[{n}]")
        if stamp.shape not in ((), (len(direction),)):
            raise InvalidInputError(
                f"times[{n}]: expected one time or {len(direction)}, one for each star, got {stamp.shape}"
            )
        turn = (moment - stamp)[..., np.newaxis] * (omega @ head.mounting)
        result.append(unit(np.einsum("...ij,...j->...i", rotation_matrices(turn), direction)))
    return result


def epoch_covariance(head: Head, covariance: ArrayLike, dt: float, rate_covariance: ArrayLike) -> FloatArray:
    """Covariance of a head's attitude after it was brought to another epoch with an uncertain rate.

    Parameters
    ----------
    head : Head
        Its mounting takes the rate's covariance into head axes.
    covariance : (..., 3, 3)
        Of the head's attitude in its own axes, rad^2.
    dt : float
        Epoch less time of exposure, s.
    rate_covariance : (3, 3)
        Of the angular rate, fusion axes, (rad/s)^2.

    Returns
    -------
    (..., 3, 3)
        Head axes, rad^2. The share of one rate is common to all heads: independent only where all but one
        have ``dt = 0``.

    Raises
    ------
    InvalidInputError
        On matrices that are no covariances.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> head = ln.star_tracker.Head.looking([0.0, 0.0, 1.0])
    >>> ln.star_tracker.epoch_covariance(head, np.eye(3), 2.0, np.diag([1.0, 0.0, 4.0])).diagonal()
    array([ 5.,  1., 17.])
    """
    own = checked_covariances(covariance, "covariance")
    spread = checked_covariances(rate_covariance, "rate_covariance")
    if spread.shape != (3, 3):
        raise InvalidInputError(f"rate_covariance: expected shape (3, 3), got {spread.shape}")
    time = finite(dt, "dt")
    if time.ndim:
        raise InvalidInputError(f"dt: expected one number, got shape {time.shape}")
    return np.asarray(own + time**2 * (head.mounting.T @ spread @ head.mounting))

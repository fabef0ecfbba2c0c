"""Attitude representations, the maps between them, and the error between two attitudes.

``dcm`` takes reference components to body components, ``v_body = dcm @ v_ref``. A quaternion is scalar last,
``[x, y, z, w]``, unit, and the orientation of the body in the reference frame; modified Rodrigues parameters
are ``mrp = q_v / (1 + q_w)``. As a SciPy rotation, ``Rotation.from_quat(q).as_matrix() == dcm.T`` and
``.as_mrp() == mrp``.

Every function broadcasts over leading dimensions and returns float64. Results are unique: quaternions have
``w >= 0`` (at ``w = 0``, a half turn, the first non-zero component is positive) and MRPs lie inside or on the
unit ball, a rotation of at most 180 degrees. Inputs may be any representative: either sign of a quaternion,
either MRP set. Large arrays run on all cores without the GIL.
"""

from __future__ import annotations

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray

__all__ = [
    "dcm_from_mrp",
    "dcm_from_quaternion",
    "mrp_from_dcm",
    "mrp_from_quaternion",
    "mrp_shadow",
    "quaternion_from_dcm",
    "quaternion_from_mrp",
    "rotation_error",
]


def dcm_from_mrp(mrp: ArrayLike) -> FloatArray:
    """Direction cosine matrix of an MRP, ``I + (8 [s x]^2 - 4 (1 - s's) [s x]) / (1 + s's)^2`` (equation 2).

    Parameters
    ----------
    mrp : (..., 3)
        Modified Rodrigues parameters, either set, of any finite size.

    Returns
    -------
    (..., 3, 3)
        Body from reference.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN or infinity.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> quarter_turn_about_z = [0.0, 0.0, np.tan(np.pi / 8)]
    >>> (ln.attitude.dcm_from_mrp(quarter_turn_about_z) @ [1.0, 0.0, 0.0]).round(12) + 0.0
    array([ 0., -1.,  0.])
    """
    return _core.dcm_from_mrp(mrp)


def mrp_from_dcm(dcm: ArrayLike) -> FloatArray:
    """MRP of a direction cosine matrix, inside or on the unit ball.

    Accurate at every angle, 180 degrees included: the division is by the largest quaternion component.

    Parameters
    ----------
    dcm : (..., 3, 3)
        Body from reference; orthonormal within 1e-5, determinant +1.

    Returns
    -------
    (..., 3)
        Modified Rodrigues parameters, ``e tan(angle / 4)``.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN, infinity, or a matrix that is no rotation.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.mrp_from_dcm([[1, 0, 0], [0, -1, 0], [0, 0, -1]])
    array([1., 0., 0.])
    """
    return _core.mrp_from_dcm(dcm)


def dcm_from_quaternion(q: ArrayLike) -> FloatArray:
    """Direction cosine matrix of a quaternion, ``(w^2 - v'v) I + 2 v v' - 2 w [v x]``.

    Parameters
    ----------
    q : (..., 4)
        Scalar last, either sign; normalised if its norm is within 0.01 of one, refused otherwise.

    Returns
    -------
    (..., 3, 3)
        Body from reference.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN, infinity, or a norm that is not one.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.dcm_from_quaternion([0.0, 0.6, 0.0, 0.8]).round(12)
    array([[ 0.28,  0.  , -0.96],
           [ 0.  ,  1.  ,  0.  ],
           [ 0.96,  0.  ,  0.28]])
    """
    return _core.dcm_from_quaternion(q)


def quaternion_from_dcm(dcm: ArrayLike) -> FloatArray:
    """Unit quaternion of a direction cosine matrix, scalar last, ``w >= 0`` (Shepperd 1978).

    Accurate at every angle. A matrix that is orthonormal only to single precision gives a quaternion of unit
    norm.

    Parameters
    ----------
    dcm : (..., 3, 3)
        Body from reference; orthonormal within 1e-5, determinant +1.

    Returns
    -------
    (..., 4)
        Orientation of the body in the reference frame.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN, infinity, or a matrix that is no rotation.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.quaternion_from_dcm([[-1, 0, 0], [0, -1, 0], [0, 0, 1]])
    array([0., 0., 1., 0.])
    """
    return _core.quaternion_from_dcm(dcm)


def mrp_from_quaternion(q: ArrayLike) -> FloatArray:
    """MRP of a quaternion, ``q_v / (1 + q_w)`` of the representative with ``w >= 0``.

    Parameters
    ----------
    q : (..., 4)
        Scalar last, either sign; normalised if its norm is within 0.01 of one, refused otherwise.

    Returns
    -------
    (..., 3)
        Inside or on the unit ball; the same for ``q`` and ``-q``.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN, infinity, or a norm that is not one.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.mrp_from_quaternion([0.0, 0.6, 0.0, -0.8]).round(12) + 0.0
    array([ 0.        , -0.33333333,  0.        ])
    """
    return _core.mrp_from_quaternion(q)


def quaternion_from_mrp(mrp: ArrayLike) -> FloatArray:
    """Unit quaternion of an MRP, ``[2 s, 1 - s's] / (1 + s's)``, ``w >= 0``.

    Parameters
    ----------
    mrp : (..., 3)
        Modified Rodrigues parameters, either set, of any finite size.

    Returns
    -------
    (..., 4)
        Scalar last.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN or infinity.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.quaternion_from_mrp([0.0, 1 / 3, 0.0]).round(12)
    array([0. , 0.6, 0. , 0.8])
    """
    return _core.quaternion_from_mrp(mrp)


def mrp_shadow(mrp: ArrayLike) -> FloatArray:
    """The other MRP of the same attitude, ``-s / s's``: the rotation the other way round.

    On the unit ball (180 degrees) it is ``-s``. The shadow of no rotation is a full turn, which lies at
    infinity and is refused.

    Parameters
    ----------
    mrp : (..., 3)
        Modified Rodrigues parameters, not zero.

    Returns
    -------
    (..., 3)
        The shadow set; not brought back into the unit ball.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN, infinity, or a zero MRP (or one so small that its shadow overflows).

    Examples
    --------
    >>> import losnav as ln
    >>> ln.attitude.mrp_shadow([0.0, 0.5, 0.0]) + 0.0
    array([ 0., -2.,  0.])
    """
    return _core.mrp_shadow(mrp)


def rotation_error(dcm_true: ArrayLike, dcm_estimate: ArrayLike) -> FloatArray:
    """Attitude error in body axes: ``dcm_true = expm(-[dalpha x]) @ dcm_estimate`` (equation 37).

    True minus estimate, the error all attitude covariances of losnav speak of; for small errors
    ``dcm_true = (I - [dalpha x]) @ dcm_estimate``. The full logarithm: accurate for tiny errors and up to
    180 degrees, where of the two rotation vectors the one whose first non-zero component is positive is
    returned.

    Parameters
    ----------
    dcm_true, dcm_estimate : (..., 3, 3)
        Body from reference; orthonormal within 1e-5, determinant +1.

    Returns
    -------
    (..., 3)
        Rotation vector, rad, of length at most pi.

    Raises
    ------
    InvalidInputError
        On wrong shapes, leading dimensions that do not broadcast, NaN, infinity, or a matrix that is no
        rotation.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> truth = ln.attitude.dcm_from_mrp([0.0, 0.0, np.tan(0.3 / 4)])
    >>> ln.attitude.rotation_error(truth, np.eye(3)).round(12)
    array([0. , 0. , 0.3])
    """
    return _core.rotation_error(dcm_true, dcm_estimate)

"""Attitude from directions known in two frames: Wahba's problem, its covariance, and what it leaves free.

A direction is a unit vector ``b`` in body axes and the same one, ``r``, in the reference frame, so that
``b = dcm @ r``: stars, the Sun, landmarks from a known position, a magnetic field.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from losnav import _core
from losnav._core import AttitudeSolution
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from typing import TypeAlias

    from losnav._arrays import ArrayLike

__all__ = ["AttitudeSolution", "solve_attitude", "solve_attitude_robust"]

Method: TypeAlias = Literal["quest", "q-method", "svd", "foam", "esoq2"]
OnError: TypeAlias = Literal["raise", "nan"]

ARCSEC = np.pi / 648000.0


def solve_attitude(
    body: ArrayLike,
    reference: ArrayLike,
    *,
    sigma: ArrayLike = 1.0,
    covariance: ArrayLike | None = None,
    method: Method = "quest",
    polish: bool = True,
    on_error: OnError = "raise",
) -> AttitudeSolution:
    """Attitude from unit vectors in body axes and in the reference frame, with covariance and rank.

    Minimises Wahba's loss ``1/2 sum |b - dcm r|^2 / sigma^2`` (equation A1). Leading dimensions broadcast;
    a batch runs on all cores without the GIL. Whatever the method, Newton steps on the residuals give its
    answer the digits that the profile matrix had lost, and the exact Hessian proves it the only minimum.

    Parameters
    ----------
    body : (..., N, 3)
        Measured unit vectors in body axes; norms off by up to 0.01 are normalised.
    reference : (N, 3) or (..., N, 3)
        The same directions in the reference frame.
    sigma : scalar, (N,), (..., N) or (..., 1)
        1-sigma noise of each direction, rad per axis. One of the N may be 0: that direction is exact. With
        the default the estimate is the same but covariance and chi2 are in units of an unknown noise.
    covariance : (..., N, 3, 3), optional
        Covariance of each direction in body axes, rad^2, instead of ``sigma`` (see :mod:`losnav.noise`); rank
        2 with the null space along the direction is welcome. The minimum is then the one that Newton steps
        reach from Wahba's with the mean weights.
    method : {"quest", "q-method", "svd", "foam", "esoq2"}
        Which classical solver gives the start. The results agree to rounding; "quest" is the fast one.
    polish : bool
        False returns the classical solver's own answer, digits lost included, ``converged`` where it lies
        within 1e-7 rad of the minimum.
    on_error : {"raise", "nan"}
        What an invalid problem does: raise, or become NaN and leave the rest of the batch alone.

    Returns
    -------
    AttitudeSolution
        Check ``converged``. It is False where the directions leave a rotation free: ``rank`` says how many
        are determined, ``free_axis`` which one is not, ``covariance`` is NaN, and the attitude is the one
        nearest to the identity among those that fit equally well.

    Raises
    ------
    InvalidInputError
        Naming the argument, the index and the rule broken.

    Examples
    --------
    >>> import numpy as np, losnav as ln
    >>> dcm = ln.attitude.dcm_from_mrp([0.1, 0.2, -0.3])
    >>> stars = np.array([[1.0, 0, 0], [0, 0.6, 0.8], [0, -0.8, 0.6]])
    >>> solution = ln.solve_attitude(stars @ dcm.T, stars, sigma=1e-5)
    >>> solution.mrp.round(9), solution.converged
    (array([ 0.1,  0.2, -0.3]), True)
    >>> ln.solve_attitude([[0.0, 0, 1]], [[0.0, 1, 0]]).free_axis  # the turn about it is free
    array([0., 0., 1.])
    """
    return _core.solve_attitude(body, reference, sigma, covariance, method, polish, on_error)


def solve_attitude_robust(
    body: ArrayLike,
    reference: ArrayLike,
    *,
    sigma: ArrayLike | None = None,
    max_outlier_ratio: float = 0.6,
    confidence: float = 0.9999,
    inlier_probability: float = 0.999,
    seed: int = 0,
    on_error: OnError = "raise",
) -> AttitudeSolution:
    """Attitude when some of the directions belong to other stars.

    Locally optimised RANSAC as in :func:`losnav.solve_pose_robust`: pairs whose separation agrees in both
    frames, scored by the truncated cost ``sum min(r^2, g^2)`` (MSAC), the promising ones optimised on their
    inliers, Wahba's problem of the inliers at the end. The same for the same seed on any number of cores.

    Parameters
    ----------
    body : (..., N, 3)
        Measured unit vectors in body axes, at least two, right or wrong.
    reference : (N, 3) or (..., N, 3)
        What they are taken for, in the reference frame. A star may appear twice.
    sigma : scalar, (N,), (..., N) or (..., 1)
        1-sigma noise of the right directions, rad per axis. It decides what counts as wrong: give the true
        one.
    max_outlier_ratio : float
        Greatest part of wrong directions to survive; bounds the number of samples.
    confidence : float
        Probability that a pair without wrong directions is drawn before the search stops.
    inlier_probability : float
        Part of the right directions that the gate lets pass (chi-square quantile, 2 degrees of freedom).
    seed : int
        Seed of the samples; problem k of a batch has its own.
    on_error : {"raise", "nan"}
        As for :func:`solve_attitude`.

    Returns
    -------
    AttitudeSolution
        ``inliers (..., N)`` says which directions were kept; covariance, chi2 and dof are those of the kept
        ones. ``converged`` also asks for three of them at least, and that no more were dropped than
        ``max_outlier_ratio`` allows.

    Raises
    ------
    InvalidInputError
        Naming the argument, the index and the rule broken.

    Examples
    --------
    >>> import numpy as np, losnav as ln
    >>> rng = np.random.default_rng(1)
    >>> stars = rng.standard_normal((20, 3))
    >>> stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    >>> body = stars @ ln.attitude.dcm_from_mrp([0.1, 0.2, 0.3]).T
    >>> body[:8] = body[7::-1]  # eight stars taken for others
    >>> solution = ln.solve_attitude_robust(body, stars, sigma=1e-5)
    >>> int(solution.inliers.sum()), solution.converged
    (12, True)
    """
    if sigma is None:
        raise InvalidInputError(
            "sigma: expected the noise of the right directions, got none; it decides what is wrong"
        )
    return _core.solve_attitude_robust(
        body, reference, sigma, max_outlier_ratio, confidence, inlier_probability, seed, on_error
    )


def describe(solution: AttitudeSolution) -> str:
    """One line on an attitude solution: the text of its ``repr``."""
    converged = np.asarray(solution.converged)
    if converged.ndim:
        full = int((np.asarray(solution.rank) == 3).sum())
        counts = f"converged {int(converged.sum())}, full rank {full} of {converged.size}"
        return f"AttitudeSolution(shape={converged.shape}, {counts})"
    quaternion = ", ".join(f"{c:.9g}" for c in solution.quaternion)
    residuals = f"chi2={solution.chi2:.4g} for {solution.dof} dof"
    kept = solution.inliers
    inliers = "" if kept is None else f", {int(kept.sum())} of {kept.size} directions kept"
    return f"AttitudeSolution(quaternion=[{quaternion}], {_knowledge(solution)}, {residuals}{inliers})"


def _knowledge(solution: AttitudeSolution) -> str:
    """What is known of one attitude, in words and numbers."""
    if solution.converged:
        deviation = np.sqrt(np.diag(solution.covariance))
        # Above half a degree seconds of arc are no unit to read.
        small = deviation.max() < np.pi / 360.0
        values = ", ".join(f"{d:.3g}" for d in deviation / (ARCSEC if small else np.pi / 180.0))
        return f"1-sigma about body axes [{values}] {'arcsec' if small else 'deg'}"
    if solution.rank == 2:
        axis = ", ".join(f"{c:.4f}" for c in solution.free_axis)
        return f"not converged: rank 2 of 3, the rotation about body axis [{axis}] is free"
    if np.isnan(solution.quaternion).any():
        return "not converged: invalid problem"
    if solution.rank < 3:
        return f"not converged: rank {solution.rank} of 3, the directions contradict each other"
    return "not converged"

"""Pose from lines of sight: where am I, how am I oriented, and how well do these directions tell.

A direction is the unit vector from the observer to a landmark in body (camera) axes,
``b = dcm @ (L - p) / |L - p|``; it may point anywhere, behind the camera too.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Literal

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, broadcast, points, vectors
from losnav._core import PoseSolution
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from typing import TypeAlias

__all__ = [
    "PoseSolution",
    "Termination",
    "fisher_information",
    "los_jacobian",
    "predict_los",
    "solve_pose",
    "solve_pose_robust",
]

Method: TypeAlias = Literal["lm", "gauss-newton"]
Parametrization: TypeAlias = Literal["rotation", "mrp"]
Loss: TypeAlias = Literal["squared", "huber", "cauchy", "tukey", "geman-mcclure"]
OnError: TypeAlias = Literal["raise", "nan"]


class Termination(IntEnum):
    """Why an iteration stopped. A reason, not a verdict: the verdict is ``PoseSolution.converged``."""

    GRADIENT = 0
    """The gradient vanishes to rounding."""
    STEP = 1
    """The step is below ``step_tolerance``."""
    COST = 2
    """The decrease of the cost is below ``cost_tolerance``."""
    MAX_ITERATIONS = 3
    """``max_iterations`` are used up."""
    DAMPING_EXHAUSTED = 4
    """No damping makes the cost fall."""
    SINGULAR = 5
    """The normal equations are singular (Gauss-Newton)."""
    NON_FINITE = 6
    """A number became infinite or NaN, or the problem was invalid under ``on_error="nan"``."""


TERMINATIONS = tuple(Termination)


def predict_los(landmarks: ArrayLike, position: ArrayLike, mrp: ArrayLike) -> FloatArray:
    """Directions to the landmarks, ``b = dcm(mrp) @ (L - p) / |L - p|`` (equations 4, 7).

    Parameters
    ----------
    landmarks : (N, 3) or (..., N, 3)
        Landmarks in the reference frame, m.
    position : (..., 3)
        Observer in the reference frame, m.
    mrp : (..., 3)
        Modified Rodrigues parameters of the body in the reference frame, either shadow set.

    Returns
    -------
    (..., N, 3)
        Unit vectors in body axes.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN or infinity, or an observer on a landmark.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.predict_los([[0.0, 0.0, 10.0]], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    array([[0., 0., 1.]])
    """
    shape, (flat, p, s) = _observers(landmarks, position, mrp)
    return np.asarray(_core.predict_los(flat, p, s)).reshape((*shape, flat.shape[-2], 3))


def los_jacobian(landmarks: ArrayLike, position: ArrayLike, mrp: ArrayLike) -> FloatArray:
    """Jacobian of :func:`predict_los` with columns ``[p, mrp]`` (equations 6, 11, 12).

    The MRP columns are those of the parameters as given: no switch to the shadow set.

    Parameters
    ----------
    landmarks, position, mrp
        As for :func:`predict_los`.

    Returns
    -------
    (..., N, 3, 6)
        Position columns in 1/m, MRP columns dimensionless.

    Raises
    ------
    InvalidInputError
        As :func:`predict_los`.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.los_jacobian([[0.0, 0.0, 10.0]], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]).shape
    (1, 3, 6)
    """
    shape, (flat, p, s) = _observers(landmarks, position, mrp)
    return np.asarray(_core.los_jacobian(flat, p, s)).reshape((*shape, flat.shape[-2], 3, 6))


def fisher_information(
    landmarks: ArrayLike,
    position: ArrayLike,
    mrp: ArrayLike,
    sigma: ArrayLike = 1.0,
    *,
    covariance: ArrayLike | None = None,
) -> FloatArray:
    """Fisher information about ``[dp, dalpha]`` (equations 38, 40); its inverse bounds every unbiased
    estimator.

    Parameters
    ----------
    landmarks, position, mrp
        As for :func:`predict_los`.
    sigma : scalar, (N,), (..., N) or (..., 1)
        1-sigma noise of each direction, rad per axis.
    covariance : (..., N, 3, 3), optional
        Covariance of each direction in body axes, rad^2, instead of ``sigma``; rank 2 with the null space
        along the line of sight is welcome (see :mod:`losnav.noise`).

    Returns
    -------
    (..., 6, 6)
        Position in the reference frame (1/m^2), attitude in body axes (1/rad^2). Singular where the pose is
        unobservable: that is an answer here, not an error.

    Raises
    ------
    InvalidInputError
        On bad arguments.

    Examples
    --------
    >>> import numpy as np, losnav as ln
    >>> ring = [[30.0, 0.0, 0.0], [0.0, 30.0, 0.0], [-30.0, 0.0, 0.0], [0.0, -30.0, 0.0]]
    >>> information = ln.fisher_information(ring, [0.0, 0.0, 500.0], [0.0, 0.0, 0.0], 2e-5)
    >>> deviation = np.sqrt(np.diag(np.linalg.inv(information)))
    >>> round(float(deviation[2]), 3)  # height, m: sigma h^2 / (2 r) for h much greater than r
    0.084
    """
    shape, (marks, p, s) = _observers(landmarks, position, mrp)
    n = marks.shape[-2]
    predicted = _core.predict_los(marks, p, s).reshape((*shape, n, 3))
    pose = np.concatenate([p, s], axis=-1).reshape((*shape, 6))
    marks = marks[0] if np.ndim(landmarks) == 2 else marks.reshape((*shape, n, 3))
    return _core.fisher_information(marks, predicted, sigma, covariance, pose)


def solve_pose(
    landmarks: ArrayLike,
    los: ArrayLike,
    *,
    sigma: ArrayLike = 1.0,
    covariance: ArrayLike | None = None,
    guess: ArrayLike | None = None,
    method: Method = "lm",
    parametrization: Parametrization = "rotation",
    loss: Loss = "squared",
    loss_scale: float | None = None,
    damping: float = 1e-3,
    max_iterations: int = 50,
    cost_tolerance: float = 1e-12,
    step_tolerance: float = 1e-12,
    on_error: OnError = "raise",
) -> PoseSolution:
    """Position and attitude from directions to known landmarks, with covariance and observability.

    Minimises ``1/2 sum rho((b - h)' W (b - h))`` (equation 13) over position and attitude. Leading dimensions
    broadcast; a batch runs on all cores without the GIL.

    Parameters
    ----------
    landmarks : (N, 3) or (..., N, 3)
        At least three distinct landmarks in the reference frame, m.
    los : (..., N, 3)
        Measured unit vectors in body (camera) axes; norms off by up to 0.01 are normalised.
    sigma : scalar, (N,), (..., N) or (..., 1)
        1-sigma noise of each direction, rad per axis. With the default the estimate is the same but
        covariance and chi2 are in units of an unknown noise.
    covariance : (..., N, 3, 3), optional
        Covariance of each direction in body axes, rad^2, instead of ``sigma``; rank 2 with the null space
        along the line of sight is welcome (see :mod:`losnav.noise`).
    guess : (..., 6), optional
        Start ``[p, mrp]``. Without it all minimal-solver candidates are polished and ranked, so no start is
        needed.
    method : {"lm", "gauss-newton"}
        Levenberg-Marquardt with gain ratio, or Gauss-Newton (the paper's GLSDC).
    parametrization : {"rotation", "mrp"}
        Step a small rotation on the manifold, or add to the MRP as the paper does.
    loss : {"squared", "huber", "cauchy", "tukey", "geman-mcclure"}
        Loss of one direction's residual.
    loss_scale : float, optional
        Residual, in sigma, at which the loss starts to forgive; each loss has its usual default.
    damping : float
        First Levenberg-Marquardt damping, relative to the diagonal of the normal equations.
    max_iterations : int
        Bound on trial steps, rejected ones included.
    cost_tolerance : float
        Stop when the cost falls, or is predicted to fall, by less than this part of itself (equation 24).
    step_tolerance : float
        Stop when the step is smaller than this, rad (position in units of the range).
    on_error : {"raise", "nan"}
        What an invalid problem does: raise, or become NaN and leave the rest of the batch alone.

    Returns
    -------
    PoseSolution
        Check ``converged``: not converging is a value, not an exception.

    Raises
    ------
    InvalidInputError
        Naming the argument, the index and the rule broken.

    Examples
    --------
    >>> import losnav as ln
    >>> landmarks = [[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0]]
    >>> los = ln.predict_los(landmarks, [-50, 50, 500], [0.09, -0.04, 0.03])
    >>> solution = ln.solve_pose(landmarks, los, sigma=2e-5)
    >>> solution.position.round(6), solution.converged
    (array([-50.,  50., 500.]), True)
    """
    return _core.solve_pose(
        landmarks,
        los,
        sigma,
        covariance,
        guess,
        method,
        parametrization,
        loss,
        loss_scale,
        damping,
        max_iterations,
        cost_tolerance,
        step_tolerance,
        on_error,
    )


def solve_pose_robust(
    landmarks: ArrayLike,
    los: ArrayLike,
    *,
    sigma: ArrayLike | None = None,
    covariance: ArrayLike | None = None,
    max_outlier_ratio: float = 0.6,
    confidence: float = 0.9999,
    inlier_probability: float = 0.999,
    seed: int = 0,
    max_iterations: int = 50,
    on_error: OnError = "raise",
) -> PoseSolution:
    """Position and attitude when some of the directions belong to other landmarks.

    Locally optimised RANSAC: minimal samples (P3P) scored by the truncated cost ``sum min(r^2, g^2)``
    (MSAC), the promising ones optimised on their inliers, the last optimisation guess-free on the inliers of
    the best. Without a guess, and the same for the same seed whatever the machine's cores.

    Parameters
    ----------
    landmarks : (N, 3) or (..., N, 3)
        Landmarks in the reference frame, m. A landmark may appear twice: at most one of its directions is
        right.
    los : (..., N, 3)
        Unit vectors in body (camera) axes, right or wrong.
    sigma : scalar, (N,), (..., N) or (..., 1)
        1-sigma noise of the right directions, rad per axis. It decides what counts as wrong: give the true
        one.
    covariance : (..., N, 3, 3), optional
        Covariance of each direction in body axes, rad^2, instead of ``sigma``.
    max_outlier_ratio : float
        Greatest part of wrong directions to survive; bounds the number of samples.
    confidence : float
        Probability that a sample without wrong directions is drawn before the search stops.
    inlier_probability : float
        Part of the right directions that the gate lets pass (chi-square quantile, 2 degrees of freedom).
    seed : int
        Seed of the samples; problem k of a batch has its own.
    max_iterations : int
        Bound on the steps of the last optimisation.
    on_error : {"raise", "nan"}
        As for :func:`solve_pose`.

    Returns
    -------
    PoseSolution
        ``inliers (..., N)`` says which directions were kept; covariance, chi2 and dof are those of the kept
        ones. ``converged`` also asks that no more directions were dropped than ``max_outlier_ratio`` allows.

    Raises
    ------
    InvalidInputError
        Naming the argument, the index and the rule broken.

    Examples
    --------
    >>> import numpy as np, losnav as ln
    >>> rng = np.random.default_rng(1)
    >>> landmarks = rng.uniform(-50, 50, (30, 3))
    >>> los = ln.predict_los(landmarks, [0, 0, 300], [0.1, 0.2, 0.3])
    >>> los[:12] = los[11::-1]  # twelve mismatches
    >>> solution = ln.solve_pose_robust(landmarks, los, sigma=1e-4)
    >>> int(solution.inliers.sum()), solution.converged
    (18, True)
    """
    if sigma is None and covariance is None:
        raise InvalidInputError(
            "sigma: expected the noise of the right directions, got none; it decides what is wrong"
        )
    return _core.solve_pose_robust(
        landmarks,
        los,
        1.0 if sigma is None else sigma,
        covariance,
        max_outlier_ratio,
        confidence,
        inlier_probability,
        seed,
        max_iterations,
        on_error,
    )


def describe(solution: PoseSolution) -> str:
    """One line on a pose solution: the text of its ``repr``."""
    if np.ndim(solution.converged):
        converged = np.asarray(solution.converged)
        return f"PoseSolution(shape={converged.shape}, converged {int(converged.sum())} of {converged.size})"
    deviation = np.sqrt(np.diag(solution.covariance))
    position = ", ".join(f"{x:.6g} ± {s:.2g}" for x, s in zip(solution.position, deviation[:3], strict=True))
    attitude = ", ".join(
        f"{x:.6f} ± {s:.2g}°" for x, s in zip(solution.mrp, np.degrees(deviation[3:]), strict=True)
    )
    return (
        f"PoseSolution(position=[{position}] m, mrp=[{attitude}], "
        f"chi2={solution.chi2:.4g} for {solution.dof} dof, {solution.iterations} iterations, "
        f"{Termination(solution.termination).name}, converged={solution.converged})"
    )


def _observers(
    landmarks: ArrayLike, position: ArrayLike, mrp: ArrayLike
) -> tuple[tuple[int, ...], tuple[FloatArray, FloatArray, FloatArray]]:
    """Batch shape and flat ``(1 or B, N, 3)``, ``(B, 3)``, ``(B, 3)``; refuses a range of zero."""
    marks, p, s = vectors(landmarks, "landmarks"), vectors(position, "position"), vectors(mrp, "mrp")
    if marks.ndim == 2:
        marks = points(marks, "landmarks")
        shape, (p, s) = broadcast(("position", p, 1), ("mrp", s, 1))
        marks = marks[np.newaxis]
    else:
        shape, (marks, p, s) = broadcast(("landmarks", marks, 2), ("position", p, 1), ("mrp", s, 1))
    with np.errstate(over="ignore", invalid="ignore"):
        range2 = ((marks - p[:, np.newaxis, :]) ** 2).sum(axis=-1)
    bad = ~((range2 > 0.0) & np.isfinite(range2))
    if bad.any():
        problem, index = (int(i) for i in np.argwhere(bad)[0])
        where = f" (problem {problem} of the batch)" if shape else ""
        raise InvalidInputError(
            f"position: expected a range to landmarks[{index}] whose square is above zero and finite, "
            f"got {range2[problem, index]:g}: the direction is undefined{where}"
        )
    return shape, (marks, p, s)

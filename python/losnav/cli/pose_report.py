"""What ``losnav solve-pose`` says about a pose: values, 1-sigma, fit, outliers, and what is weak in words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.cli.fit_report import finite, fit_text, listed, number, p_value, suspects

if TYPE_CHECKING:
    from losnav.cli.solve_pose import Problem

__all__ = ["report_json", "report_text"]

Array = NDArray[np.float64]

_LISTED = 12
_FULL_RANK = 6


def report_json(problem: Problem, solution: ln.PoseSolution, inliers: NDArray[np.bool_]) -> dict[str, Any]:
    """The report as a dictionary that JSON can hold.

    SI units and radians, but for names that say degrees.
    """
    covariance, scale = _covariance(problem, solution)
    sigma = np.sqrt(np.diag(covariance))
    geometry = _geometry(problem, solution, inliers)
    return {
        "converged": bool(solution.converged) and geometry["rank"] == _FULL_RANK,
        "termination": ln.Termination(int(solution.termination)).name.lower().replace("_", "-"),
        "iterations": int(solution.iterations),
        "position_m": listed(solution.position),
        "quaternion_xyzw": listed(solution.quaternion),
        "mrp": listed(solution.mrp),
        "dcm": [listed(row) for row in solution.dcm],
        "sigma_position_m": listed(sigma[:3]),
        "sigma_attitude_deg": listed(np.degrees(sigma[3:])),
        "covariance": [listed(row) for row in covariance],
        "sigma_los_rad": scale,
        "chi2": finite(solution.chi2) if problem.noise else None,
        "dof": int(solution.dof),
        "p_value": finite(p_value(float(solution.chi2), int(solution.dof))) if problem.noise else None,
        "fit": _fit(problem, solution, scale, not inliers.all()),
        "observations": len(problem.ids),
        "unobserved_landmarks": problem.unobserved,
        "rejected": [k for k, kept in zip(problem.ids, inliers, strict=True) if not kept],
        "suspicious": _suspicious(problem, solution, inliers),
        "geometry": geometry,
        "weakest": _weakest(problem, covariance),
        "alternatives": [
            {
                "position_m": listed(other.position),
                "quaternion_xyzw": listed(other.quaternion),
                "chi2": finite(other.chi2),
            }
            for other in solution.alternatives
        ],
    }


def report_text(facts: dict[str, Any]) -> str:
    """The report of :func:`report_json` for a person."""
    lines = []
    if not facts["converged"]:
        why = f"{facts['termination']} after {facts['iterations']} iterations"
        lines.append(f"NOT CONVERGED ({why}); do not use this pose")
    used = facts["observations"] - len(facts["rejected"])
    axes = "camera axes: x right, y down, z forward"
    lines.append(f"pose from {used} of {facts['observations']} observations ({axes})")
    for name, value, sigma in zip("xyz", facts["position_m"], facts["sigma_position_m"], strict=True):
        lines.append(f"  {name}          {number(value):>16} m     1-sigma {number(sigma, '.3g')} m")
    quaternion = ", ".join(number(v, ".9f") for v in facts["quaternion_xyzw"])
    lines.append(f"  quaternion [{quaternion}]  (x, y, z, w; camera from landmark frame)")
    lines.append(f"  MRP        [{', '.join(number(v, '.9f') for v in facts['mrp'])}]")
    sigmas = ", ".join(number(v, ".3g") for v in facts["sigma_attitude_deg"])
    lines.append(f"  attitude   1-sigma {sigmas} deg about camera x, y, z")
    lines.append(f"fit: {facts['fit']}")
    if facts["rejected"]:
        lines.append(f"rejected as wrong matches ({len(facts['rejected'])}): {_names(facts['rejected'])}")
    if facts["suspicious"]:
        found = [f"{entry['id']} ({entry['sigmas']:.1f} sigma)" for entry in facts["suspicious"]]
        lines.append(f"suspicious ({len(found)}): {_names(found)}")
    geometry = facts["geometry"]
    lines.append(f"geometry: rank {geometry['rank']} of 6, {geometry['explanation']}")
    if geometry["danger_cylinder_distance_m"] is not None and used == 3:
        lines[-1] += f"; danger cylinder {geometry['danger_cylinder_distance_m']:.3g} m away"
    lines.append(f"weakest: {facts['weakest']}")
    for other in facts["alternatives"]:
        place = ", ".join(number(v) for v in other["position_m"])
        lines.append(
            f"another pose fits comparably: position ({place}) m, chi2 {number(other['chi2'], '.4g')}"
        )
    return "\n".join(lines)


def _geometry(problem: Problem, solution: ln.PoseSolution, inliers: NDArray[np.bool_]) -> dict[str, Any]:
    """What the places of camera and landmarks allow to be known."""
    if np.isfinite(solution.position).all():
        # A pose that ran off to 1e300 m is judged too; its overflows are no news to a reader.
        with np.errstate(all="ignore"):
            seen = solution.observability
    else:
        # No pose to judge; what is lost from a place in general position is lost everywhere.
        marks = np.unique(problem.landmarks[inliers], axis=0)
        spread = np.ptp(problem.landmarks, axis=0).max()
        seen = ln.pose_observability(marks, marks.mean(axis=0) + spread * np.array([0.9, 1.3, 2.1]))
    return {
        "rank": int(seen.rank),
        "degree": finite(seen.degree),
        "diagnosis": str(seen.diagnosis),
        "explanation": seen.explanation,
        "danger_cylinder_distance_m": finite(seen.danger_cylinder_distance),
    }


def _covariance(problem: Problem, solution: ln.PoseSolution) -> tuple[Array, float | None]:
    """Covariance of the pose; without a given noise it is scaled by what the residuals show (then also
    returned)."""
    covariance = np.asarray(solution.covariance)
    if problem.noise:
        return covariance, None
    if int(solution.dof) < 1:
        return np.full((6, 6), np.nan), None
    variance = float(solution.chi2) / int(solution.dof)
    return covariance * variance, float(np.sqrt(variance))


def _fit(problem: Problem, solution: ln.PoseSolution, scale: float | None, rejecting: bool) -> str:
    """The residuals in words."""
    dof = int(solution.dof)
    if not problem.noise:
        if scale is None:
            return (
                "three observations are always met exactly and no sigma was given: nothing can be said of "
                "accuracy"
            )
        return (
            f"residuals show {scale:.3g} rad 1-sigma per axis, which scales the 1-sigma above (no --sigma "
            "given)"
        )
    chi2 = float(solution.chi2)
    if dof < 1:
        return (
            f"chi2 {chi2:.4g} for 0 degrees of freedom: three observations are always met exactly and "
            "cannot be checked"
        )
    return fit_text(chi2, dof, "wrong matches", rejecting)


def _suspicious(
    problem: Problem, solution: ln.PoseSolution, inliers: NDArray[np.bool_]
) -> list[dict[str, Any]]:
    """Observations used whose residual is larger than chance allows, worst first."""
    if not problem.noise or int(solution.dof) < 1 or not np.isfinite(solution.position).all():
        return []
    residual = problem.los - ln.predict_los(problem.landmarks, solution.position, solution.mrp)
    if problem.covariance is not None:
        square = np.einsum(
            "ni,ni->n", residual, np.linalg.solve(problem.covariance, residual[..., None])[..., 0]
        )
    else:
        square = np.sum(residual**2, axis=1) / problem.noise["sigma"] ** 2
    return [{"id": problem.ids[k], "sigmas": float(np.sqrt(square[k]))} for k in suspects(square, inliers)]


def _weakest(problem: Problem, covariance: Array) -> str:
    """The least known direction of position and axis of attitude, in words and numbers."""
    if not np.isfinite(covariance).all():
        return "unknown: the pose has no covariance"
    values, vectors = np.linalg.eigh(covariance[:3, :3])
    best, worst = np.sqrt(np.maximum(values[[0, 2]], 0.0))
    direction = vectors[:, 2] * (1 if vectors[np.argmax(abs(vectors[:, 2])), 2] > 0 else -1)
    axis_values, axes = np.linalg.eigh(covariance[3:, 3:])
    turn, axis = np.degrees(np.sqrt(max(axis_values[2], 0.0))), axes[:, 2]
    cross = covariance[:3, 3:] @ axis
    correlation = abs(direction @ cross) / (worst * np.radians(turn)) if worst > 0 and turn > 0 else 0.0
    name = ("x (right)", "y (down)", "z (boresight)")[int(np.argmax(abs(axis)))]
    text = (
        f"position along ({direction[0]:.2f}, {direction[1]:.2f}, {direction[2]:.2f}), 1-sigma {worst:.3g} m"
    )
    text += f", {worst / best:.1f} times the best direction; " if best > 0 else "; "
    text += f"attitude mostly about camera {name}, 1-sigma {turn:.3g} deg"
    if correlation > 0.9:
        text += f"; the two errors go together (correlation {correlation:.3f})"
    return text


def _names(names: list[str]) -> str:
    return ", ".join(names[:_LISTED]) + (
        f", … and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    )

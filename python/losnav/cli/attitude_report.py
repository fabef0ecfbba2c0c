"""What ``losnav solve-attitude`` says about an attitude: values, 1-sigma, fit, outliers, what is weak."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.cli.fit_report import finite, fit_text, listed, number, p_value, suspects
from losnav.cli.star_list import ARCSEC

if TYPE_CHECKING:
    from losnav.cli.solve_attitude import Problem

__all__ = ["report_json", "report_text"]

Array = NDArray[np.float64]

_FULL_RANK = 3
_AXES = ("x (right)", "y (down)", "z (boresight)")


def report_json(
    problem: Problem, solution: ln.AttitudeSolution, inliers: NDArray[np.bool_]
) -> dict[str, Any]:
    """The report as a dictionary that JSON can hold; names carry their units."""
    covariance, scale = _covariance(problem, solution)
    known = problem.sigma is not None
    residuals = _residuals(problem, solution)
    chi2, dof = float(solution.chi2), int(solution.dof)
    return {
        "converged": bool(solution.converged) and int(solution.rank) == _FULL_RANK,
        "method": problem.method,
        "quaternion_xyzw": listed(solution.quaternion),
        "mrp": listed(solution.mrp),
        "dcm": [listed(row) for row in np.asarray(solution.dcm)],
        "boresight": _boresight(np.asarray(solution.dcm)),
        "sigma_arcsec": listed(np.sqrt(np.diag(covariance)) / ARCSEC),
        "covariance": [listed(row) for row in covariance],
        "sigma_star_arcsec": finite(scale / ARCSEC) if scale is not None else None,
        "loss": finite(solution.loss) if known else None,
        "chi2": finite(chi2) if known else None,
        "dof": dof,
        "p_value": finite(p_value(chi2, dof)) if known else None,
        "fit": _fit(problem, chi2, dof, scale, not inliers.all()),
        "stars": len(problem.ids),
        "rejected": [name for name, kept in zip(problem.ids, inliers, strict=True) if not kept],
        "suspicious": _suspicious(problem, residuals, inliers, dof),
        "residuals": _each(problem, residuals, inliers),
        "rank": int(solution.rank),
        "free_axis": listed(solution.free_axis) if int(solution.rank) == 2 else None,
        "weakest": _weakest(covariance),
    }


def report_text(facts: dict[str, Any]) -> str:
    """The report of :func:`report_json` for a person."""
    used = facts["stars"] - len(facts["rejected"])
    lines = []
    if not facts["converged"]:
        lines.append(f"NOT DETERMINED ({_why(facts)}); do not use this attitude")
    lines.append(
        f"attitude from {used} of {facts['stars']} stars (camera axes: x right, y down, z along the "
        "boresight)"
    )
    quaternion = ", ".join(number(value, ".9f") for value in facts["quaternion_xyzw"])
    lines.append(f"  quaternion [{quaternion}]  (x, y, z, w; camera from catalogue frame)")
    for k, row in enumerate(facts["dcm"]):
        cells = ", ".join(number(value, "12.9f") for value in row)
        lines.append(f"  {'dcm' if k == 0 else '':<10} [{cells}]")
    sky = facts["boresight"]
    lines.append(
        f"  boresight  RA {number(sky['ra_deg'], '.6f')} deg, Dec {number(sky['dec_deg'], '+.6f')} deg, roll "
        f"{number(sky['roll_deg'], '.6f')} deg  (roll: of image up, from north through east)"
    )
    sigmas = ", ".join(number(value, ".3g") for value in facts["sigma_arcsec"])
    lines.append(f"  1-sigma    {sigmas} arcsec about camera x, y, z")
    lines.append(f"fit: {facts['fit']}")
    entries = {entry["id"]: entry for entry in facts["residuals"]}
    suspicious = [entry["id"] for entry in facts["suspicious"]]
    for names, words in ((facts["rejected"], "rejected as wrong stars"), (suspicious, "suspicious")):
        if names and used:
            described = [f"{name} ({_off(entries[name])})" for name in names]
            lines.append(f"{words} ({len(names)}): {', '.join(described)}")
    lines.append(f"weakest: {facts['weakest']}")
    return "\n".join(lines)


def _why(facts: dict[str, Any]) -> str:
    if facts["rejected"]:
        return "no attitude agrees with enough of the stars"
    if facts["rank"] == 2:
        axis = ", ".join(number(value, ".3f") for value in facts["free_axis"])
        return f"all directions are parallel: the rotation about [{axis}] in camera axes is free"
    return f"rank {facts['rank']} of {_FULL_RANK}"


def _off(entry: dict[str, Any]) -> str:
    angle = entry["off_arcsec"]
    if angle is None:
        return "no attitude to tell"
    size = f"{angle / 3600:.3g} deg" if angle >= 3600 else f"{angle:.3g} arcsec"
    magnitude = f", mag {entry['magnitude']:.1f}" if entry["magnitude"] is not None else ""
    return f"{size} off{magnitude}"


def _boresight(dcm: Array) -> dict[str, float | None]:
    """Where the optical axis points, and the position angle of image up (−y), degrees."""
    z, up = dcm[2], -dcm[1]
    ra, dec = np.arctan2(z[1], z[0]), np.arctan2(z[2], np.hypot(z[0], z[1]))
    east = np.array([-np.sin(ra), np.cos(ra), 0.0])
    north = np.array([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)])
    roll = np.arctan2(up @ east, up @ north)
    return {
        "ra_deg": finite(np.degrees(ra) % 360.0),
        "dec_deg": finite(np.degrees(dec)),
        "roll_deg": finite(np.degrees(roll) % 360.0),
    }


def _covariance(problem: Problem, solution: ln.AttitudeSolution) -> tuple[Array, float | None]:
    """Covariance of the attitude; without a given noise it is scaled by what the residuals show (then also
    returned)."""
    covariance = np.asarray(solution.covariance)
    if problem.sigma is not None:
        return covariance, None
    dof = int(solution.dof)
    if dof < 1:
        return np.full((3, 3), np.nan), None
    variance = float(solution.chi2) / dof
    return covariance * variance, float(np.sqrt(variance))


def _residuals(problem: Problem, solution: ln.AttitudeSolution) -> Array:
    """Angle of each star from where the attitude expects it, rad."""
    expected = problem.reference @ np.asarray(solution.dcm).T
    # Of nearly equal unit vectors the chord keeps the digits that the cosine loses.
    chord = np.linalg.norm(problem.body - expected, axis=1)
    return np.asarray(2 * np.arcsin(np.minimum(chord / 2, 1.0)))


def _each(problem: Problem, residuals: Array, inliers: NDArray[np.bool_]) -> list[dict[str, Any]]:
    """How far every star is from where the attitude expects it."""
    return [
        {
            "id": name,
            "off_arcsec": finite(residuals[k] / ARCSEC),
            "sigmas": None if problem.sigma is None else finite(residuals[k] / problem.sigma[k]),
            "magnitude": None if problem.magnitude is None else finite(problem.magnitude[k]),
            "used": bool(inliers[k]),
        }
        for k, name in enumerate(problem.ids)
    ]


def _suspicious(
    problem: Problem, residuals: Array, inliers: NDArray[np.bool_], dof: int
) -> list[dict[str, Any]]:
    """Stars used whose residual is larger than chance allows, worst first."""
    if problem.sigma is None or dof < 1:
        return []
    sigmas = residuals / problem.sigma
    return [{"id": problem.ids[k], "sigmas": float(sigmas[k])} for k in suspects(sigmas**2, inliers)]


def _fit(problem: Problem, chi2: float, dof: int, scale: float | None, rejecting: bool) -> str:
    """The residuals in words."""
    if problem.sigma is None:
        if scale is None:
            return "nothing to check, and no sigma was given: nothing can be said of accuracy"
        return (
            f"residuals show {scale / ARCSEC:.3g} arcsec 1-sigma per axis, which scales the 1-sigma above "
            "(no sigma given)"
        )
    if dof < 1:
        return f"chi2 {chi2:.4g} for {dof} degrees of freedom: nothing to check"
    return fit_text(chi2, dof, "wrong stars", rejecting)


def _weakest(covariance: Array) -> str:
    """The axis about which the attitude is least known, in words and numbers."""
    if not np.isfinite(covariance).all():
        return "unknown: the attitude has no covariance"
    values, vectors = np.linalg.eigh(covariance)
    best, worst = np.sqrt(np.maximum(values[[0, 2]], 0.0)) / ARCSEC
    name = _AXES[int(np.argmax(abs(vectors[:, 2])))]
    text = f"rotation mostly about camera {name}, 1-sigma {worst:.3g} arcsec"
    return f"{text}, {worst / best:.1f} times the best axis" if best > 0 else text

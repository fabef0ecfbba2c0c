"""Properties 1 to 5 of the covariance ellipsoid, with the counterexamples to two of them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.attitude import dcm_from_quaternion
from losnav.scenarios.star_tracker.judging import ARCSEC, best_angle, computed, tried, triple

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker
    from losnav.scenarios.star_tracker.result import StarTrackerResult
    from losnav.scenarios.verdicts import Claim

__all__ = ["property_claims"]

Array = NDArray[np.float64]

_ORTHOGONAL = math.pi / 2
_TOP = math.radians(120.0)
# A violation below this, relative, is rounding.
_ROUNDING = 1e-10
_DIRECTIONS = 400
_SETS = 10  # search cases for each set of heads whose ellipsoids are compared


def property_claims(result: StarTrackerResult) -> list[Claim]:
    """Properties 1 to 5, in order."""
    s = result.scenario
    return [*_inscribed(s), *_better(s), *_perpendicular(s), _best_layouts(s), *_invariants(s)]


def _heads(rng: Generator, cases: int, turned: bool) -> Array:
    """Random covariances of three heads, arcsec², (cases, 3, 3, 3): axisymmetric, or turned at random."""
    across = rng.uniform(1.0, 5.0, (cases, 3))
    ratio = rng.uniform(1.5, 15.0, (cases, 3))
    sigma = np.stack([across, across, across * ratio], axis=-1)
    if not turned:
        return np.asarray(sigma[..., None] ** 2 * np.eye(3))
    sigma[..., 1] *= rng.uniform(0.5, 2.0, (cases, 3))
    axes = _rotations(rng, (cases, 3))
    return (axes * sigma[..., None, :] ** 2) @ np.swapaxes(axes, -1, -2)


def _rotations(rng: Generator, shape: tuple[int, ...]) -> Array:
    quaternion = rng.standard_normal((*shape, 4))
    return dcm_from_quaternion(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))


def _inscribed(s: StarTracker) -> list[Claim]:
    """P1: the fused ellipsoid and the intersection of the heads' ellipsoids."""
    rng = np.random.default_rng(s.search_seed)
    sets = max(1, s.search_cases // _SETS)
    heads, turns = _heads(rng, sets, turned=True), _rotations(rng, (sets, 3))
    directions = rng.standard_normal((sets, _DIRECTIONS, 3))
    ratio = np.stack(
        [star_tracker.sandwich_ratio(p, m, u) for p, m, u in zip(heads, turns, directions, strict=True)]
    )
    aligned = star_tracker.sandwich_ratio([s.head_covariance] * 3, [np.eye(3)] * 3, directions[0])
    lowest, highest = min(float(ratio.min()), float(aligned.min())), float(ratio.max())
    inside = 1 / math.sqrt(3)
    return [
        computed(
            "P1a",
            "The fused ellipsoid is inscribed in the intersection of the heads' ellipsoids",
            f"its radius is {lowest:.4f} to {highest:.4f} of the intersection's",
            lowest,
            bool(abs(ratio - 1).max() < _ROUNDING),
            f"{sets} random sets of three heads, {_DIRECTIONS} directions each, and three equal aligned "
            f"ones: their ratio is {float(aligned.min()):.6f} to {float(aligned.max()):.6f}, 1/√3 "
            "everywhere, while the largest ellipsoid inscribed there is the head's own. They touch only "
            "where the other heads know nothing.",
            printed="inscribed",
            interval=(lowest, highest),
            established="does not",
        ),
        tried(
            "P1b",
            "The fused ellipsoid lies between 1/√N of the intersection and the intersection",
            (ratio > 1 + _ROUNDING) | (ratio < inside * (1 - _ROUNDING)),
            "What is true of P1; it follows from adding the heads' quadratic forms.",
            established="holds",
        ),
    ]


def _better(s: StarTracker) -> list[Claim]:
    """P2: the fused accuracy beats that of every head, in which sense."""
    rng = np.random.default_rng(s.search_seed + 1)
    heads, turns = _heads(rng, s.search_cases, turned=True), _rotations(rng, (s.search_cases, 3))
    fused = star_tracker.fused_covariance(heads, turns)
    alone = turns @ heads @ np.swapaxes(turns, -1, -2)
    margin = np.linalg.eigvalsh(alone - fused[:, None])[..., 0].min(axis=-1)
    along_x = star_tracker.Head.looking([1.0, 0.0, 0.0]).mounting
    head = np.diag(np.square(s.unequal_sigmas[0]))
    aligned = np.sqrt(np.diag(star_tracker.fused_covariance([head] * 3, [along_x] * 3)))
    mixed = np.stack([np.diag(np.square(row)) * ARCSEC**2 for row in ((10, 10, 80), (1, 1, 8), (10, 10, 80))])
    cross = star_tracker.separation_sweep(mixed, _ORTHOGONAL).sigma
    equal, unequal = (_worst_excess(s, heads) for heads in _published(s))
    return [
        tried(
            "P2a",
            "Fusion knows every physical axis better than each head does (matrix inequality)",
            margin < -_ROUNDING * np.trace(alone, axis1=-2, axis2=-1).max(axis=-1),
            "Smallest eigenvalue of S_n P_n S_n' − P over random heads and mountings; adding information "
            "cannot hurt.",
            established="holds",
        ),
        _counterexample(
            "P2b",
            "The fused σx, σy, σz are below each head's own σx, σy, σz in any frame",
            (float(aligned[0]), s.unequal_sigmas[0][0]),
            f"Three heads of {triple(np.array(s.unequal_sigmas[0]))} that all look along x of the fusion "
            "frame: its x axis is the weak axis of each.",
        ),
        _counterexample(
            "P2c",
            "The same, in the frame of a head with the heads orthogonal",
            (float(cross[0]), ARCSEC),
            "Heads of (10, 10, 80)″, (1, 1, 8)″ and (10, 10, 80)″ in the frame of head 1: its x axis is "
            "the weak axis of the only good head.",
        ),
        computed(
            "P2d",
            "The same, for equal heads in the frame of a head",
            f"fused over best head: at most {max(equal):.3f}",
            max(equal),
            max(equal) < 1,
            "Every axis, every head's frame, every separation up to 120°.",
            established="holds",
        ),
        computed(
            "P2e",
            "The same, for the scenario's unequal heads in the frame of any head",
            "fused over best head: at most "
            + ", ".join(f"{value:.3f} in head {k + 1}'s" for k, value in enumerate(unequal)),
            max(unequal),
            max(unequal) < 1,
            "Every axis, every separation up to 120°: away from the best head's frame, its weak axis falls "
            "on an axis that the others know less well.",
            established="does not",
        ),
    ]


def _published(s: StarTracker) -> tuple[Array, Array]:
    """Covariances of three equal and of three unequal heads."""
    return np.stack([s.head_covariance] * 3), np.stack([np.diag(np.square(row)) for row in s.unequal_sigmas])


def _worst_excess(s: StarTracker, heads: Array) -> list[float]:
    """Largest fused 1-sigma over that of the best single head for the same label, for each head's frame."""
    angles = np.arange(s.sweep_step, _TOP, s.sweep_step)
    best = np.sqrt(np.diagonal(heads, axis1=-2, axis2=-1)).min(axis=0)
    sweeps = [star_tracker.separation_sweep(heads, angles, frame=frame) for frame in range(3)]
    return [float((sweep.sigma / best).max()) for sweep in sweeps]


def _counterexample(number: str, statement: str, sigmas: tuple[float, float], why: str) -> Claim:
    fused, single = (sigma / ARCSEC for sigma in sigmas)
    return computed(
        number,
        statement,
        f"fused σx {fused:.2f}″, best head's {single:.2f}″",
        fused,
        fused <= single,
        why,
        established="does not",
    )


def _perpendicular(s: StarTracker) -> list[Claim]:
    """P3: z is best known when the long axes are perpendicular; in which frames, and what it costs."""
    rng = np.random.default_rng(s.search_seed + 2)
    heads, turns = _heads(rng, s.search_cases, turned=False), _rotations(rng, (s.search_cases, 3))
    turns[:, 0] = np.eye(3)
    square = star_tracker.separation_sweep([s.head_covariance] * 3, _ORTHOGONAL)
    at = star_tracker.fused_covariance(heads, square.mountings)[:, 2, 2]
    anywhere = star_tracker.fused_covariance(heads, turns)[:, 2, 2]
    equal = np.stack([s.head_covariance] * 3)
    folded = star_tracker.fused_covariance(equal, square.mountings[[0, 1, 1]])[2, 2]
    apart = float(abs(np.sqrt(folded) / square.sigma[2] - 1))
    symmetry = _symmetry_optimum(s, equal)
    return [
        tried(
            "P3",
            "In the frame of a head, perpendicular boresights give the best accuracy about z",
            anywhere < at * (1 - _ROUNDING),
            "Random unequal heads with equal x and y, random mountings against orthogonal ones.",
            established="holds",
        ),
        computed(
            "P3a",
            "Only mutually perpendicular boresights do",
            f"two heads along the same x: σz differs by {apart:.0e}",
            apart,
            apart > _ROUNDING,
            "About z of head 1 it is enough that the others are perpendicular to head 1; their mutual "
            "angle decides x and y.",
            established="does not",
        ),
        symmetry,
        _real_fields(s),
        _cross_axes(s, equal),
    ]


def _symmetry_optimum(s: StarTracker, equal: Array) -> Claim:
    def sigma_z(angles: Array) -> Array:
        return star_tracker.separation_sweep(equal, angles, frame="symmetry").sigma[:, 2]

    best = math.degrees(best_angle(sigma_z, s.sweep_step, _TOP, s.sweep_step))
    there, right = sigma_z(np.array([math.radians(best), _ORTHOGONAL])) / ARCSEC
    return computed(
        "P3b",
        "The same in any fusion frame",
        f"best at {best:.1f}° with z on the axis of symmetry: {there:.2f}″, and {right:.2f}″ at 90°",
        best,
        abs(best - 90) < 0.1,
        "Flattened to 120° all boresights are perpendicular to that z; what is best for a frame depends on "
        "it.",
        established="does not",
    )


def _real_fields(s: StarTracker) -> Claim:
    """P3c: random star fields instead of evenly spread stars."""
    rng = np.random.default_rng(s.search_seed + 3)
    head = star_tracker.Head(np.eye(3), s.fov, s.star_sigma)
    angles = np.radians(np.arange(75.0, 105.01, 0.25))
    best, loss = np.empty(s.star_fields), np.empty(s.star_fields)
    for k in range(s.star_fields):
        fields = np.stack([head.stars(s.stars, rng) for _ in range(3)])
        heads = np.linalg.inv(star_tracker.star_information(fields, s.star_sigma))
        sigma = star_tracker.separation_sweep(heads, angles).sigma[:, 2]
        best[k] = np.degrees(angles[np.argmin(sigma)])
        loss[k] = sigma[np.argmin(abs(angles - _ORTHOGONAL))] / sigma.min() - 1
    low, high = np.quantile(best, [0.025, 0.975])
    return computed(
        "P3c",
        "With random star fields the best separation is still 90°",
        f"95 % of the optima in {low:.1f}° to {high:.1f}°; loss at 90° {np.median(loss):.2%}, at most "
        f"{loss.max():.2%}",
        float(np.median(best)),
        bool(np.ptp(best) < 0.5),
        f"{s.star_fields} sets of three fields of {s.stars} stars; heads whose x and y are not alike. 90° "
        "remains a good rule.",
        interval=(float(low), float(high)),
        confidence=0.95,
        established="does not",
    )


def _cross_axes(s: StarTracker, equal: Array) -> Claim:
    angles = np.arange(0.0, _TOP + s.sweep_step / 2, s.sweep_step).clip(max=_TOP)
    sigma = star_tracker.separation_sweep(equal, angles).sigma[:, 0]
    worst = math.degrees(angles[np.argmax(sigma)])
    there = float(sigma.max() / s.head_sigma)
    return computed(
        "P3d",
        "The accuracy about x and y is best there too",
        f"worst at {worst:.1f}°: {there:.4f} of a head's, {sigma[0] / s.head_sigma:.4f} at 0°",
        worst,
        abs(worst - 90) > 1,
        "Parallel heads all measure x and y with their strong axes; the gain about z is paid for there.",
        established="does not",
    )


def _best_layouts(s: StarTracker) -> Claim:
    """P3e: four heads."""
    square = star_tracker.separation_boresights(_ORTHOGONAL)
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    traces = []
    for boresights in (corners, np.vstack([square, square[:1]])):
        mountings = [star_tracker.Head.looking(z).mounting for z in boresights]
        traces.append(float(np.trace(star_tracker.fused_covariance([s.head_covariance] * 4, mountings))))
    spread, ninety = (trace / ARCSEC**2 for trace in traces)
    return computed(
        "P3e",
        "Four heads too are best with angles of 90°",
        f"trace {spread:.2f} arcsec² as a tetrahedron, {ninety:.2f} with three orthogonal and one beside "
        "them",
        spread / ninety,
        ninety <= spread,
        "The rule for any number is even spreading, Σ z z' = (N/3) I; for three heads that is 90°, for "
        "four 109.5°.",
        established="does not",
    )


def _invariants(s: StarTracker) -> list[Claim]:
    """P4 and P5: what the choice of the frame leaves alone, and what it can do."""
    rng = np.random.default_rng(s.search_seed + 4)
    heads = np.stack([np.diag(np.square(row)) for row in s.unequal_sigmas])
    fused = star_tracker.separation_sweep(heads, math.radians(60.0)).covariance
    turns = _rotations(rng, (s.search_cases,))
    seen = np.diagonal(turns @ fused @ np.swapaxes(turns, -1, -2), axis1=-2, axis2=-1)
    change = float(abs(seen.sum(axis=1) / np.trace(fused) - 1).max())
    sigma = np.sqrt(np.linalg.eigvalsh(fused)) / ARCSEC
    low, high = float(np.sqrt(seen.min()) / ARCSEC), float(np.sqrt(seen.max()) / ARCSEC)
    level = _levelled(fused)
    uneven = float(np.ptp(np.diag(level)) / np.trace(level))
    return [
        computed(
            "P4",
            "The trace does not depend on the fusion frame",
            f"changes by at most {change:.0e} over {s.search_cases} frames",
            change,
            change < 1e-13,
            "Rotations leave it alone.",
            established="holds",
        ),
        computed(
            "P5a",
            "The fusion frame can be chosen for any desired accuracy of an axis",
            f"{low:.3f}″ to {high:.3f}″ over {s.search_cases} frames; principal axes {sigma[0]:.3f}″ to "
            f"{sigma[2]:.3f}″",
            low,
            bool(low < sigma[0] * (1 - _ROUNDING)),
            "No frame sees an axis better than the best principal axis or worse than the worst, and the "
            "sum of variances is fixed (Schur and Horn).",
            interval=(low, high),
            established="does not",
        ),
        computed(
            "P5b",
            "Within these limits it can: some frame makes all three axes equal",
            f"{triple(np.sqrt(np.diag(level)))}, equal to {uneven:.0e}",
            float(np.sqrt(level[0, 0]) / ARCSEC),
            uneven < 1e-12,
            "Constructed by two rotations about coordinate axes; unequal heads 60° apart.",
            established="holds",
        ),
    ]


def _levelled(covariance: Array) -> Array:
    """The covariance in a frame where its diagonal is constant: each step levels one axis against another."""
    level, turned = np.trace(covariance) / 3, covariance
    for axis in range(2):
        # Among the axes not yet level one is above and one below; rotate between them until this one fits.
        low, high = sorted((axis, axis + 1 + int(np.argmax(abs(np.diag(turned)[axis + 1 :] - level)))))
        a, b, c = turned[low, low], turned[high, high], turned[low, high]
        middle, radius = (a + b) / 2, math.hypot((a - b) / 2, c)
        phase = math.atan2(c, (a - b) / 2)
        angle = (phase - math.acos(max(-1.0, min(1.0, (level - middle) / radius)))) / 2
        rotation = np.eye(3)
        rotation[low, [low, high]] = math.cos(angle), math.sin(angle)
        rotation[high, [low, high]] = -math.sin(angle), math.cos(angle)
        turned = rotation @ turned @ rotation.T
    return np.asarray(turned)

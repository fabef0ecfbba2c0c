"""Ten thousand random scenes without a guess: the best pose is returned or listed, and no false success.

The reference is a local search from the truth and from many uniform attitudes, each polished; costs are
computed by the oracle. A scene counts as missed when the library's answer and all its alternatives cost more
than the best of these, or when a pose it calls converged is no minimum.
"""

import numpy as np
import pytest

import losnav as ln
from tests.oracle import los, multistart

pytestmark = pytest.mark.slow

SCENES = 2000
STARTS = 60
KINDS = ["4 planar", "4 general", "5", "8", "50"]
# Costs of one minimum reached twice differ by less than this part, plus the rounding of exact data.
SAME = 1e-5
FLOOR = 1e-8


def random_scenes(kind, count, rng):
    """Landmarks (S, N, 3), positions, dcms, sigmas, LOS: depth 1-50, noise 0-1e-3 rad, any attitude."""
    n = int(kind.split()[0])
    landmarks = rng.uniform(-1, 1, (count, n, 3))
    if kind == "4 planar":
        landmarks[..., 2] = 0
        landmarks = landmarks @ multistart.attitude_grid(count, seed=5)
    dcms = multistart.attitude_grid(count, seed=6)
    away = rng.standard_normal((count, 3))
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    size = np.linalg.norm(landmarks, axis=-1).max(axis=1)
    positions = away * (size * np.exp(rng.uniform(0, np.log(50), count)))[:, None]
    # A tenth of the scenes is free of noise; sigma is then only the unit of the cost.
    sigmas = 10 ** rng.uniform(-6, -3, count)
    noisy = rng.uniform(size=count) > 0.1
    directions = multistart.residuals(landmarks, np.zeros_like(landmarks), positions, dcms)[1]
    exact = np.einsum("sij,snj->sni", dcms, directions)
    measured = los.measure_tangent(exact, (sigmas * noisy)[:, None, None], rng)
    return landmarks, positions, dcms, sigmas, measured


def per_landmark(sigmas, landmarks):
    """(S,) -> (S, N)."""
    return np.repeat(sigmas[:, None], landmarks.shape[1], axis=1)


def cost_of(scene, positions, dcms):
    landmarks, _, _, sigmas, measured = scene
    cost = multistart.costs(landmarks, measured, sigmas[:, None, None], positions, dcms)
    return np.where(np.isfinite(cost), cost, np.inf)


def local_search(scene, positions, dcms):
    """Polished from given poses: positions, dcms, costs by the oracle, converged."""
    landmarks, _, _, sigmas, measured = scene
    guess = np.concatenate([positions, ln.attitude.mrp_from_dcm(dcms)], axis=-1)
    found = ln.solve_pose(
        landmarks,
        measured,
        sigma=per_landmark(sigmas, landmarks),
        guess=guess,
        max_iterations=200,
        on_error="nan",
    )
    dcms = np.asarray(found.dcm)
    return found.position, dcms, cost_of(scene, found.position, dcms), np.asarray(found.converged)


def best_known_cost(scene):
    """Lowest cost of a minimum over a search from the truth and from uniform attitudes."""
    landmarks, positions, dcms, _, measured = scene
    _, _, best, converged = local_search(scene, positions, dcms)
    best = np.where(converged, best, np.inf)
    for attitude in multistart.attitude_grid(STARTS, seed=8):
        turned = np.broadcast_to(attitude, dcms.shape)
        start = multistart.nearest_points(landmarks, measured, turned)
        _, _, cost, converged = local_search(scene, start, turned)
        best = np.where(converged, np.minimum(best, cost), best)
    return best


def best_listed_cost(scene, solution):
    """Lowest cost among the answer and its alternatives, recomputed by the oracle."""
    landmarks, _, _, sigmas, measured = scene
    best = cost_of(scene, solution.position, np.asarray(solution.dcm))
    for i, alternatives in enumerate(solution.alternatives):
        for other in alternatives:
            cost = multistart.costs(
                landmarks[i], measured[i], sigmas[i], other.position, np.asarray(other.dcm)
            )
            best[i] = min(best[i], float(cost))
    return best


def rises_all_around(scene, solution, rng):
    """At each pose, does the cost rise in 24 directions, 0.03 standard deviations away?"""
    positions, dcms = solution.position, np.asarray(solution.dcm)
    here = cost_of(scene, positions, dcms)
    # A pose without covariance gets an arbitrary one: its row is not looked at.
    covariance = np.where(np.isfinite(solution.covariance), solution.covariance, np.eye(6))
    scale = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    root = np.linalg.cholesky(covariance / (scale[:, :, None] * scale[:, None, :]) + 1e-12 * np.eye(6))
    good = np.ones(len(here), dtype=bool)
    for direction in rng.standard_normal((12, 6)):
        step = 0.03 * scale * (root @ (direction / np.linalg.norm(direction)))
        for sign in (1, -1):
            turned = multistart.exponentials(sign * step[:, 3:]) @ dcms
            there = cost_of(scene, positions + sign * step[:, :3], turned)
            good &= there >= here * (1 - 1e-5) - FLOOR
    return good


@pytest.mark.parametrize("kind", KINDS)
def test_ten_thousand_scenes(kind):
    rng = np.random.default_rng(KINDS.index(kind))
    scene = random_scenes(kind, SCENES, rng)
    landmarks, _, _, sigmas, measured = scene
    solution = ln.solve_pose(landmarks, measured, sigma=per_landmark(sigmas, landmarks), on_error="nan")
    converged = np.asarray(solution.converged)
    best = best_known_cost(scene)
    known = np.isfinite(best)
    assert known.mean() > 0.95
    listed = best_listed_cost(scene, solution)
    missed = known & ~(listed <= best * (1 + SAME) + FLOOR)
    assert not missed.any(), f"scenes {np.flatnonzero(missed)[:20]}: {int(missed.sum())} missed"
    false = converged & ~rises_all_around(scene, solution, rng)
    assert not false.any(), f"scenes {np.flatnonzero(false)[:20]} are no minima but called converged"
    # Where a minimum is known to exist the answer must be one.
    assert (converged | ~known).mean() > 0.999


@pytest.mark.parametrize("kind", ["4 planar", "4 general", "5"])
def test_against_brute_force_of_the_oracle(kind):
    """A hundred scenes each against a search that shares no code with the library."""
    rng = np.random.default_rng(100 + KINDS.index(kind))
    scene = random_scenes(kind, 100, rng)
    landmarks, positions, dcms, sigmas, measured = scene
    solution = ln.solve_pose(landmarks, measured, sigma=per_landmark(sigmas, landmarks), on_error="nan")
    listed = best_listed_cost(scene, solution)
    for i in range(100):
        minima = multistart.all_minima(landmarks[i], measured[i], sigmas[i], starts=60, seed=i)
        near = multistart.minimise(
            landmarks[i][None], measured[i][None], sigmas[i], positions[i][None], dcms[i][None]
        )
        best = min(minima[0][0], near[2][0])
        assert listed[i] <= best * (1 + SAME) + FLOOR, i

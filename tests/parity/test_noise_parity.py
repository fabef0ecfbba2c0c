"""The noise models against the oracle's formulas, simulation and the solver that consumes them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from scipy import stats

import losnav as ln
from tests import strategies
from tests.conftest import BAND, SAME_FORMULA
from tests.oracle import los as oracle
from tests.oracle.attitude import dcm_from_mrp

# Relative step of a central difference at its best: the cube root of rounding, squared.
DIFFERENCE = 1e-8
RUNS = 4000


def close(a, b, scale):
    np.testing.assert_allclose(a, b, rtol=0, atol=SAME_FORMULA * scale)


@given(strategies.scenes(maximum=6))
def test_models_are_the_oracles(scene):
    b = scene.los
    close(
        ln.noise.isotropic(scene.sigma, scene.count),
        [oracle.isotropic_covariance(x, scene.sigma) for x in b],
        1e-8,
    )
    tangent = [oracle.tangent_covariance(x, scene.sigma) for x in b]
    close(ln.noise.tangent(b, scene.sigma), tangent, scene.sigma**2)
    clear = b[np.abs(b[:, 2]) > 1e-3]
    focal = [oracle.focal_plane_covariance(x, 0.05 * scene.sigma, 0.05) for x in clear]
    close(ln.noise.focal_plane(clear, scene.sigma), np.reshape(focal, (-1, 3, 3)), scene.sigma**2)


@given(strategies.scenes(maximum=6))
def test_landmark_uncertainty_is_the_directions_derivative(scene):
    root = np.random.default_rng(scene.seed).standard_normal((3, 3))
    spread = root @ root.T
    ranges = np.linalg.norm(scene.landmarks - scene.position, axis=1)
    added = ln.noise.landmark_uncertainty(scene.los, ranges, scene.dcm, spread)
    for b, rho, landmark, covariance in zip(scene.los, ranges, scene.landmarks, added, strict=True):
        step = 1e-5 * rho
        columns = [
            oracle.los_from_dcm([landmark + e], scene.position, scene.dcm)[0]
            - oracle.los_from_dcm([landmark - e], scene.position, scene.dcm)[0]
            for e in step * np.eye(3)
        ]
        slope = np.column_stack(columns) / (2 * step)
        expected = slope @ spread @ slope.T
        np.testing.assert_allclose(covariance, expected, rtol=0, atol=DIFFERENCE * np.trace(spread) / rho**2)
        assert np.abs(covariance @ b).max() <= SAME_FORMULA * np.trace(spread) / rho**2


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_focal_plane_is_the_spread_of_simulated_pixels(side, rng):
    """Two components across the direction, chi-square with 2 degrees of freedom for each of the runs."""
    b = np.array([0.4, 0.5, side * 0.6])
    b /= np.linalg.norm(b)
    sigma = 1e-5
    measured = oracle.measure_focal_plane(np.broadcast_to(b, (RUNS, 3)), 0.05 * sigma, 0.05, rng)
    weight = oracle.weight_from_covariance(ln.noise.focal_plane(b, sigma), b)
    error = measured - b
    total = np.einsum("ni,ij,nj->", error, weight, error)
    low, high = stats.chi2.ppf([BAND / 2, 1 - BAND / 2], 2 * RUNS)
    assert low < total < high


def test_rank_two_and_isotropic_models_give_one_information():
    """To first order b'H = 0, so what a model says along the direction is void."""
    landmarks = [[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0]]
    mrp = [0.09, -0.04, 0.03]
    los = ln.predict_los(landmarks, [-50, 50, 500], mrp)
    common = {"landmarks": landmarks, "los": los, "guess": [-50, 50, 500, *mrp]}
    isotropic = ln.solve_pose(**common, covariance=ln.noise.isotropic(2e-5, 4)).covariance
    tangent = ln.solve_pose(**common, covariance=ln.noise.tangent(los, 2e-5)).covariance
    assert np.abs(isotropic - tangent).max() <= 1e-9 * np.abs(isotropic).max()


def test_batches_and_broadcasting():
    los = np.broadcast_to([0.0, 0.6, 0.8], (5, 4, 3))
    assert ln.noise.tangent(los, 1e-3).shape == (5, 4, 3, 3)
    assert ln.noise.focal_plane(los, np.full(4, 1e-3)).shape == (5, 4, 3, 3)
    assert ln.noise.isotropic(np.full((5, 4), 1e-3)).shape == (5, 4, 3, 3)
    attitudes = np.broadcast_to(dcm_from_mrp(np.array([0.1, 0.2, 0.3])), (5, 3, 3))
    one = ln.noise.landmark_uncertainty(los[0], np.full(4, 10.0), attitudes[0], np.eye(3))
    many = ln.noise.landmark_uncertainty(los, np.full((5, 4), 10.0), attitudes, np.eye(3))
    np.testing.assert_allclose(many, np.broadcast_to(one, (5, 4, 3, 3)), rtol=0, atol=1e-18)


@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda: ln.noise.isotropic(0.0, 4), "sigma"),
        (lambda: ln.noise.isotropic(1e-3), "n"),
        (lambda: ln.noise.isotropic([1e-3, 1e-3], 4), "sigma"),
        (lambda: ln.noise.isotropic(1e-3, 0), "n"),
        (lambda: ln.noise.tangent([0, 0, 2], 1e-3), "los"),
        (lambda: ln.noise.tangent([0, 0, 1], -1e-3), "sigma"),
        (lambda: ln.noise.tangent([0, 0, 1], 1e200), "sigma"),
        (lambda: ln.noise.focal_plane([[0, 0, 1], [1, 0, 0]], 1e-3), r"los\[1\]"),
        (lambda: ln.noise.focal_plane([[0, 0, 1], [0, 0, 1]], [1e-3, 1e-3, 1e-3]), "sigma_focal"),
        (lambda: ln.noise.landmark_uncertainty([0, 0, 1], 0.0, np.eye(3), np.eye(3)), "ranges"),
        (lambda: ln.noise.landmark_uncertainty([0, 0, 1], 1.0, 2 * np.eye(3), np.eye(3)), "dcm"),
        (lambda: ln.noise.landmark_uncertainty([0, 0, 1], 1.0, np.eye(3), -np.eye(3)), "landmark_covariance"),
    ],
)
def test_what_is_refused(call, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call()

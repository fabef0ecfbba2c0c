"""The star tracker's twin against itself: two routes to one number."""

import numpy as np
import pytest

from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector


def scene(seed):
    rng = np.random.default_rng(seed)
    mountings = [dcm_from_rotation_vector(v) for v in rng.standard_normal((3, 3))]
    dcm = dcm_from_rotation_vector(rng.standard_normal(3))
    stars = [oracle.square_field(rng, 6, 0.35) for _ in range(3)]
    catalogue = [b @ s.T @ dcm for s, b in zip(mountings, stars, strict=True)]
    return mountings, stars, catalogue, [0.5, 1.0, 2.0], dcm


@pytest.mark.parametrize("seed", range(5))
def test_covariance_is_the_inverse_hessian(seed):
    mountings, stars, catalogue, sigmas, dcm = scene(seed)
    covariance = oracle.covariance_from_stars(mountings, stars, sigmas)
    hessian = oracle.loss_hessian(mountings, stars, catalogue, sigmas, dcm)
    assert np.abs(covariance @ hessian - np.eye(3)).max() < 1e-5


@pytest.mark.parametrize("seed", range(5))
def test_stars_and_heads_agree(seed):
    mountings, stars, _, sigmas, _ = scene(seed)
    each = [oracle.covariance_from_stars([np.eye(3)], [b], [s]) for b, s in zip(stars, sigmas, strict=True)]
    fused = oracle.fused_covariance(each, mountings)
    assert fused == pytest.approx(oracle.covariance_from_stars(mountings, stars, sigmas), abs=1e-10)


@pytest.mark.parametrize("seed", range(5))
def test_noise_free_attitude_is_the_truth(seed):
    mountings, stars, catalogue, sigmas, dcm = scene(seed)
    assert np.abs(oracle.svd_attitude(mountings, stars, catalogue, sigmas) - dcm).max() < 1e-13


def test_aberration_is_classical_for_slow_observers():
    """v/c across the line of sight, 20.5" for the Earth's speed; none along it."""
    velocity = np.array([29_780.0, 0, 0])
    across = oracle.aberrated([0.0, 1, 0], velocity)
    assert np.arctan2(across[0], across[1]) / oracle.ARCSEC == pytest.approx(20.49, abs=0.01)
    assert oracle.aberrated([1.0, 0, 0], velocity) == pytest.approx([1, 0, 0])


def test_closed_form_of_one_geometry():
    """At 90 degrees sigma_z is s / sqrt(2 + 1/k^2)."""
    assert oracle.sigma_z(2.5, 7.0, np.pi / 2) == pytest.approx(2.5 / np.sqrt(2 + 1 / 49))

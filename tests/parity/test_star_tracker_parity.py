"""Fusion of heads against the oracle: rotated stars, Markley's SVD, stacked rows; whatever heads see what."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from tests import strategies as sts
from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector

# Two minimisers of one loss, in sigmas of the weakest axis, and rounding, rad: the SVD of the profile matrix
# loses digits where all stars are close together.
SAME_ATTITUDE, ROUNDING = 1e-6, 1e-12
# Two routes to one covariance at the fitted directions, relative to its largest entry.
SAME_COVARIANCE = 1e-8


@st.composite
def scenes(draw):
    """One to five heads with 0 to 12 stars each, at least two in all, noise over two decades."""
    rng = np.random.default_rng(draw(sts.SEEDS))
    count = draw(st.integers(1, 5))
    numbers = [int(n) for n in rng.integers(0, 13, count)]
    if sum(numbers) < 2:
        numbers[0] = 2
    mountings = [dcm_from_rotation_vector(rng.uniform(-np.pi, np.pi, 3)) for _ in range(count)]
    dcm = dcm_from_rotation_vector(draw(sts.rotation_vectors()))
    sigmas = 10 ** rng.uniform(-5, -4, count)
    stars = [oracle.square_field(rng, n, np.radians(30)) for n in numbers]
    catalogue = [b @ s.T @ dcm for s, b in zip(mountings, stars, strict=True)]
    measured = [oracle.quest_noise(rng, b, s) for b, s in zip(stars, sigmas, strict=True)]
    return mountings, measured, catalogue, sigmas


@given(scenes(), st.sampled_from(["quest", "q-method", "svd", "foam", "esoq2"]))
def test_fuse(scene, method):
    """Noise as numbers, for each star, and as the heads' own: the oracle's attitude and covariance."""
    mountings, measured, catalogue, sigmas = scene
    expected = oracle.svd_attitude(mountings, measured, catalogue, sigmas)
    fitted = [r @ expected.T @ s for s, r in zip(mountings, catalogue, strict=True)]
    covariance = oracle.covariance_from_stars(mountings, fitted, sigmas)
    weakest = np.sqrt(np.linalg.eigvalsh(covariance)[-1])
    plain = [ln.star_tracker.Head(s) for s in mountings]
    own = [ln.star_tracker.Head(s, noise=x) for s, x in zip(mountings, sigmas, strict=True)]
    each = [np.full(len(b), x) for b, x in zip(measured, sigmas, strict=True)]
    for heads, noise in ((plain, list(sigmas)), (plain, each), (own, None), (np.array(mountings), sigmas)):
        solution = ln.star_tracker.fuse(heads, measured, catalogue, noise, method)
        error = np.abs(ln.attitude.rotation_error(expected, solution.dcm)).max()
        assert error < SAME_ATTITUDE * weakest + ROUNDING
        assert np.abs(solution.covariance - covariance).max() < SAME_COVARIANCE * np.abs(covariance).max()
        assert solution.dof == 2 * sum(len(b) for b in measured) - 3
        loss = oracle.loss(mountings, measured, catalogue, sigmas, solution.dcm)
        assert solution.loss == pytest.approx(loss, rel=1e-6, abs=1e-9)


@given(scenes())
def test_covariances_of_stars_that_are_round_change_nothing(scene):
    """The general solver, given isotropic covariances, is Wahba's."""
    mountings, measured, catalogue, sigmas = scene
    heads = [ln.star_tracker.Head(s) for s in mountings]
    plain = ln.star_tracker.fuse(heads, measured, catalogue, list(sigmas))
    weakest = np.sqrt(np.linalg.eigvalsh(plain.covariance)[-1])
    for model in (
        lambda b, s: s**2 * np.broadcast_to(np.eye(3), (len(b), 3, 3)),
        ln.noise.tangent,
    ):
        spreads = [model(b, s) for b, s in zip(measured, sigmas, strict=True)]
        general = ln.star_tracker.fuse(heads, measured, catalogue, covariances=spreads)
        # Wahba's residual has a part along the star, of second order in the noise.
        assert np.abs(ln.attitude.rotation_error(plain.dcm, general.dcm)).max() < 1e-3 * weakest
        assert general.covariance == pytest.approx(plain.covariance, rel=1e-2, abs=1e-3 * weakest**2)
        assert general.dof == plain.dof
        assert general.chi2 == pytest.approx(plain.chi2, rel=1e-3, abs=1e-6)
        assert general.converged


@given(scenes(), sts.SEEDS)
def test_general_solution_is_stationary(scene, seed):
    """Any covariances: no small turn lowers the weighted sum of squares across the stars."""
    mountings, measured, catalogue, sigmas = scene
    rng = np.random.default_rng(seed)
    spreads = []
    for b, s in zip(measured, sigmas, strict=True):
        root = rng.standard_normal((len(b), 3, 3))
        spreads.append(s**2 * (root @ root.transpose(0, 2, 1) + 0.1 * np.eye(3)))
    heads = [ln.star_tracker.Head(s) for s in mountings]
    solution = ln.star_tracker.fuse(heads, measured, catalogue, covariances=spreads)

    def cost(dcm):
        total = 0.0
        for mounting, body, reference, spread in zip(mountings, measured, catalogue, spreads, strict=True):
            for b, r, c in zip(body, reference, spread, strict=True):
                basis = oracle.turned(b)[:, :2]
                across = basis.T @ (b - mounting.T @ dcm @ r)
                total += across @ np.linalg.solve(basis.T @ c @ basis, across)
        return total

    here = cost(solution.dcm)
    # A covariance of rank 2 is inverted with a little added along the star.
    assert solution.chi2 == pytest.approx(here, rel=1e-6, abs=1e-9)
    sigma = np.sqrt(np.linalg.eigvalsh(solution.covariance))
    axes = np.linalg.eigh(solution.covariance)[1].T
    for axis, size in zip(axes, sigma, strict=True):
        for sign in (0.1, -0.1):
            turned = cost(dcm_from_rotation_vector(sign * size * axis) @ solution.dcm)
            assert turned - here == pytest.approx(0.01, abs=1e-3)


def test_batches_are_their_members(rng):
    """Leading dimensions of the stars, of the catalogue, of both; empty heads among them."""
    mountings = [dcm_from_rotation_vector(v) for v in rng.standard_normal((3, 3))]
    heads = [ln.star_tracker.Head(s, np.radians(20), 1e-5) for s in mountings]
    dcms = [dcm_from_rotation_vector(v) for v in rng.standard_normal((4, 3))]
    stars = [oracle.square_field(rng, n, 0.3) for n in (3, 0, 2)]
    catalogue = [np.stack([b @ s.T @ d for d in dcms]) for s, b in zip(mountings, stars, strict=True)]
    many = [np.stack([oracle.quest_noise(rng, b, 1e-5) for _ in dcms]) for b in stars]
    for body in (stars, many):
        batch = ln.star_tracker.fuse(heads, body, catalogue)
        for k in range(4):
            one = [b if b.ndim == 2 else b[k] for b in body]
            single = ln.star_tracker.fuse(heads, one, [r[k] for r in catalogue])
            assert np.abs(batch.dcm[k] - single.dcm).max() < 1e-14
            assert batch.chi2[k] == pytest.approx(single.chi2, rel=1e-6)


def test_one_bad_problem_does_not_spoil_the_others(rng):
    heads = [ln.star_tracker.Head.looking(z, 0.3, 1e-5) for z in np.eye(3)]
    stars = [np.broadcast_to(h.stars(4, rng), (3, 4, 3)).copy() for h in heads]
    catalogue = [b[0] @ h.mounting.T for h, b in zip(heads, stars, strict=True)]
    stars[1][1, 2] = np.nan
    with pytest.raises(ln.InvalidInputError, match=r"body_vectors\[1\]\[1, 2"):
        ln.star_tracker.fuse(heads, stars, catalogue)
    wide = [ln.star_tracker.Head(h.mounting, h.fov, ln.star_tracker.PixelNoise(2000.0, 0.1)) for h in heads]
    for used in (heads, wide):
        found = ln.star_tracker.fuse(used, stars, catalogue, on_error="nan")
        assert found.converged.tolist() == [True, False, True]
        assert np.isnan(found.dcm[1]).all()
        assert np.abs(found.dcm[[0, 2]] - np.eye(3)).max() < 1e-12

"""In-flight alignment of heads: drift recovered, its covariance consistent, what is unknown said so."""

import numpy as np
import pytest
from scipy.stats import chi2

import losnav as ln
from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector
from tests.statistics.bands import nees_band

ARCSEC = oracle.ARCSEC
FOV = np.radians(20)
SIGMA = 7.03 * ARCSEC
BORESIGHTS = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]


def nominal(count=3, noise=SIGMA, spread=None):
    return [
        ln.star_tracker.Head(
            oracle.turned(z, 0.4 * n), FOV, noise, "ABC"[n], spread if n and spread is not None else None
        )
        for n, z in enumerate(BORESIGHTS[:count])
    ]


def frames_of(heads, drift, counts, rng, noise=None):
    """``counts[k][n]`` stars of head n in frame k, seen through mountings turned by the drift."""
    true = [dcm_from_rotation_vector(m) @ h.mounting for m, h in zip(drift, heads, strict=True)]
    body, catalogue = [], []
    for row in counts:
        dcm = dcm_from_rotation_vector(rng.uniform(-3, 3, 3))
        stars = [oracle.square_field(rng, n, FOV) for n in row]
        catalogue.append([b @ s.T @ dcm for b, s in zip(stars, true, strict=True)])
        if noise is None:
            sigmas = [h.noise.sigma_rad for h in heads]
            body.append([oracle.quest_noise(rng, b, s) for b, s in zip(stars, sigmas, strict=True)])
        else:
            body.append([noise(rng, b) for b in stars])
    return body, catalogue, np.array(true)


def nees_of(found, true, free):
    """Normalised squared error of the mountings of the free heads."""
    error = ln.attitude.rotation_error(true, found.mountings)[free].ravel()
    rows = np.concatenate([np.arange(3 * n, 3 * n + 3) for n in free])
    return error @ np.linalg.solve(found.covariance[np.ix_(rows, rows)], error)


def test_a_thermal_drift_is_recovered():
    """10-30 arcseconds on two heads, 1200 frames of 24 stars: below one arcsecond on every axis."""
    rng = np.random.default_rng(1)
    heads = nominal()
    drift = np.zeros((3, 3))
    for n in (1, 2):
        drift[n] = oracle.turned(rng.standard_normal(3))[:, 2] * rng.uniform(10, 30) * ARCSEC
    body, catalogue, true = frames_of(heads, drift, [[24, 24, 24]] * 1200, rng)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    assert found.converged
    error = ln.attitude.rotation_error(true, found.mountings) / ARCSEC
    assert np.abs(error).max() < 1.0
    assert found.sigma[1:].max() / ARCSEC < 0.35
    assert np.abs(found.corrections - drift).max() < 1.0 * ARCSEC
    assert np.array_equal(found.mountings[0], heads[0].mounting)
    assert found.p_value > 1e-3


@pytest.mark.parametrize("reference", [0, 2])
def test_covariance_is_consistent(reference):
    """NEES of all mountings together, and chi2 of the residuals, in the exact bands; frames with gaps."""
    runs, free = 200, [n for n in range(3) if n != reference]
    rng = np.random.default_rng(10 + reference)
    heads = nominal()
    values, residuals, freedom = [], 0.0, 0
    for _ in range(runs):
        drift = 20 * ARCSEC * rng.standard_normal((3, 3))
        drift[reference] = 0
        counts = rng.integers(0, 5, (25, 3))
        body, catalogue, true = frames_of(heads, drift, counts, rng)
        found = ln.star_tracker.align_heads(heads, body, catalogue, reference=reference)
        assert found.converged
        assert found.frames.sum() <= (counts.sum(axis=1) >= 2).sum()
        values.append(nees_of(found, true, free))
        residuals, freedom = residuals + found.chi2, freedom + found.dof
        used = counts[found.frames].sum()
        assert found.dof == 2 * used - 3 * found.frames.sum() - 6
    low, high = nees_band(6, runs)
    assert low < np.mean(values) < high
    # The sum of chi2 over all runs has the sum of their degrees of freedom.
    low, high = chi2.ppf([5e-4, 1 - 5e-4], freedom)
    assert low < residuals < high


def test_one_star_in_each_head_is_enough():
    """Interstar angles alone: two heads with a single star each, frame after frame."""
    runs = 200
    rng = np.random.default_rng(20)
    heads = nominal(2)
    values = []
    for _ in range(runs):
        drift = np.array([[0, 0, 0], 20 * ARCSEC * rng.standard_normal(3)])
        body, catalogue, true = frames_of(heads, drift, [[1, 1]] * 30, rng)
        found = ln.star_tracker.align_heads(heads, body, catalogue)
        # One number for each frame: the angle between the two stars.
        assert found.dof == 30 - 3
        values.append(nees_of(found, true, [1]))
    low, high = nees_band(3, runs)
    assert low < np.mean(values) < high


def test_wide_fields_with_their_own_noise():
    runs = 150
    rng = np.random.default_rng(30)
    noise = ln.star_tracker.PixelNoise.from_fov(FOV, 1024, 0.1)
    heads = nominal(2, noise)
    sigma = noise.sigma_px / noise.focal_length_px
    values = []
    for _ in range(runs):
        drift = np.array([[0, 0, 0], 20 * ARCSEC * rng.standard_normal(3)])
        body, catalogue, true = frames_of(
            heads, drift, [[5, 5]] * 10, rng, lambda r, b: oracle.pixel_noise(r, b, sigma)
        )
        values.append(nees_of(ln.star_tracker.align_heads(heads, body, catalogue), true, [1]))
    low, high = nees_band(3, runs)
    assert low < np.mean(values) < high


def test_large_misalignments_and_no_noise():
    """Two degrees off: found to rounding."""
    rng = np.random.default_rng(40)
    heads = nominal()
    drift = np.radians(2) * rng.uniform(-1, 1, (3, 3))
    drift[0] = 0
    body, catalogue, true = frames_of(heads, drift, [[6, 6, 6]] * 5, rng, lambda _, b: b)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    assert found.converged
    assert np.abs(ln.attitude.rotation_error(true, found.mountings)).max() < 1e-12
    # Newton: mountings and attitudes move together.
    assert found.iterations <= 7
    assert found.chi2 < 1e-9


def test_it_is_the_minimum_of_the_whole_problem():
    """The normal equations without elimination, all attitudes and mountings together, have no step left."""
    rng = np.random.default_rng(50)
    heads = nominal()
    body, catalogue, _ = frames_of(heads, 15 * ARCSEC * rng.standard_normal((3, 3)), [[4, 3, 2]] * 4, rng)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    rows, residuals = [], []
    for k in range(4):
        for n in range(3):
            for b, r in zip(body[k][n], catalogue[k][n], strict=True):
                p = found.attitudes[k] @ r
                cross = np.array([[0, -p[2], p[1]], [p[2], 0, -p[0]], [-p[1], p[0], 0]])
                row = np.zeros((3, 3 * 4 + 3 * 2))
                row[:, 3 * k : 3 * k + 3] = cross
                if n:
                    row[:, 12 + 3 * (n - 1) : 15 + 3 * (n - 1)] = -cross
                # Across the star only: what lies along it carries no information.
                rows.append(row / SIGMA)
                residuals.append((found.mountings[n] @ b - p) / SIGMA)
    rows, residuals = np.concatenate(rows), np.concatenate(residuals)
    step = np.linalg.lstsq(rows, residuals, rcond=None)[0]
    assert np.abs(step).max() < 1e-3 * ARCSEC
    whole = np.linalg.inv(rows.T @ rows)[12:, 12:]
    assert np.abs(found.covariance[3:, 3:] - whole).max() < 1e-3 * np.abs(whole).max()


def test_heads_never_seen_together():
    """No frame in which head C and another see stars: its mounting stays, and is named as unknown."""
    rng = np.random.default_rng(60)
    heads = nominal()
    counts = [[5, 5, 0], [0, 0, 6], [4, 6, 0], [0, 0, 4]]
    body, catalogue, true = frames_of(heads, 20 * ARCSEC * np.eye(3), counts, rng)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    assert not found.converged
    assert found.rank == 3
    assert found.unobservable.shape == (9, 3)
    assert np.abs(found.unobservable[:6]).max() < 1e-9
    assert np.array_equal(found.mountings[2], heads[2].mounting)
    assert np.isnan(found.sigma[2]).all()
    assert np.isfinite(found.sigma[1]).all()
    assert "head C about" in str(found)
    assert found.heads[2].mounting_covariance is None
    in_head_a = heads[0].mounting @ true[0].T
    error = ln.attitude.rotation_error(in_head_a @ true[1], found.mountings[1])
    assert error @ np.linalg.solve(found.covariance[3:6, 3:6], error) < chi2.isf(1e-3, 3)


def test_one_frame_with_one_star_in_each():
    """One interstar angle: one of three axes is known."""
    rng = np.random.default_rng(70)
    heads = nominal(2)
    body, catalogue, _ = frames_of(heads, np.zeros((2, 3)), [[1, 1]], rng)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    assert found.rank == 1
    assert not found.converged
    # With ground knowledge the rest is as it was.
    spread = (30 * ARCSEC) ** 2 * np.eye(3)
    known = ln.star_tracker.align_heads(nominal(2, spread=spread), body, catalogue, prior=True)
    assert known.converged
    values = np.sqrt(np.linalg.eigvalsh(known.covariance[3:, 3:])) / ARCSEC
    assert values[0] < 10
    assert values[1:] == pytest.approx([30, 30], rel=1e-6)


def test_the_prior_is_part_of_the_estimate():
    """Drift drawn from the prior, few frames: NEES in band, and smaller errors than without."""
    runs = 300
    rng = np.random.default_rng(80)
    spread = (5 * ARCSEC) ** 2 * np.eye(3)
    heads = nominal(2, spread=spread)
    values, residuals = [], []
    for _ in range(runs):
        drift = np.array([np.zeros(3), 5 * ARCSEC * rng.standard_normal(3)])
        body, catalogue, true = frames_of(heads, drift, [[2, 2]] * 3, rng)
        found = ln.star_tracker.align_heads(heads, body, catalogue, prior=True)
        assert found.sigma[1].max() <= 5 * ARCSEC
        # Twelve stars and three numbers of the prior, for three attitudes and a mounting.
        assert found.dof == 2 * 12 + 3 - 9 - 3
        values.append(nees_of(found, true, [1]))
        residuals.append(found.chi2)
    low, high = nees_band(3, runs)
    assert low < np.mean(values) < high
    low, high = nees_band(15, runs)
    assert low < np.mean(residuals) < high


def test_aligned_heads_fuse_without_bias():
    """Fusion with nominal mountings is off by more than its covariance says; with the aligned ones not."""
    rng = np.random.default_rng(90)
    heads = nominal()
    drift = np.array([[0, 0, 0], [25, -15, 10], [-20, 20, 5]]) * ARCSEC
    body, catalogue, true = frames_of(heads, drift, [[12, 12, 12]] * 300, rng)
    found = ln.star_tracker.align_heads(heads, body, catalogue)
    runs, dcm = 300, dcm_from_rotation_vector(np.array([0.3, 0.2, -1.0]))
    stars = [oracle.square_field(rng, 8, FOV) for _ in heads]
    seen = [b @ s.T @ dcm for b, s in zip(stars, true, strict=True)]
    many = [np.broadcast_to(b, (runs, 8, 3)).reshape(-1, 3) for b in stars]
    measured = [oracle.quest_noise(rng, b, SIGMA).reshape(runs, 8, 3) for b in many]
    for used, good in ((heads, False), (found.heads, True)):
        solution = ln.star_tracker.fuse(used, measured, seen)
        error = ln.attitude.rotation_error(dcm, solution.dcm)
        mean = np.einsum("ri,rij,rj->r", error, np.linalg.inv(solution.covariance), error).mean()
        assert bool(mean < 4) == good
    assert found.heads[1].mounting_covariance is not None
    assert found.heads[0].mounting_covariance is None

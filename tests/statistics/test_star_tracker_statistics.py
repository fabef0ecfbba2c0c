"""Monte Carlo of fused heads: errors in exact chi-square bands, power of the cross-check, at fixed seeds."""

import numpy as np
import pytest
from scipy.stats import beta, chi2, ncx2

import losnav as ln
from tests.conftest import BAND
from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector
from tests.statistics.bands import nees_band

ARCSEC = oracle.ARCSEC
FOV = np.radians(20)
DCM = dcm_from_rotation_vector(np.array([0.4, -1.1, 0.7]))
BORESIGHTS = [[0, 0, 1], [1, 0, 0], [0, 1, 0], [1, 1, -1]]


def tracker(count, noise=7.03 * ARCSEC, fov=FOV):
    return [
        ln.star_tracker.Head(oracle.turned(z, 0.3 * n), fov=fov, noise=noise, name="ABCD"[n])
        for n, z in enumerate(BORESIGHTS[:count])
    ]


def nees(errors, covariance):
    return np.einsum("ri,rij,rj->r", errors, np.linalg.inv(covariance), errors)


def binomial_band(p, runs, outside=BAND):
    """Counts a binomial variable of probability ``p`` stays within."""
    low, high = beta.ppf([outside / 2, 1 - outside / 2], [p * runs + 0.5] * 2, [(1 - p) * runs + 0.5] * 2)
    return low * runs, high * runs


def head_attitudes(heads, covariances, runs, rng):
    """True head attitudes disturbed by their covariances, in head axes."""
    turns = [
        np.array(
            [dcm_from_rotation_vector(d) for d in rng.multivariate_normal(np.zeros(3), p * 1e12, runs) * 1e-6]
        )
        for p in covariances
    ]
    return np.stack([t @ h.mounting.T @ DCM for t, h in zip(turns, heads, strict=True)], axis=1)


HEAD_COVARIANCE = np.diag([2.5, 2.5, 17.5]) ** 2 * ARCSEC**2


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_fused_attitudes(count):
    """NEES of the fusion, chi2 and each head's own chi2, in their bands."""
    runs = 2000
    heads = tracker(count)
    covariances = [HEAD_COVARIANCE * (1 + n) for n in range(count)]
    attitudes = head_attitudes(heads, covariances, runs, np.random.default_rng(count))
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, covariances, exclude=False)
    assert fused.converged.all()
    low, high = nees_band(3, runs)
    errors = ln.attitude.rotation_error(DCM, fused.dcm)
    assert low < nees(errors, fused.covariance).mean() < high
    if count > 1:
        low, high = nees_band(3 * (count - 1), runs)
        assert (fused.dof == 3 * (count - 1)).all()
        assert low < fused.chi2.mean() < high
        low, high = nees_band(3, runs)
        assert (fused.head_chi2.mean(axis=0) > low).all()
        assert (fused.head_chi2.mean(axis=0) < high).all()


def test_false_alarms_are_as_rare_as_asked():
    """At most the probability asked for (Bonferroni), and not much less: the tests share their heads."""
    runs, asked = 20_000, 0.02
    heads = tracker(3)
    covariances = [HEAD_COVARIANCE] * 3
    attitudes = head_attitudes(heads, covariances, runs, np.random.default_rng(11))
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, covariances, false_alarm=asked)
    alarms = fused.suspects.any(axis=1).sum()
    assert 0.7 * asked * runs < alarms < binomial_band(asked, runs)[1]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("head", [0, 1, 2])
def test_a_biased_head_is_found_and_named(head, axis):
    """20" in any axis of any head: power as predicted, and across the boresight nearly always."""
    runs = 3000
    heads = tracker(3)
    covariances = [HEAD_COVARIANCE] * 3
    attitudes = head_attitudes(heads, covariances, runs, np.random.default_rng(20 + 3 * head + axis))
    bias = 20 * ARCSEC * np.eye(3)[axis]
    biased = attitudes.copy()
    biased[:, head] = dcm_from_rotation_vector(-bias) @ attitudes[:, head]
    fused = ln.star_tracker.fuse_attitudes(heads, biased, covariances)
    power = float(ln.star_tracker.detection_power(heads, covariances, head, heads[head].mounting @ bias))
    others = np.linalg.inv(
        sum(
            np.linalg.inv(h.mounting @ HEAD_COVARIANCE @ h.mounting.T)
            for n, h in enumerate(heads)
            if n != head
        )
    )
    own = heads[head].mounting @ HEAD_COVARIANCE @ heads[head].mounting.T
    shift = heads[head].mounting @ bias
    noncentrality = shift @ np.linalg.solve(own + others, shift)
    assert power == pytest.approx(ncx2.sf(chi2.isf(1e-3 / 3, 3), 3, noncentrality), rel=1e-9)
    seen = ln.star_tracker.fuse_attitudes(heads, biased, covariances, exclude=False)
    over = (seen.head_chi2[:, head] > chi2.isf(1e-3 / 3, 3)).sum()
    low, high = binomial_band(power, runs)
    assert low < over < high
    # Something is found but the wrong head cleared: as rare as a false alarm.
    cleared = fused.suspects.any(axis=1) & ~fused.suspects[:, head]
    assert cleared.sum() <= binomial_band(1e-3, runs)[1]


@pytest.mark.parametrize("head", [0, 1, 2, 3])
def test_a_biased_head_of_four_is_named(head):
    """A fourth head on the diagonal: 60" have one explanation; the answer is that of the others."""
    runs = 1000
    heads = tracker(4)
    covariances = [HEAD_COVARIANCE] * 4
    attitudes = head_attitudes(heads, covariances, runs, np.random.default_rng(40 + head))
    attitudes[:, head] = dcm_from_rotation_vector(np.array([60 * ARCSEC, 0, 0])) @ attitudes[:, head]
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, covariances)
    named = fused.decided & fused.excluded[:, head] & (fused.excluded.sum(axis=1) == 1)
    assert named.mean() > 0.99
    attitudes[:, head] = np.nan
    without = ln.star_tracker.fuse_attitudes(heads, attitudes, covariances, exclude=False)
    assert np.abs(fused.dcm[named] - without.dcm[named]).max() < 1e-13
    low, high = nees_band(3, runs)
    assert low < nees(ln.attitude.rotation_error(DCM, without.dcm), without.covariance).mean() < high


def test_what_two_heads_may_both_have_done_is_settled_without_them():
    """20" about a boresight of three orthogonal heads: two suspects, and the third alone answers honestly."""
    heads = [ln.star_tracker.Head(oracle.turned(z), name=n) for z, n in zip(np.eye(3), "XYZ", strict=True)]
    attitudes = np.stack([h.mounting.T @ DCM for h in heads])
    turn = heads[1].mounting.T @ (20 * ARCSEC * np.eye(3)[0])
    attitudes[1] = dcm_from_rotation_vector(turn) @ attitudes[1]
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 3)
    assert fused.suspected == ("Y", "Z")
    assert fused.faulty == ()
    assert not fused.decided
    assert fused.used.tolist() == [True, False, False]
    assert np.linalg.norm(ln.attitude.rotation_error(DCM, fused.dcm)) < 1e-9
    assert np.sqrt(np.diag(fused.covariance)) / ARCSEC == pytest.approx([17.5, 2.5, 2.5])
    assert "Y or Z is wrong" in str(fused)


def test_of_two_heads_none_is_named():
    heads = tracker(2)
    attitudes = np.stack([h.mounting.T @ DCM for h in heads])
    attitudes[1] = dcm_from_rotation_vector(np.array([60 * ARCSEC, 0, 0])) @ attitudes[1]
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 2)
    assert not fused.consistent
    assert fused.faulty == ()
    assert fused.used.all()
    assert fused.suspected == ("A", "B")
    assert not fused.decided
    assert "A or B is wrong" in str(fused)
    assert fused.p_value < 1e-3


def test_of_two_that_see_none_is_named():
    """The third head is blind: whatever the two that are left say, it cannot be settled."""
    heads = tracker(3)
    attitudes = [h.mounting.T @ DCM for h in heads]
    attitudes[0] = dcm_from_rotation_vector(np.array([0, 60 * ARCSEC, 0])) @ attitudes[0]
    attitudes[2] = None
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 3)
    assert fused.suspected == ("A", "B")
    assert fused.used.tolist() == [True, True, False]
    assert not fused.decided
    assert not fused.consistent
    assert fused.dof == 3


def test_false_alarms_of_two_heads_are_exact():
    """One comparison, one test: the share of alarms is the probability asked for."""
    runs, asked = 20_000, 0.02
    heads = tracker(2)
    attitudes = head_attitudes(heads, [HEAD_COVARIANCE] * 2, runs, np.random.default_rng(12))
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 2, false_alarm=asked)
    low, high = binomial_band(asked, runs)
    assert low < (~fused.consistent).sum() < high


def test_blind_heads_are_named_and_do_not_matter():
    heads = tracker(4)
    covariances = [HEAD_COVARIANCE] * 4
    attitudes = head_attitudes(heads, covariances, 50, np.random.default_rng(5))
    fused = ln.star_tracker.fuse_attitudes(heads[:3], attitudes[:, :3], covariances[:3])
    dark = attitudes.copy()
    dark[:, 3] = np.nan
    same = ln.star_tracker.fuse_attitudes(heads, dark, covariances)
    assert np.array_equal(same.dcm, fused.dcm)
    assert np.array_equal(same.covariance, fused.covariance)
    assert same.blind[:, 3].all()
    assert "head D: blind" in str(same[0])
    single = ln.star_tracker.fuse_attitudes(heads, [*attitudes[0, :3], None], [*covariances[:3], None])
    assert np.array_equal(single.dcm, fused.dcm[0])


def test_all_heads_blind_is_a_value():
    fused = ln.star_tracker.fuse_attitudes(tracker(2), [None, None], [None, None])
    assert not fused.converged
    assert np.isnan(fused.dcm).all()
    assert np.isnan(fused.quaternion).all()
    assert fused.rank == 0


def test_two_faulty_heads_of_four():
    heads = tracker(4)
    attitudes = np.stack([h.mounting.T @ DCM for h in heads])
    attitudes[1] = dcm_from_rotation_vector(ARCSEC * np.array([90.0, 20, 0])) @ attitudes[1]
    attitudes[3] = dcm_from_rotation_vector(ARCSEC * np.array([-40.0, 70, 0])) @ attitudes[3]
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 4)
    assert fused.faulty == ("B", "D")
    assert np.linalg.norm(ln.attitude.rotation_error(DCM, fused.dcm)) < 1e-9


def test_a_wild_head_does_not_spoil_the_start():
    """A head half a turn off: left out, the answer that of the others."""
    heads = tracker(3)
    attitudes = np.stack([h.mounting.T @ DCM for h in heads])
    attitudes[0] = dcm_from_rotation_vector(np.array([0, 3.1, 0])) @ attitudes[0]
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, [HEAD_COVARIANCE] * 3)
    assert fused.faulty == ("A",)
    assert np.linalg.norm(ln.attitude.rotation_error(DCM, fused.dcm)) < 1e-9


def test_uncertain_mountings_widen_the_check():
    """Mountings wrong by their own covariance: NEES and chi2 in band when the heads say so."""
    runs = 2000
    rng = np.random.default_rng(9)
    spread = (8 * ARCSEC) ** 2 * np.eye(3)
    heads = [
        ln.star_tracker.Head(h.mounting, mounting_covariance=None if n == 0 else spread)
        for n, h in enumerate(tracker(3))
    ]
    covariances = [HEAD_COVARIANCE] * 3
    attitudes = head_attitudes(heads, covariances, runs, rng)
    for n in (1, 2):
        mu = 8 * ARCSEC * rng.standard_normal((runs, 3))
        # The head sits where the true mounting exp(-[mu x]) S puts it.
        true = np.array([dcm_from_rotation_vector(m) for m in mu]) @ heads[n].mounting
        attitudes[:, n] = attitudes[:, n] @ DCM.T @ heads[n].mounting @ np.swapaxes(true, -1, -2) @ DCM
    fused = ln.star_tracker.fuse_attitudes(heads, attitudes, covariances, exclude=False)
    errors = ln.attitude.rotation_error(DCM, fused.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, fused.covariance).mean() < high
    low, high = nees_band(6, runs)
    assert low < fused.chi2.mean() < high


# --- image-level fusion ------------------------------------------------------------------------------


def scene(heads, counts, runs, rng, noise=None):
    """True stars of every head (fixed over the runs), their catalogue directions, noisy measurements."""
    true = [oracle.square_field(rng, n, h.fov) for h, n in zip(heads, counts, strict=True)]
    catalogue = [b @ h.mounting.T @ DCM for h, b in zip(heads, true, strict=True)]
    many = [np.broadcast_to(b, (runs, *b.shape)) for b in true]
    if noise is not None:
        return true, catalogue, [noise(rng, b) for b in many]
    sigma = [h.noise.sigma_rad for h in heads]
    flat = [
        oracle.quest_noise(rng, b.reshape(-1, 3), s).reshape(b.shape)
        for b, s in zip(many, sigma, strict=True)
    ]
    return true, catalogue, flat


@pytest.mark.parametrize("stars", [1, 2, 5, 8, 50])
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_image_level_fusion(count, stars):
    """NEES and chi2 for one to four heads with one to fifty stars, in the exact bands."""
    runs = 60 if stars == 50 else 400
    heads = tracker(count)
    rng = np.random.default_rng(100 * count + stars)
    _, catalogue, measured = scene(heads, [stars] * count, runs, rng)
    solution = ln.star_tracker.fuse(heads, measured, catalogue)
    if count * stars == 1:
        # One star: two axes are known, the turn about it is free.
        assert (solution.rank == 2).all()
        assert not solution.converged.any()
        axis = heads[0].mounting @ measured[0][0, 0]
        assert abs(solution.free_axis[0] @ axis) == pytest.approx(1, abs=1e-9)
        return
    assert solution.converged.all()
    errors = ln.attitude.rotation_error(DCM, solution.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, solution.covariance).mean() < high
    dof = 2 * count * stars - 3
    assert (solution.dof == dof).all()
    low, high = nees_band(dof, runs)
    assert low < solution.chi2.mean() < high


def test_uneven_heads():
    """0, 1, 2 and 30 stars of different quality."""
    runs = 500
    heads = [
        ln.star_tracker.Head(h.mounting, FOV, s * ARCSEC)
        for h, s in zip(tracker(4), [3.0, 20.0, 8.0, 12.0], strict=True)
    ]
    rng = np.random.default_rng(77)
    true, catalogue, measured = scene(heads, [0, 1, 2, 30], runs, rng)
    solution = ln.star_tracker.fuse(heads, measured, catalogue)
    errors = ln.attitude.rotation_error(DCM, solution.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, solution.covariance).mean() < high
    expected = oracle.covariance_from_stars(
        [h.mounting for h in heads], true, [h.noise.sigma_rad for h in heads]
    )
    assert np.abs(solution.covariance - expected).max() < 1e-3 * np.abs(expected).max()


def test_images_and_attitudes_agree_where_both_can(rng):
    """Claim 11: the same answer where every head has its own attitude, with the covariances it has."""
    heads = tracker(3)
    _, catalogue, measured = scene(heads, [6, 8, 10], 20, rng)
    together = ln.star_tracker.fuse(heads, measured, catalogue)
    each = [
        ln.solve_attitude(b, r, sigma=h.noise.sigma_rad)
        for h, b, r in zip(heads, measured, catalogue, strict=True)
    ]
    fused = ln.star_tracker.fuse_attitudes(
        heads,
        np.stack([s.dcm for s in each], axis=1),
        np.stack([s.covariance for s in each], axis=1),
        exclude=False,
    )
    same = ln.star_tracker.fuse_attitudes(heads, each, exclude=False)
    assert np.array_equal(same.dcm, fused.dcm)
    apart = np.linalg.norm(ln.attitude.rotation_error(together.dcm, fused.dcm), axis=-1)
    # Second order in the noise: a thousandth of a sigma.
    assert apart.max() < 1e-3 * np.sqrt(np.linalg.eigvalsh(fused.covariance)[:, 0].min())
    assert np.abs(together.covariance - fused.covariance).max() < 1e-3 * fused.covariance.max()


@pytest.mark.parametrize("degrees", [20, 40, 60])
def test_pixel_noise_in_wide_fields(degrees):
    """NEES 3 with the detector's own noise; too small with the isotropic one, more so in wider fields."""
    runs, fov = 4000, np.radians(degrees)
    noise = ln.star_tracker.PixelNoise.from_fov(fov, 1024, 0.1)
    heads = tracker(1, noise, fov)
    sigma = noise.sigma_px / noise.focal_length_px
    rng = np.random.default_rng(degrees)
    _, catalogue, measured = scene(heads, [20], runs, rng, lambda r, b: oracle.pixel_noise(r, b, sigma))
    solution = ln.star_tracker.fuse(heads, measured, catalogue)
    assert solution.converged.all()
    errors = ln.attitude.rotation_error(DCM, solution.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, solution.covariance).mean() < high
    low, high = nees_band(37, runs)
    assert low < solution.chi2.mean() < high
    assert (solution.dof == 37).all()
    plain = ln.star_tracker.fuse(heads, measured, catalogue, sigma)
    errors = ln.attitude.rotation_error(DCM, plain.dcm)
    value = nees(errors, plain.covariance).mean()
    assert value < {20: 2.95, 40: 2.75, 60: 2.45}[degrees]


def test_three_wide_heads_with_their_own_noise():
    runs, fov = 1500, np.radians(40)
    noise = ln.star_tracker.PixelNoise.from_fov(fov, 1024, 0.2)
    heads = tracker(3, noise, fov)
    sigma = noise.sigma_px / noise.focal_length_px
    rng = np.random.default_rng(3)
    _, catalogue, measured = scene(heads, [1, 4, 9], runs, rng, lambda r, b: oracle.pixel_noise(r, b, sigma))
    solution = ln.star_tracker.fuse(heads, measured, catalogue)
    errors = ln.attitude.rotation_error(DCM, solution.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, solution.covariance).mean() < high
    low, high = nees_band(25, runs)
    assert low < solution.chi2.mean() < high


def test_an_uncertain_catalogue_is_part_of_the_noise():
    """Half of the stars 20" off their catalogue places: NEES in band with the covariances added."""
    runs = 1500
    heads = tracker(2)
    rng = np.random.default_rng(4)
    true, catalogue, measured = scene(heads, [8, 8], runs, rng)
    off = 20 * ARCSEC
    wrong, covariances = [], []
    for h, b, r in zip(heads, true, catalogue, strict=True):
        moved = np.broadcast_to(r, (runs, 8, 3)).copy()
        moved[:, ::2] = oracle.quest_noise(rng, moved[:, ::2].reshape(-1, 3), off).reshape(runs, 4, 3)
        wrong.append(moved)
        sigma = np.where(np.arange(8) % 2, h.noise.sigma_rad, np.hypot(h.noise.sigma_rad, off))
        covariances.append(ln.noise.tangent(b, sigma))
    solution = ln.star_tracker.fuse(heads, measured, wrong, covariances=covariances)
    errors = ln.attitude.rotation_error(DCM, solution.dcm)
    low, high = nees_band(3, runs)
    assert low < nees(errors, solution.covariance).mean() < high
    low, high = nees_band(29, runs)
    assert low < solution.chi2.mean() < high


@pytest.mark.parametrize("share", [0.2, 0.35, 0.5])
def test_false_stars_are_left_out(share):
    """20-50 % of all stars taken for others, spread over three heads: found, named by head, NEES in band."""
    runs, counts = 200, [12, 8, 10]
    heads = tracker(3)
    rng = np.random.default_rng(int(100 * share))
    _, catalogue, measured = scene(heads, counts, runs, rng)
    swapped, wrong = [], []
    for h, b, r in zip(heads, measured, catalogue, strict=True):
        number = round(share * len(r))
        false = np.zeros((runs, len(r)), dtype=bool)
        moved = np.broadcast_to(r, b.shape).copy()
        for k in range(runs):
            chosen = rng.choice(len(r), number, replace=False)
            moved[k, chosen] = oracle.square_field(rng, number, FOV) @ h.mounting.T @ DCM
            false[k, chosen] = True
        swapped.append(moved)
        wrong.append(false)
    solution = ln.star_tracker.fuse(heads, measured, swapped, robust=True)
    assert solution.converged.mean() > 0.99
    for kept, false in zip(ln.star_tracker.by_head(solution.inliers, measured), wrong, strict=True):
        assert not (kept & false).any()
        # One right star in a thousand falls outside the gate.
        assert kept[~false].mean() > 0.99
    good = solution.converged
    errors = ln.attitude.rotation_error(DCM, solution.dcm[good])
    low, high = nees_band(3, int(good.sum()))
    assert low < nees(errors, solution.covariance[good]).mean() < high
    # Without it the answer is a degree off.
    plain = ln.star_tracker.fuse(heads, measured, swapped)
    off = np.linalg.norm(ln.attitude.rotation_error(DCM, plain.dcm), axis=-1)
    assert np.median(off) > np.radians(0.5)

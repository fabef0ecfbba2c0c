"""Covariance of fused heads: closed forms, inequalities and invariants of the multi-head tracker."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from tests import strategies as sts
from tests.conftest import ROUNDING, SAME_FORMULA
from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector

ARCSEC = oracle.ARCSEC
# Central second differences of a double at their best step: rounding and truncation meet at about 1e-7.
HESSIAN = 1e-6
# Two routes to one covariance whose condition is up to 1e4.
SAME_COVARIANCE = 1e-10
ORTHOGONAL = np.stack([np.eye(3), np.eye(3)[:, [1, 2, 0]], np.eye(3)[:, [2, 0, 1]]])


def axisymmetric(s, k):
    return np.diag([s, s, k * s]) ** 2


def sigmas(covariance):
    return np.sqrt(np.diag(covariance))


@st.composite
def trackers(draw, least=2):
    """Mountings and full head covariances, widths over two decades, sometimes aligned with each other."""
    rng = np.random.default_rng(draw(sts.SEEDS))
    count = draw(st.integers(least, 6))
    mountings = np.array([dcm_from_rotation_vector(rng.uniform(-np.pi, np.pi, 3)) for _ in range(count)])
    if draw(st.booleans()):
        mountings[:] = mountings[0]
    widths = ARCSEC * 10 ** rng.uniform(0, 2, (count, 3))
    turns = np.array([dcm_from_rotation_vector(rng.uniform(-3, 3, 3)) for _ in range(count)])
    covariances = np.einsum("nij,nj,nkj->nik", turns, widths**2, turns)
    return 0.5 * (covariances + covariances.transpose(0, 2, 1)), mountings


def test_orthogonal_heads_closed_form():
    """s / sqrt(2 + 1/k^2) about every axis, to rounding."""
    for k in (1.0, 4.0, 7.0, 14.0, 100.0):
        fused = ln.star_tracker.fused_covariance([axisymmetric(2.5 * ARCSEC, k)] * 3, ORTHOGONAL)
        expected = (2.5 * ARCSEC) ** 2 / (2 + 1 / k**2)
        assert np.abs(fused / expected - np.eye(3)).max() < ROUNDING


@pytest.mark.parametrize("k", [1.0, 2.0, 7.0, 14.0])
def test_sigma_z_over_the_angle(k):
    angles = np.radians(np.linspace(0, 120, 241))
    s = 2.5 * ARCSEC
    sweep = ln.star_tracker.separation_sweep([axisymmetric(s, k)] * 3, angles)
    assert np.abs(sweep.sigma[:, 2] / oracle.sigma_z(s, k, angles) - 1).max() < SAME_COVARIANCE
    assert np.abs(sweep.sigma[:, 0] / sweep.sigma[:, 1] - 1).max() < SAME_COVARIANCE
    cosines = np.einsum("anj,amj->anm", sweep.boresights, sweep.boresights)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        assert np.abs(cosines[:, i, j] - np.cos(angles)).max() < SAME_FORMULA


def test_accuracy_is_best_at_right_angles_in_a_head_frame():
    """Property 3, for equal and for unequal heads: z of head 1, trace, determinant and the worst axis."""
    angles = np.radians(np.arange(0, 120.5, 0.5))
    equal = [axisymmetric(2.5, 7.0)] * 3
    unequal = [np.diag([3.0, 3, 24]) ** 2, np.diag([4.0, 4, 30]) ** 2, np.diag([5.0, 5, 40]) ** 2]
    for heads in (equal, unequal):
        sweep = ln.star_tracker.separation_sweep(heads, angles)
        for measure in ("z", "trace", "determinant", "worst"):
            assert np.degrees(sweep.best(measure)) == pytest.approx(90)
        for head in (1, 2):
            other = ln.star_tracker.separation_sweep(heads, angles, frame=head)
            assert np.degrees(other.best("z")) == pytest.approx(90)


def test_but_not_in_every_frame():
    """With z on the axis of symmetry 120 degrees is best: 1.73" against 2.11"."""
    heads = [np.diag([3.0, 3, 24]) ** 2] * 3
    sweep = ln.star_tracker.separation_sweep(heads, np.radians([90, 120]), frame="symmetry")
    assert sweep.sigma[:, 2].round(2).tolist() == [2.11, 1.73]
    assert sweep.best("z") == pytest.approx(2 * np.pi / 3)


def test_asymmetric_geometry():
    """Heads 43 degrees apart, the third at equal angles: 2.110" at 90 degrees, and nowhere better."""
    angles = np.radians(np.linspace(21.5, 158.5, 549))
    k = ln.star_tracker.boresight_ratio(np.radians(20))
    sweep = ln.star_tracker.separation_sweep([axisymmetric(2.5, k)] * 3, angles, "asymmetric")
    assert np.degrees(sweep.best("z")) == pytest.approx(90)
    assert np.degrees(sweep.best("trace")) == pytest.approx(90)
    assert sweep.sigma[:, 2].min() == pytest.approx(2.110, abs=2e-3)
    z1, z2, z3 = np.moveaxis(sweep.boresights, -2, 0)
    assert np.einsum("aj,aj->a", z1, z2) == pytest.approx(np.cos(np.radians(43)), abs=SAME_FORMULA)
    assert np.einsum("aj,aj->a", z1, z3) == pytest.approx(np.cos(angles), abs=SAME_FORMULA)
    assert np.einsum("aj,aj->a", z2, z3) == pytest.approx(np.cos(angles), abs=SAME_FORMULA)
    assert np.linalg.norm(z3, axis=-1) == pytest.approx(1, abs=SAME_FORMULA)


@given(sts.SEEDS)
def test_information_of_stars_is_the_hessian(seed):
    """(14) against the numerical second derivative of the loss (1)."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    mountings = [dcm_from_rotation_vector(rng.uniform(-np.pi, np.pi, 3)) for _ in range(count)]
    dcm = dcm_from_rotation_vector(rng.uniform(-np.pi, np.pi, 3))
    noise = rng.uniform(0.5, 2, count)
    stars = [oracle.square_field(rng, int(rng.integers(1, 9)), np.radians(60)) for _ in range(count)]
    catalogue = [b @ s.T @ dcm for s, b in zip(mountings, stars, strict=True)]
    informations = [ln.star_tracker.star_information(b, s) for b, s in zip(stars, noise, strict=True)]
    fused = ln.star_tracker.fused_information(informations, mountings)
    numerical = oracle.loss_hessian(mountings, stars, catalogue, noise, dcm)
    assert np.abs(fused - numerical).max() < HESSIAN * np.abs(fused).max()


@given(sts.SEEDS)
def test_fused_covariance_is_that_of_all_stars_together(seed):
    """(17) = (14) = stacked rows."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 5))
    mountings = [dcm_from_rotation_vector(rng.uniform(-np.pi, np.pi, 3)) for _ in range(count)]
    stars = [oracle.square_field(rng, int(rng.integers(4, 20)), np.radians(20)) for _ in range(count)]
    noise = ARCSEC * rng.uniform(1, 10, count)
    each = [oracle.covariance_from_stars([np.eye(3)], [b], [s]) for b, s in zip(stars, noise, strict=True)]
    expected = oracle.covariance_from_stars(mountings, stars, noise)
    size = np.abs(expected).max()
    fused = ln.star_tracker.fused_covariance(each, mountings)
    from_stars = ln.star_tracker.fused_covariance_from_stars(mountings, stars, list(noise))
    assert np.abs(fused - expected).max() < SAME_COVARIANCE * size
    assert np.abs(from_stars - expected).max() < SAME_COVARIANCE * size


@given(trackers(least=1))
def test_fusion_never_hurts_about_the_same_physical_axis(tracker):
    """Property 2 as a matrix inequality: S P_n S' - P is positive semidefinite for every head."""
    covariances, mountings = tracker
    fused = ln.star_tracker.fused_covariance(covariances, mountings)
    for p, s in zip(covariances, mountings, strict=True):
        smallest = np.linalg.eigvalsh(s @ p @ s.T - fused)[0]
        assert smallest > -SAME_COVARIANCE * np.abs(p).max()


def test_axis_labels_may_not_be_compared():
    """Property 2 read by labels is false: both counterexamples."""
    along_x = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    fused = ln.star_tracker.fused_covariance([np.diag([3.0, 3, 24]) ** 2] * 3, [along_x] * 3)
    # A head's own sigma_x is 3".
    assert sigmas(fused)[0] > 13
    unequal = [np.diag([10.0, 10, 80]) ** 2, np.diag([1.0, 1, 8]) ** 2, np.diag([10.0, 10, 80]) ** 2]
    fused = ln.star_tracker.fused_covariance(unequal, ORTHOGONAL)
    # Head 2 has a sigma_x of 1".
    assert sigmas(fused)[0] == pytest.approx(5.30, abs=0.005)


@given(trackers(), sts.SEEDS)
def test_fused_ellipsoid_lies_between(tracker, seed):
    """Property 1, corrected: intersection / sqrt(N) <= fused <= intersection along every direction."""
    covariances, mountings = tracker
    directions = np.random.default_rng(seed).standard_normal((50, 3))
    ratio = ln.star_tracker.sandwich_ratio(covariances, mountings, directions)
    assert ratio.max() <= 1 + SAME_COVARIANCE
    assert ratio.min() >= 1 / np.sqrt(len(covariances)) - SAME_COVARIANCE


def test_the_lower_bound_is_attained_by_equal_aligned_heads():
    ratio = ln.star_tracker.sandwich_ratio([axisymmetric(3.0, 8.0)] * 3, [np.eye(3)] * 3, np.eye(3))
    assert np.abs(ratio * np.sqrt(3) - 1).max() < ROUNDING


@given(trackers(), sts.dcms())
def test_another_fusion_frame_keeps_trace_and_spectrum(tracker, turn):
    """Properties 4 and 5: tr P is invariant; the diagonal stays between the extreme eigenvalues (Schur)."""
    covariances, mountings = tracker
    fused = ln.star_tracker.fused_covariance(covariances, mountings)
    other = ln.star_tracker.fused_covariance(covariances, turn @ mountings)
    size = np.trace(fused)
    assert np.abs(other - turn @ fused @ turn.T).max() < SAME_COVARIANCE * size
    assert abs(np.trace(other) - size) < SAME_COVARIANCE * size
    values, diagonal = np.linalg.eigvalsh(fused), np.sort(np.diag(other))
    assert diagonal[0] >= values[0] - SAME_COVARIANCE * size
    assert diagonal[-1] <= values[-1] + SAME_COVARIANCE * size
    assert diagonal[:2].sum() >= values[:2].sum() - SAME_COVARIANCE * size


@given(trackers(least=1))
def test_parity_with_the_oracle(tracker):
    covariances, mountings = tracker
    fused = ln.star_tracker.fused_covariance(covariances, mountings)
    assert np.abs(fused - oracle.fused_covariance(covariances, mountings)).max() < 1e-9 * np.abs(fused).max()


@given(trackers())
def test_projection_and_intercept(tracker):
    """w(u) >= r(u), equal along the principal axes; the surface's points lie on the ellipsoid."""
    fused = ln.star_tracker.fused_covariance(*tracker)
    values, axes = np.linalg.eigh(fused)
    assert ln.star_tracker.half_width(fused, axes.T) == pytest.approx(np.sqrt(values), rel=1e-6)
    assert ln.star_tracker.intercept(fused, axes.T) == pytest.approx(np.sqrt(values), rel=1e-6)
    directions = np.random.default_rng(3).standard_normal((40, 3))
    points = ln.star_tracker.ellipsoid_points(fused, directions)
    assert np.einsum("ni,ij,nj->n", points, np.linalg.inv(fused), points) == pytest.approx(1, rel=1e-6)
    # The support function is the greatest projection of any point.
    widths = ln.star_tracker.half_width(fused, directions)
    assert (widths >= ln.star_tracker.intercept(fused, directions) * (1 - 1e-9)).all()
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    assert ((points @ unit.T).max(axis=0) <= widths * (1 + 1e-9)).all()


def test_field_ratios_of_the_publication():
    """k of square fields of 10, 16, 20 and 24 degrees; the scenario's head: 2.5" and 17.5"."""
    ratios = [ln.star_tracker.boresight_ratio(np.radians(fov)) for fov in (10, 16, 20, 24)]
    assert [round(k, 1) for k in ratios] == [14.0, 8.8, 7.0, 5.8]
    head = ln.star_tracker.head_covariance(np.radians(20), 8, 7.03)
    assert sigmas(head).round(1).tolist() == [2.5, 2.5, 17.5]


def test_field_ratio_of_a_round_field():
    """Uniform on a disc of radius tan(h): E[bx^2 + by^2] = 1 - log(1 + t^2) / t^2."""
    for fov in (0.1, 0.5, 1.0, 2.0):
        t2 = np.tan(fov / 2) ** 2
        across = 1 - np.log1p(t2) / t2
        expected = np.sqrt((1 - across / 2) / across)
        assert ln.star_tracker.boresight_ratio(fov, "circle") == pytest.approx(expected, rel=1e-12)


def test_mean_information_is_the_mean_over_random_fields(rng):
    head = ln.star_tracker.Head.looking([0, 0, 1], fov=np.radians(24), noise=2.0)
    for shape in ("square", "circle"):
        stars = head.stars(40_000, rng, shape)
        expected = np.linalg.inv(head.covariance(40_000, shape))
        assert np.abs(head.information(stars) - expected).max() < 0.01 * expected.max()
        # sum over both axes across a boresight, 1 % of 40 000 samples
        assert head.information(stars)[2, 2] == pytest.approx(expected[2, 2], rel=0.02)


@given(trackers())
def test_mounting_sensitivities_add_up_to_one(tracker):
    """If all mountings turn together, so does the answer."""
    gains = ln.star_tracker.mounting_sensitivity(*tracker)
    assert np.abs(gains.sum(axis=0) - np.eye(3)).max() < 1e-8


def test_mounting_errors_of_orthogonal_heads():
    """5" across the boresight of one head gives 2.5", about it 0.05"."""
    heads = [axisymmetric(2.5, 7.01)] * 3
    errors = np.zeros((2, 3, 3))
    errors[0, 0, 0], errors[1, 0, 2] = 5, 5
    bias = ln.star_tracker.mounting_bias(heads, ORTHOGONAL, errors)
    assert np.linalg.norm(bias, axis=-1).round(2).tolist() == [2.47, 0.05]


def test_mounting_bias_is_what_the_solver_does(rng):
    """(M1) against the attitude solved with wrong mountings."""
    dcm = dcm_from_rotation_vector(rng.standard_normal(3))
    stars = [oracle.square_field(rng, 8, np.radians(20)) for _ in range(3)]
    noise = [7 * ARCSEC] * 3
    mu = ARCSEC * rng.uniform(-10, 10, (3, 3))
    true = [dcm_from_rotation_vector(m) @ s for m, s in zip(mu, ORTHOGONAL, strict=True)]
    catalogue = [b @ s.T @ dcm for s, b in zip(true, stars, strict=True)]
    solved = oracle.svd_attitude(ORTHOGONAL, stars, catalogue, noise)
    covariances = [oracle.covariance_from_stars([np.eye(3)], [b], [7 * ARCSEC]) for b in stars]
    bias = ln.star_tracker.mounting_bias(covariances, ORTHOGONAL, mu)
    error = ln.attitude.rotation_error(dcm, solved)
    # The sign of an error's sense: true minus estimate is what the wrong mounting lacks.
    assert np.abs(error - bias).max() < 1e-3 * np.abs(bias).max()


def test_uncertain_mountings_add_to_the_covariance():
    """(M2) is the covariance of (M1) plus (17)."""
    heads = [axisymmetric(2.5, 7.0)] * 3
    spread = np.stack([np.zeros((3, 3)), np.diag([1.0, 4, 9]), np.diag([4.0, 1, 1])])
    gains = ln.star_tracker.mounting_sensitivity(heads, ORTHOGONAL)
    expected = ln.star_tracker.fused_covariance(heads, ORTHOGONAL)
    for g, c in zip(gains, spread, strict=True):
        expected = expected + g @ c @ g.T
    total = ln.star_tracker.consider_covariance(heads, ORTHOGONAL, spread)
    assert np.abs(total - expected).max() < SAME_FORMULA * expected.max()


@given(trackers(), sts.SEEDS)
def test_uncertain_mountings_of_any_tracker(tracker, seed):
    """(T2) by sigma points: the outer products of (T1) for the columns of the roots of all C_n."""
    covariances, mountings = tracker
    roots = ARCSEC * np.random.default_rng(seed).standard_normal((len(mountings), 3, 3))
    expected = ln.star_tracker.fused_covariance(covariances, mountings)
    for n, root in enumerate(roots):
        for column in root.T:
            errors = np.zeros((len(mountings), 3))
            errors[n] = column
            bias = ln.star_tracker.mounting_bias(covariances, mountings, errors)
            expected = expected + np.outer(bias, bias)
    spread = roots @ roots.transpose(0, 2, 1)
    total = ln.star_tracker.consider_covariance(covariances, mountings, spread)
    assert np.abs(total - expected).max() < SAME_COVARIANCE * np.abs(expected).max()


def test_gains_of_the_claims():
    """Cross-axis gain of three orthogonal heads: 29.3 % to 30.4 %; about the boresight a factor 9.95."""
    for k, across in ((7.0, 29.65), (5.0, 30.0), (4.0, 30.4), (1e6, 29.3)):
        fused = sigmas(ln.star_tracker.fused_covariance([axisymmetric(1.0, k)] * 3, ORTHOGONAL))
        assert 100 * (1 - fused[0]) == pytest.approx(across, abs=0.05)
        assert fused[2] / k == pytest.approx(1 / np.sqrt(2 * k**2 + 1), rel=1e-12)
    fused = sigmas(ln.star_tracker.fused_covariance([axisymmetric(1.0, 7.0)] * 3, ORTHOGONAL))
    assert 7 / fused[2] == pytest.approx(9.95, abs=0.005)


def test_one_star_in_each_head_is_enough():
    """5" about every axis from three single stars of 7.03"; with two heads 7", 5", 7"."""
    star = [[0.0, 0.0, 1.0]]
    three = ln.star_tracker.fused_covariance_from_stars(ORTHOGONAL, [star] * 3, 7.03)
    assert sigmas(three).round(1).tolist() == [5.0, 5.0, 5.0]
    two = ln.star_tracker.fused_covariance_from_stars(ORTHOGONAL, [star, star, np.empty((0, 3))], 7.03)
    assert np.sort(sigmas(two)).round(1).tolist() == [5.0, 7.0, 7.0]
    one_blind = [np.array([star, star]), np.array([star, [[0, 0, -1]]]), np.empty((2, 0, 3))]
    one_blind[1][1] = ORTHOGONAL[1].T @ ORTHOGONAL[0] @ star[0]
    batch = ln.star_tracker.fused_covariance_from_stars(ORTHOGONAL, one_blind, 7.03, on_error="nan")
    assert np.abs(batch[0] - two).max() < ROUNDING * two.max()
    assert np.isnan(batch[1]).all()
    with pytest.raises(ln.UnobservableError, match=r"rotation about fusion axis \[.*1\.000\] is free"):
        ln.star_tracker.fused_covariance_from_stars(ORTHOGONAL, [star, *[np.empty((0, 3))] * 2], 7.03)

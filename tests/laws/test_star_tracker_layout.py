"""Where heads should look and which stars to keep: bounds, closed forms, exhaustive search, clocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from tests import strategies as sts
from tests.conftest import ROUNDING, SAME_FORMULA
from tests.oracle import star_tracker as oracle
from tests.oracle.attitude import dcm_from_rotation_vector

K = 7.0
MEASURES = {
    "trace": np.trace,
    "determinant": np.linalg.det,
    "worst": lambda p: np.linalg.eigvalsh(p)[-1],
}


def fused(boresights, sigma=1.0, ratio=K):
    heads = np.broadcast_to(np.asarray(sigma)[..., None], (len(boresights), 1)) * [1, 1, ratio]
    mountings = [oracle.turned(z) for z in boresights]
    return oracle.fused_covariance([np.diag(s) ** 2 for s in heads], mountings)


@pytest.mark.parametrize("count", range(3, 13))
def test_tight_frames(count):
    z = ln.star_tracker.tight_frame(count)
    assert np.linalg.norm(z, axis=1) == pytest.approx(1, abs=ROUNDING)
    assert np.abs(z.T @ z - count / 3 * np.eye(3)).max() < SAME_FORMULA
    assert np.diff(np.linalg.eigvalsh(fused(z))).max() < SAME_FORMULA


def test_regular_frames():
    """Right angles for two and three; a tetrahedron; the diagonals of an icosahedron, 63.43 degrees apart."""
    for count in (2, 3):
        assert np.array_equal(gram(count), np.eye(count))
    assert gram(4)[np.triu_indices(4, 1)] == pytest.approx(-1 / 3)
    assert np.abs(gram(6)[np.triu_indices(6, 1)]) == pytest.approx(1 / np.sqrt(5))


def gram(count):
    z = ln.star_tracker.tight_frame(count)
    return z @ z.T


@pytest.mark.parametrize("criterion", MEASURES)
@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_no_layout_beats_the_optimal_one(count, criterion, rng):
    """Two thousand random layouts, and the closed form found again by the search for all but equal heads."""
    best = ln.star_tracker.optimal_layout(count, sigma=2.0, ratio=K, criterion=criterion)
    measure = MEASURES[criterion]
    assert best.value == pytest.approx(measure(fused(best.boresights, 2.0)), rel=1e-9)
    z = rng.standard_normal((2000, count, 3))
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    heads = [np.diag([2.0, 2, 2 * K]) ** 2] * count
    mountings = np.array([[oracle.turned(v) for v in one] for one in z[:200]])
    values = [measure(p) for p in ln.star_tracker.fused_covariance([heads] * 200, mountings)]
    assert min(values) >= best.value * (1 - 1e-12)
    assert best.bound <= best.value * (1 + 1e-12)
    if count > 2:
        assert best.efficiency == pytest.approx(1, abs=1e-12)
    almost = ln.star_tracker.optimal_layout(
        count, sigma=2.0, ratio=K + 1e-9 * np.arange(count), criterion=criterion
    )
    assert almost.value == pytest.approx(best.value, rel=1e-6)


def test_four_heads_are_better_as_a_tetrahedron():
    """6.95 against 7.19 arcsec^2 for three at right angles and one beside the first (s = 2.5", k = 7.01)."""
    k = ln.star_tracker.boresight_ratio(np.radians(20))
    tetrahedron = ln.star_tracker.optimal_layout(4, sigma=2.5, ratio=k)
    beside = fused([*np.eye(3), [0, 0, 1]], 2.5, k)
    # The published s is rounded to 2.5".
    assert tetrahedron.value == pytest.approx(6.95, abs=0.02)
    assert np.trace(beside) == pytest.approx(7.19, abs=0.02)


@pytest.mark.parametrize("sigma", [[3, 4, 5], [1, 1, 8], [1, 10, 10], [2, 3, 3]])
def test_three_unequal_heads_belong_at_right_angles(sigma):
    layout = ln.star_tracker.optimal_layout(3, sigma=sigma, ratio=8.0)
    assert np.abs(layout.boresights @ layout.boresights.T - np.eye(3)).max() < 1e-5
    assert layout.value == pytest.approx(np.trace(fused(np.eye(3), sigma, 8.0)), rel=1e-9)


def test_cones_are_kept_clear(rng):
    """Sun and Earth: every boresight outside, and no random allowed layout is better."""
    earth, sun = np.array([0.0, 0, -1]), np.array([0.8, 0, 0.6])
    cones = [(earth, np.radians(120)), (sun, np.radians(40))]
    layout = ln.star_tracker.optimal_layout(3, ratio=K, exclusions=cones)
    for axis, half in cones:
        angles = np.degrees(np.arccos(layout.boresights @ axis))
        assert (angles >= np.degrees(half) - 1e-6).all()
    assert (layout.clearance >= -1e-9).all()
    assert layout.efficiency < 1
    z = rng.standard_normal((400_000, 3))
    z /= np.linalg.norm(z, axis=-1, keepdims=True)
    z = z[(z @ earth <= np.cos(cones[0][1])) & (z @ sun <= np.cos(cones[1][1]))]
    z = z[: len(z) // 3 * 3].reshape(-1, 3, 3)
    information = 3 * np.eye(3) - (1 - K**-2) * np.einsum("ani,anj->aij", z, z)
    assert np.trace(np.linalg.inv(information), axis1=1, axis2=2).min() >= layout.value


def test_a_cap_alone():
    """Allowed: within 30 degrees of z. Evenly around its edge is the widest there is."""
    layout = ln.star_tracker.optimal_layout(3, ratio=K, exclusions=[([0, 0, -1], np.radians(150))])
    turn = 2 * np.pi * np.arange(3) / 3
    edge = np.column_stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), np.full(3, np.sqrt(0.75))])
    assert layout.value == pytest.approx(np.trace(fused(edge)), rel=1e-6)


def test_cones_that_leave_nothing():
    with pytest.raises(ln.DegenerateGeometryError, match="exclusions"):
        ln.star_tracker.optimal_layout(2, exclusions=[([0, 0, 1], 2.0), ([0, 0, -1], 2.0)])


def field(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(6, 11))
    stars = oracle.square_field(rng, count, np.radians(rng.choice([10, 20, 60])))
    if rng.integers(2):
        stars[::3] = stars[::3][:, [1, 2, 0]]
    return stars, rng.uniform(1, 3, count), int(rng.integers(2, 6))


@given(sts.SEEDS, st.sampled_from(sorted(MEASURES)))
def test_exhaustive_selection_is_the_oracles(seed, criterion):
    stars, sigma, count = field(seed)
    subset, best = oracle.best_subset(stars, sigma, count, MEASURES[criterion])
    chosen = ln.star_tracker.select_stars(stars, count, sigma=sigma, criterion=criterion, method="exhaustive")
    assert tuple(chosen) == subset or value(stars, sigma, chosen, criterion) == pytest.approx(best, rel=1e-9)


def value(stars, sigma, chosen, criterion):
    turns = np.repeat(np.eye(3)[None], len(chosen), axis=0)
    return MEASURES[criterion](oracle.covariance_from_stars(turns, stars[chosen, None], sigma[chosen]))


def test_exchange_nearly_always_finds_the_best():
    """Over 300 fields: exchange exact in 98 %, never 10 % worse; greedy exact in 80 %, and never better."""
    ratios = {"greedy": [], "exchange": []}
    for seed in range(300):
        stars, sigma, count = field(seed)
        criterion = sorted(MEASURES)[seed % 3]
        options = {"sigma": sigma, "criterion": criterion}
        best = ln.star_tracker.select_stars(stars, count, method="exhaustive", **options)
        for method, found in ratios.items():
            chosen = ln.star_tracker.select_stars(stars, count, method=method, **options)
            assert len(set(chosen)) == count
            found.append(value(stars, sigma, chosen, criterion) / value(stars, sigma, best, criterion))
    greedy, exchange = np.array(ratios["greedy"]), np.array(ratios["exchange"])
    assert (exchange <= greedy * (1 + 1e-9)).all()
    assert (exchange < 1 + 1e-9).mean() >= 0.98
    assert exchange.max() < 1.1
    assert (greedy < 1 + 1e-9).mean() >= 0.8


def test_what_is_known_already_changes_the_choice():
    """With the roll known from elsewhere, precise stars near the axis win over rough ones at the corners."""
    plane = np.vstack([0.01 * np.ones((3, 2)), [[1, 1], [-1, -1], [1, -1]]]) * 0.17
    stars = np.column_stack([plane, np.ones(6)])
    stars /= np.linalg.norm(stars, axis=1, keepdims=True)
    sigma = np.array([1.0, 1, 1, 2, 2, 2])
    assert set(ln.star_tracker.select_stars(stars, 3, sigma=sigma)) & {3, 4, 5}
    known = ln.star_tracker.select_stars(stars, 3, sigma=sigma, information=np.diag([0, 0, 1e6]))
    assert known.tolist() == [0, 1, 2]


def test_heads_exposed_at_different_moments(rng):
    """1 deg/s and 50 ms: 180 arcseconds of error, none after the heads are brought to one epoch."""
    heads = [ln.star_tracker.Head.looking(z) for z in np.eye(3)]
    rate = np.radians([0.6, -0.64, 0.48])
    assert np.degrees(np.linalg.norm(rate)) == pytest.approx(1.0)
    dcm = dcm_from_rotation_vector(rng.standard_normal(3))
    stars = [oracle.square_field(rng, 8, np.radians(20)) for _ in heads]
    catalogue = [b @ h.mounting.T @ dcm for b, h in zip(stars, heads, strict=True)]
    times = [0.0, 0.05, np.linspace(0.0, 0.05, 8)]
    seen = []
    for h, r, t in zip(heads, catalogue, times, strict=True):
        stamps = np.broadcast_to(t, 8)
        seen.append(
            np.array(
                [
                    h.mounting.T @ dcm_from_rotation_vector(rate * s) @ dcm @ v
                    for v, s in zip(r, stamps, strict=True)
                ]
            )
        )
    corrected = ln.star_tracker.to_epoch(heads, seen, times, rate)
    for found, true in zip(corrected, stars, strict=True):
        assert np.abs(found - true).max() < 1e-15
    # The rates turn each head by 180 arcseconds; less across their own direction for single stars.
    alone = oracle.svd_attitude([heads[1].mounting], [seen[1]], [catalogue[1]], [1.0])
    error = np.linalg.norm(ln.attitude.rotation_error(dcm, alone)) / oracle.ARCSEC
    assert error == pytest.approx(180, abs=1e-3)


def test_an_uncertain_rate_widens_the_covariance(rng):
    """The spread of heads propagated with a noisy gyro is what epoch_covariance adds."""
    head = ln.star_tracker.Head.looking([1, 2, 3])
    spread = np.diag([1.0, 4.0, 9.0]) * 1e-12
    dt, runs = 0.2, 20_000
    rates = rng.multivariate_normal(np.zeros(3), spread * 1e12, runs) * 1e-6
    turns = dt * rates @ head.mounting
    predicted = ln.star_tracker.epoch_covariance(head, np.zeros((3, 3)), dt, spread)
    white = turns @ np.linalg.inv(np.linalg.cholesky(predicted)).T
    assert np.abs(white.T @ white / runs - np.eye(3)).max() < 4.5 * np.sqrt(2 / runs)

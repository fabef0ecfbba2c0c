"""The doorway of losnav.observability: units, batches, noise, solutions, and any matrix at all."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from losnav.observability import Diagnosis, analyze, degree, of_pose_solution
from tests import strategies as sts
from tests.oracle import los as oracle_los
from tests.oracle import observability as oracle
from tests.oracle import scenario
from tests.oracle.attitude import dcm_from_mrp

RING = scenario.LANDMARKS
MRP = scenario.MRP_0
FIELDS = (
    "rank",
    "singular_values",
    "degree",
    "directions",
    "noise",
    "danger_cylinder_distance",
    "null_twist",
)
# Singular values from the information matrix instead of its root: half the digits, of the largest.
FROM_SQUARE = 1e-7
# Singular values by two decompositions of matrices equal to rounding.
SAME_SPECTRUM = 1e-13


def same(a, b):
    """Bit for bit."""
    equal = [np.array_equal(getattr(a, f), getattr(b, f), equal_nan=True) for f in FIELDS]
    return all(equal) and np.array_equal(a.diagnosis, b.diagnosis)


# --- a pose ------------------------------------------------------------


@given(sts.scenes(minimum=3, max_depth=30), sts.short_mrps())
def test_attitude_does_not_matter(scene, mrp):
    a = ln.pose_observability(scene.landmarks, scene.position)
    b = ln.pose_observability(scene.landmarks, scene.position, mrp)
    assert np.allclose(
        a.singular_values, b.singular_values, rtol=0, atol=SAME_SPECTRUM * a.singular_values[0]
    )
    assert a.rank == b.rank
    assert a.diagnosis is b.diagnosis
    # The weakest rotation is the same, named in body axes.
    if a.singular_values[-2] > 1.1 * a.singular_values[-1]:
        turned = np.concatenate([b.weakest[:3], dcm_from_mrp(mrp).T @ b.weakest[3:]])
        assert abs(abs(turned @ a.weakest) / (a.weakest @ a.weakest) - 1) < 1e-6


@given(sts.scenes(minimum=3, max_depth=30), st.floats(-6, 6))
def test_units_do_not_matter(scene, exponent):
    unit = 10.0**exponent
    a = ln.pose_observability(scene.landmarks, scene.position, scene.mrp)
    b = ln.pose_observability(scene.landmarks * unit, scene.position * unit, scene.mrp)
    # Scaled coordinates round anew, and a large offset is taken off before anything is computed.
    offset = np.abs(scene.position).max() / np.linalg.norm(scene.landmarks - scene.position, axis=1).min()
    tolerance = 100 * SAME_SPECTRUM * max(offset, 1.0) * a.singular_values[0]
    assert np.allclose(a.singular_values, b.singular_values, rtol=0, atol=tolerance)
    assert a.rank == b.rank
    size = np.linalg.norm(scene.landmarks - scene.position, axis=1).max() * max(offset, 1.0)
    expected = a.danger_cylinder_distance
    assert b.danger_cylinder_distance / unit == pytest.approx(expected, rel=1e-6, abs=1e-9 * size)


def test_kilometres():
    """A coarse ring seen from afar, in metres and in kilometres."""
    a = ln.pose_observability(RING, [-50, 50, 500], sigma=2e-5)
    b = ln.pose_observability(RING / 1e3, [-0.05, 0.05, 0.5], sigma=2e-5)
    assert np.allclose(a.singular_values, b.singular_values, rtol=1e-12)
    assert b.danger_cylinder_distance == pytest.approx(a.danger_cylinder_distance / 1e3)
    assert b.weakest_sigma[:3] == pytest.approx(a.weakest_sigma[:3] / 1e3)
    assert b.weakest_sigma[3:] == pytest.approx(a.weakest_sigma[3:])


@given(sts.scenes(minimum=3, max_depth=30), st.floats(0.1, 10.0))
def test_noise_of_every_landmark(scene, ratio):
    """Whitened rows against the oracle's, normalised to the mean information."""
    rng = np.random.default_rng(scene.seed)
    sigma = scene.sigma * ratio ** rng.uniform(-1, 1, scene.count)
    found = ln.pose_observability(scene.landmarks, scene.position, scene.mrp, sigma)
    rows = oracle.scaled_jacobian(scene.landmarks, scene.position, scene.mrp) / np.repeat(sigma, 3)[:, None]
    noise = 1 / np.sqrt(np.mean(sigma**-2.0))
    expected = noise * np.linalg.svd(rows, compute_uv=False)
    assert found.noise == pytest.approx(noise, rel=1e-12)
    assert np.allclose(found.singular_values, expected, rtol=0, atol=SAME_SPECTRUM * 10 * expected[0])


@given(sts.scenes(minimum=4, max_depth=10))
def test_covariances_and_the_fisher_information(scene):
    """One standard deviation of the weakest direction is the largest of the inverse Fisher information."""
    b = scene.los
    covariance = np.array([oracle_los.tangent_covariance(x, scene.sigma) for x in b])
    covariance += 0.5 * scene.sigma**2 * np.eye(3)
    found = ln.pose_observability(scene.landmarks, scene.position, scene.mrp, covariance=covariance)
    information = ln.fisher_information(scene.landmarks, scene.position, scene.mrp, covariance=covariance)
    scaled = information * np.outer(found.scale, found.scale)
    variances = 1 / np.linalg.eigvalsh(scaled)[0]
    size = np.linalg.norm(found.weakest_sigma / found.scale)
    assert size == pytest.approx(np.sqrt(variances), rel=1e-5)


def positions():
    """Six cameras, one of them on the danger cylinder of the first three landmarks."""
    centre, radius, _ = oracle.circumscribed_circle(*RING[:3])
    generic = np.array([[3.0, -2, 40], [-50, 50, 500], [0, 0, 1], [70, 20, 0], [9, 9, 99]])
    return np.vstack([generic, centre + radius * np.array([0.6, 0.8, 0]) + [0, 0, 40]]).reshape(2, 3, 3)


@pytest.mark.parametrize("count", [1, 2, 3, 4])
@pytest.mark.parametrize("own", [False, True])
def test_a_batch_is_its_members(count, own):
    where = positions()
    landmarks = np.broadcast_to(RING[:count], (2, 3, count, 3)) if own else RING[:count]
    whole = ln.pose_observability(landmarks, where, MRP, 1e-4)
    assert whole.shape == whole.rank.shape == whole.degree.shape == whole.diagnosis.shape == (2, 3)
    assert whole.singular_values.shape == (2, 3, 6)
    assert whole.unobservable.shape == (2, 3)
    for index in np.ndindex(2, 3):
        single = ln.pose_observability(RING[:count], where[index], MRP, 1e-4)
        assert same(whole[index], single)
        assert str(whole[index]) == str(single)
        assert whole.weakest_in_words[index] == single.weakest_in_words
        assert whole.explanation[index] == single.explanation
        assert np.array_equal(whole.unobservable[index], single.unobservable)
    assert same(whole[1], ln.pose_observability(RING[:count], where[1], MRP, 1e-4))


def test_types_of_one_problem():
    found = ln.pose_observability(RING, [3, -2, 40])
    assert isinstance(found.rank, int)
    assert isinstance(found.degree, float)
    assert isinstance(found.danger_cylinder_distance, float)
    assert found.diagnosis is Diagnosis.GENERIC
    assert found.diagnosis == "generic"
    assert pickle.loads(pickle.dumps(found)).diagnosis is Diagnosis.GENERIC


@pytest.mark.parametrize("shape", [(0,), (2, 0)])
def test_no_problems(shape):
    found = ln.pose_observability(RING, np.zeros((*shape, 3)))
    assert found.rank.shape == shape
    assert "no problems" in str(found)


def test_broadcasting_of_positions_noises_and_landmarks():
    sigma = np.full((5, 1, 4), 1e-4) * np.arange(1, 6)[:, None, None]
    found = ln.pose_observability(RING, np.full((7, 3), [3, -2, 40.0]), MRP, sigma)
    assert found.shape == (5, 7)
    assert np.allclose(found.noise, np.arange(1, 6)[:, None] * 1e-4)
    assert np.allclose(found.singular_values, found.singular_values[0, 0])


# --- a solution ------------------------------------------------------------


@given(sts.scenes(minimum=4, max_depth=20))
def test_solution_and_geometry_agree(scene):
    guess = np.concatenate([scene.position, scene.mrp])
    solution = ln.solve_pose(scene.landmarks, scene.los, sigma=scene.sigma, guess=guess)
    found = solution.observability
    direct = ln.pose_observability(scene.landmarks, solution.position, solution.mrp, scene.sigma)
    assert np.allclose(
        found.singular_values, direct.singular_values, rtol=0, atol=FROM_SQUARE * direct.singular_values[0]
    )
    assert found.noise == pytest.approx(scene.sigma, rel=1e-9)
    assert found.rank == direct.rank
    assert found.diagnosis is direct.diagnosis
    assert found.danger_cylinder_distance == pytest.approx(direct.danger_cylinder_distance, nan_ok=True)


def solution_at(landmarks, position, sigma, inliers=None):
    """What a solver hands over, made from the oracle: batches, members without an answer, wrong landmarks."""
    shape, dcm = position.shape[:-1], dcm_from_mrp(MRP)
    information = np.full((*shape, 6, 6), np.nan)
    for index in np.ndindex(shape):
        kept = landmarks if inliers is None else landmarks[inliers[index]]
        weights = oracle_los.isotropic_weights(sigma, len(kept))
        found = oracle_los.fisher_information(kept, position[index], MRP, weights)
        body = np.kron(np.diag([1.0, 0]), dcm) + np.kron(np.diag([0, 1.0]), np.eye(3))
        information[index] = body @ found @ body.T
    return SimpleNamespace(
        position=position,
        mrp=np.where(np.isfinite(position), MRP, np.nan),
        dcm=np.where(np.isfinite(position)[..., np.newaxis], dcm, np.nan),
        inliers=inliers,
        _body_information=information,
        _landmarks=landmarks,
    )


def test_solutions_of_a_batch():
    """An invalid member has no rank and says so; the others are as if alone."""
    where = positions()
    where[0, 1] = np.nan
    found = of_pose_solution(solution_at(RING, where, 1e-4))
    assert found.rank.tolist() == [[6, 0, 6], [6, 6, 6]]
    assert found.diagnosis[0].tolist() == ["generic", "invalid problem", "generic"]
    assert np.isnan(found.degree[0, 1])
    assert "invalid" in str(found[0, 1])
    assert "rank 6 in 5, 0 in 1" in str(found)
    for index in [(0, 0), (0, 2), (1, 0), (1, 1), (1, 2)]:
        direct = ln.pose_observability(RING, where[index], MRP, 1e-4)
        tolerance = FROM_SQUARE * direct.singular_values[0]
        assert np.allclose(found.singular_values[index], direct.singular_values, rtol=0, atol=tolerance)
        assert found.noise[index] == pytest.approx(1e-4)
        assert str(found[index]) == str(direct)


def test_a_singular_solution_is_named():
    """The information matrix resolves enough to find the danger cylinder."""
    found = of_pose_solution(solution_at(RING[:3], positions()[1, 2], 1e-4))
    assert found.rank == 5
    assert found.diagnosis is Diagnosis.DANGER_CYLINDER


def test_only_inliers_count(rng):
    """Wrong landmarks carry no information, so they have no part in the geometry."""
    landmarks = np.vstack([RING, rng.uniform(-30, 30, (3, 3))])
    inliers = np.ones((2, 3, 7), dtype=bool)
    inliers[0, :, 4:] = False
    inliers[1, :, 3:] = False
    found = of_pose_solution(solution_at(landmarks, positions(), 1e-4, inliers))
    assert found.diagnosis[1, 2] is Diagnosis.DANGER_CYLINDER
    for index in np.ndindex(2, 3):
        direct = ln.pose_observability(landmarks[inliers[index]], positions()[index], MRP, 1e-4)
        tolerance = FROM_SQUARE * direct.singular_values[0]
        assert np.allclose(found.singular_values[index], direct.singular_values, rtol=0, atol=tolerance)
        assert found.rank[index] == direct.rank
        assert found.diagnosis[index] is direct.diagnosis
        assert found.noise[index] == pytest.approx(1e-4)
        distance = direct.danger_cylinder_distance
        assert found.danger_cylinder_distance[index] == pytest.approx(distance, abs=1e-12)


def test_unit_noise_is_no_noise():
    los = ln.predict_los(RING, [-50, 50, 500], MRP)
    guess = np.array([-50, 50, 500, *MRP])
    assert "1 mrad of noise" in str(ln.solve_pose(RING, los, guess=guess).observability)
    assert "mrad" not in str(ln.solve_pose(RING, los, sigma=2e-5, guess=guess).observability)


# --- any matrix ------------------------------------------------------------


@given(
    st.integers(1, 9), st.integers(1, 6), st.integers(0, 6), st.sampled_from([(), (3,), (2, 2)]), sts.SEEDS
)
def test_analyze(rows, columns, rank, batch, seed):
    rng = np.random.default_rng(seed)
    rank = min(rank, rows, columns)
    left, right = rng.standard_normal((*batch, rows, rank)), rng.standard_normal((*batch, rank, columns))
    matrix = left @ right
    found = analyze(matrix, tolerance=1e-10)
    assert np.all(np.array(found.rank) == rank)
    assert found.singular_values.shape == (*batch, columns)
    assert np.allclose(found.degree, degree(matrix), rtol=0, atol=1e-14)
    expected = np.linalg.svd(matrix, compute_uv=False)
    short = min(rows, columns)
    size = 1e-13 * expected.max(initial=1.0)
    assert np.allclose(found.singular_values[..., :short], expected, rtol=0, atol=size)
    assert not found.singular_values[..., short:].any()
    for index in np.ndindex(batch):
        basis = found[index].unobservable
        assert basis.shape == (columns, columns - rank)
        assert np.allclose(
            matrix[index] @ basis, 0.0, rtol=0, atol=1e-12 * max(expected.max(initial=1.0), 1.0)
        )
        assert np.allclose(basis.T @ basis, np.eye(columns - rank), rtol=0, atol=1e-13)
    assert len(str(found)) > 5


def test_scale_makes_units_harmless():
    rng = np.random.default_rng(5)
    matrix = rng.standard_normal((12, 4))
    matrix[:, 3] = matrix[:, 0] - 2 * matrix[:, 1]
    units = np.array([1e6, 1.0, 1e-3, 1e3])
    plain = analyze(matrix, tolerance=1e-10)
    scaled = analyze(matrix / units, scale=units, tolerance=1e-10)
    assert scaled.rank == plain.rank == 3
    assert scaled.degree == pytest.approx(plain.degree, abs=1e-14)
    assert np.allclose(scaled.singular_values, plain.singular_values)
    # In the state's own units: the matrix as given does not see it.
    null = scaled.unobservable[:, 0]
    assert np.allclose(null / units / (null / units)[3], [-1, 2, 0, 1])
    assert np.abs(matrix / units @ null).max() < 1e-12


def test_words_name_the_components():
    """Two clocks that only appear as their difference, and a component nobody sees."""
    matrix = np.array([[1.0, -1, 0, 0], [0, 0, 3, 0], [1, -1, 1, 0]])
    found = analyze(matrix, labels=["clock a", "clock b", "range", "bias"])
    assert str(found).splitlines() == [
        "rank 2 of 4",
        "unobservable: bias",
        "unobservable: clock a + clock b",
    ]
    assert "weakest: bias" in str(analyze(np.diag([3.0, 2, 1]), labels=["x", "y", "bias"]))


def test_degree():
    assert degree(np.diag([4.0, 1.0])) == 0.25
    assert degree(np.zeros((3, 2))) == 0.0
    assert degree([[1.0, 2.0]]) == 0.0
    assert isinstance(degree(np.eye(3)), float)
    assert degree(np.stack([np.eye(3), np.diag([1.0, 2, 4])])).tolist() == [1.0, 0.25]


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"matrix": [[1.0, np.nan]]}, "matrix"),
        ({"matrix": [1.0, 2.0]}, "matrix"),
        ({"matrix": np.zeros((3, 0))}, "matrix"),
        ({"matrix": "text"}, "matrix"),
        ({"labels": ["a"]}, "labels"),
        ({"scale": [1.0]}, "scale"),
        ({"scale": [1.0, 0.0]}, "scale"),
        ({"scale": [1.0, -1.0]}, "scale"),
        ({"scale": np.ones((2, 2))}, "scale"),
    ],
)
def test_bad_input_of_analyze(changes, word):
    with pytest.raises(ln.InvalidInputError, match=word):
        analyze(**{"matrix": np.eye(2), **changes})

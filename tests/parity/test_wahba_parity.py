"""``solve_attitude`` against the oracle: every method, every geometry."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from tests import strategies as sts
from tests.oracle import attitude, wahba

METHODS = ["quest", "q-method", "svd", "foam", "esoq2"]
# Directions over the sphere, weights within two decades: a condition number of order 100.
GENERAL_RAD = 1e-12
# Whatever the geometry, as long as the attitude is determined at all.
ANYWHERE_RAD = 1e-7
# A residual is known to 1e-16 rad, 1e-8 of the smallest sigma.
LOSS = 1e-7
# Sums of a few dozen terms of either sign, relative to the largest entry.
SUMS = 1e-12


def distance(a, b):
    return np.linalg.norm(attitude.rotation_error(np.asarray(a), np.asarray(b)))


@st.composite
def problems(draw, minimum=2, maximum=12):
    """Body and reference directions with noise, and sigma, in general position."""
    rng = np.random.default_rng(draw(sts.SEEDS))
    count = draw(st.integers(minimum, maximum))
    dcm = draw(sts.dcms())
    reference = wahba.directions(count, rng)
    # Two of them at right angles: general position, also where there are only two.
    reference[1] = np.cross(reference[0], reference[1])
    reference[1] /= np.linalg.norm(reference[1])
    sigma = 10 ** draw(st.floats(-8, -2)) * 10 ** rng.uniform(0, 1, count)
    return wahba.measure(reference, dcm, sigma, rng), reference, sigma


@pytest.mark.parametrize("method", METHODS)
@given(problem=problems())
def test_attitude(method, problem):
    body, reference, sigma = problem
    solution = ln.solve_attitude(body, reference, sigma=sigma, method=method)
    assert solution.converged
    assert distance(solution.dcm, wahba.solve_svd(body, reference, sigma)) < GENERAL_RAD
    assert solution.loss == pytest.approx(
        wahba.loss(solution.dcm, body, reference, sigma), rel=1e-6, abs=LOSS
    )
    assert solution.chi2 == 2 * solution.loss
    assert solution.dof == 2 * len(body) - 3


@given(problem=problems())
def test_information_and_covariance(problem):
    body, reference, sigma = problem
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    expected = wahba.information(reference @ solution.dcm.T, sigma)
    assert np.allclose(solution.information, expected, rtol=0, atol=SUMS * np.abs(expected).max())
    covariance = np.linalg.inv(expected)
    assert np.allclose(solution.covariance, covariance, rtol=0, atol=1e-9 * np.abs(covariance).max())


@given(problem=problems(), method=st.sampled_from(METHODS))
def test_representations_agree(problem, method):
    body, reference, sigma = problem
    solution = ln.solve_attitude(body, reference, sigma=sigma, method=method)
    assert np.allclose(solution.dcm, attitude.dcm_from_quaternion(solution.quaternion), rtol=0, atol=1e-15)
    assert np.allclose(solution.dcm, attitude.dcm_from_mrp(solution.mrp), rtol=0, atol=1e-14)
    assert solution.quaternion[3] >= 0
    assert np.linalg.norm(solution.mrp) <= 1 + 1e-15


@settings(max_examples=30)
@given(seed=sts.SEEDS, batch=st.sampled_from([(1,), (7,), (8,), (9,), (3, 5), (300,)]))
def test_a_batch_is_its_members(seed, batch):
    """Lanes of several problems: the same minimum to rounding, whichever lane, shared reference or not."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 20))
    reference = wahba.directions(count, rng)
    size = int(np.prod(batch))
    dcms = np.array([attitude.dcm_from_rotation_vector(3 * rng.uniform(-1, 1, 3)) for _ in range(size)])
    body = np.array([wahba.measure(reference, dcm, np.full(count, 1e-4), rng) for dcm in dcms])
    body = body.reshape((*batch, count, 3))
    for known in (reference, np.broadcast_to(reference, body.shape).copy()):
        found = ln.solve_attitude(body, known, sigma=1e-4)
        for index in np.ndindex(batch):
            single = ln.solve_attitude(body[index], reference, sigma=1e-4)
            assert distance(found.dcm[index], single.dcm) < GENERAL_RAD
            assert found.loss[index] == pytest.approx(single.loss, rel=1e-6, abs=LOSS)


@st.composite
def hard_problems(draw):
    """Any angle, half turns too; fields down to 1e-6 rad; weights over six decades; N = 2 and more.

    Width over spread stays above 1e-6: below 1e-7 the rank is, by definition, lost."""
    rng = np.random.default_rng(draw(sts.SEEDS))
    count = draw(st.integers(2, 30))
    decades = draw(st.floats(-6, 0))
    width, spread = 10**decades, min(3.0, 6.0 + decades)
    reference = wahba.directions(count, rng, width)
    # Two directions a field width apart: determined by a known margin.
    side = np.cross(reference[0], [0.6, 0.0, 0.8])
    reference[1] = reference[0] + width * side / np.linalg.norm(side)
    reference[1] /= np.linalg.norm(reference[1])
    dcm = attitude.dcm_from_rotation_vector(draw(sts.rotation_vectors()))
    sigma = width * 1e-9 * 10 ** rng.uniform(0, draw(st.floats(0, spread)), count)
    return dcm, wahba.measure(reference, dcm, sigma, rng), reference, sigma


@pytest.mark.parametrize("method", METHODS)
@given(problem=hard_problems())
@settings(max_examples=60)
def test_hard_geometries(method, problem):
    dcm, body, reference, sigma = problem
    solution = ln.solve_attitude(body, reference, sigma=sigma, method=method)
    assert solution.converged
    assert solution.rank == 3
    assert distance(solution.dcm, wahba.refine(dcm, body, reference, sigma)) < ANYWHERE_RAD


# --- rank-deficient ----------------------------------------------------------------------------------


@given(seed=sts.SEEDS, count=st.integers(1, 6), noise=st.sampled_from([0.0, 1e-9, 1e-3]))
def test_parallel_directions_leave_the_turn_about_them_free(seed, count, noise):
    rng = np.random.default_rng(seed)
    r = wahba.directions(1, rng)
    sign = rng.choice([-1.0, 1.0], count)
    reference = sign[:, None] * r
    dcm = attitude.dcm_from_rotation_vector(3 * rng.uniform(-1, 1, 3))
    body = wahba.measure(reference, dcm, np.full(count, noise), rng)
    solution = ln.solve_attitude(body, reference, sigma=1e-3)
    assert not solution.converged
    assert solution.rank == 2
    assert solution.dof == 2 * count - 2
    assert np.isnan(solution.covariance).all()
    assert np.isfinite(solution.information).all()
    # The axis is the common direction as the attitude predicts it: the null space of the information.
    predicted = solution.dcm @ reference[0]
    assert abs(abs(solution.free_axis @ predicted) - 1) < 1e-12
    assert "free" in str(solution)
    # No other member of the family is nearer to the identity.
    for angle in np.linspace(-3, 3, 13):
        other = attitude.dcm_from_rotation_vector(angle * solution.free_axis) @ solution.dcm
        assert np.trace(other) <= np.trace(solution.dcm) + 1e-9


def test_one_direction_is_the_shortest_rotation():
    solution = ln.solve_attitude([[0.0, 0.6, 0.8]], [[0.0, 0.0, 1.0]])
    assert np.allclose(solution.dcm @ [0, 0, 1.0], [0, 0.6, 0.8], rtol=0, atol=1e-15)
    assert np.allclose(np.trace(solution.dcm), 1 + 2 * 0.8, rtol=0, atol=1e-14)
    assert np.allclose(solution.free_axis, [0, 0.6, 0.8], rtol=0, atol=1e-15)


def test_contradicting_directions_are_not_a_solution():
    """A mirror image fits a whole family of attitudes equally badly."""
    for reference, rank in ((np.diag([1.0, 1, -1]), 1), (-np.eye(3), 1)):
        solution = ln.solve_attitude(np.eye(3), reference)
        assert not solution.converged
        assert solution.rank == rank
        assert "contradict" in str(solution)


# --- one exact direction -----------------------------------------------------------------------------


@given(problem=problems(minimum=2))
def test_an_exact_direction_is_met_exactly(problem):
    body, reference, sigma = problem
    sigma = sigma.copy()
    sigma[0] = 0.0
    solution = ln.solve_attitude(body, reference, sigma=sigma)
    assert solution.converged
    assert np.allclose(solution.dcm @ reference[0], body[0], rtol=0, atol=1e-15)
    # The limit of ever smaller sigma, and only the turn about the direction is uncertain.
    sigma[0] = 1e-6 * sigma[1:].min()
    near = ln.solve_attitude(body, reference, sigma=sigma)
    scale = np.sqrt(np.abs(near.covariance).max())
    assert distance(solution.dcm, near.dcm) < 1e-5 * scale + GENERAL_RAD
    assert np.allclose(solution.covariance, near.covariance, rtol=0, atol=1e-5 * scale**2)


LATTICE = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
LATTICE /= np.linalg.norm(LATTICE, axis=1, keepdims=True)


@pytest.mark.parametrize("method", METHODS)
def test_every_kind_of_degeneracy(method):
    """Random directions of a cube to random partners: repeated, opposite, mirrored, contradicting, coplanar.

    Loss and rank are those of the singular values s of B: the eigenvalues of the Hessian are s_i + s_j, the
    last s with the sign of det U det V."""
    rng = np.random.default_rng(METHODS.index(method))
    ranks = np.zeros(4, dtype=int)
    faces = LATTICE[np.abs(LATTICE).max(axis=1) == 1]
    for k in range(4000):
        count = rng.integers(1, 6)
        among = faces if k % 2 else LATTICE
        body, reference = among[rng.integers(len(among), size=(2, count))]
        solution = ln.solve_attitude(body, reference, method=method)
        u, s, vt = np.linalg.svd(body.T @ reference)
        s[2] *= np.linalg.det(u) * np.linalg.det(vt)
        curvature = np.array([s[1] + s[2], s[0] + s[2], s[0] + s[1]])
        assert solution.loss == pytest.approx(count - s.sum(), abs=1e-12)
        assert solution.rank == (curvature > 1e-9).sum()
        assert solution.converged == (solution.rank == 3)
        ranks[solution.rank] += 1
    # The rarest are the contradictions.
    assert (ranks > 4).all()

"""Broadcasting of every function over leading dimensions, empty ones included."""

import numpy as np
import pytest

import losnav as ln
from tests.api.calls import BODY, COVARIANCE, DCM, GUESS, LANDMARKS, LOS, MRP, POSITION, REFERENCE, SIGMA

N = len(LANDMARKS)
BATCHES = [(), (1,), (5,), (2, 3), (0,), (2, 0, 3), (17,)]
CONVERSIONS = {
    "dcm_from_mrp": ((3,), (3, 3)),
    "mrp_from_dcm": ((3, 3), (3,)),
    "dcm_from_quaternion": ((4,), (3, 3)),
    "quaternion_from_dcm": ((3, 3), (4,)),
    "mrp_from_quaternion": ((4,), (3,)),
    "quaternion_from_mrp": ((3,), (4,)),
    "mrp_shadow": ((3,), (3,)),
}
SPECIMEN = {(3,): np.array([0.1, 0.2, 0.3]), (4,): np.array([0, 0.6, 0, 0.8]), (3, 3): np.eye(3)}


def repeat(value, batch):
    """The value with leading dimensions ``batch``, in memory of its own."""
    return np.broadcast_to(value, (*batch, *np.shape(value))).copy()


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("name", CONVERSIONS)
def test_conversions(name, batch):
    core, result = CONVERSIONS[name]
    found = getattr(ln.attitude, name)(repeat(SPECIMEN[core], batch))
    assert isinstance(found, np.ndarray)
    assert found.shape == batch + result
    assert found.dtype == np.float64
    assert found.flags.c_contiguous


@pytest.mark.parametrize("batch", BATCHES)
def test_rotation_error(batch):
    assert ln.attitude.rotation_error(repeat(np.eye(3), batch), np.eye(3)).shape == (*batch, 3)
    assert ln.attitude.rotation_error(np.eye(3), repeat(np.eye(3), batch)).shape == (*batch, 3)


def test_rotation_error_outer_product():
    found = ln.attitude.rotation_error(repeat(np.eye(3), (4, 1)), repeat(np.eye(3), (3,)))
    assert found.shape == (4, 3, 3)


@pytest.mark.parametrize("batch", BATCHES)
@pytest.mark.parametrize("which", ["position", "mrp", "both"])
def test_los_functions(batch, which):
    position = repeat(POSITION, batch) if which != "mrp" else POSITION
    mrp = repeat(MRP, batch) if which != "position" else MRP
    assert ln.predict_los(LANDMARKS, position, mrp).shape == (*batch, N, 3)
    assert ln.los_jacobian(LANDMARKS, position, mrp).shape == (*batch, N, 3, 6)
    assert ln.fisher_information(LANDMARKS, position, mrp, 1e-4).shape == (*batch, 6, 6)
    assert ln.fisher_information(LANDMARKS, position, mrp, SIGMA).shape == (*batch, 6, 6)
    per_pose = repeat(SIGMA, batch)
    assert ln.fisher_information(LANDMARKS, position, mrp, per_pose).shape == (*batch, 6, 6)


def test_positions_against_attitudes():
    positions, mrps = repeat(POSITION, (4, 1)), repeat(MRP, (3,))
    assert ln.predict_los(LANDMARKS, positions, mrps).shape == (4, 3, N, 3)


def assert_solution_shapes(solution, batch):
    shapes = {
        "position": (3,),
        "mrp": (3,),
        "dcm": (3, 3),
        "quaternion": (4,),
        "covariance": (6, 6),
        "cost": (),
        "chi2": (),
        "dof": (),
        "iterations": (),
        "termination": (),
        "converged": (),
    }
    for field, core in shapes.items():
        assert np.shape(getattr(solution, field)) == batch + core, field


@pytest.mark.parametrize("guess", ["none", "shared", "own"])
@pytest.mark.parametrize("batch", BATCHES)
def test_solve_pose(batch, guess):
    given = {"none": None, "shared": GUESS, "own": repeat(GUESS, batch)}[guess]
    solution = ln.solve_pose(LANDMARKS, repeat(LOS, batch), sigma=1e-4, guess=given)
    assert_solution_shapes(solution, batch)
    assert np.all(solution.converged)
    assert np.all(np.abs(solution.position - POSITION) < 1e-6)


@pytest.mark.parametrize("batch", BATCHES)
def test_solve_pose_broadcasts_everything(batch):
    for changes in (
        {"sigma": SIGMA},
        {"sigma": repeat(SIGMA, batch)},
        {"covariance": COVARIANCE},
        {"covariance": repeat(COVARIANCE, batch)},
    ):
        solution = ln.solve_pose(repeat(LANDMARKS, batch), repeat(LOS, batch), guess=GUESS, **changes)
        assert_solution_shapes(solution, batch)
        assert np.all(solution.converged)
    if batch:
        assert_solution_shapes(ln.solve_pose(repeat(LANDMARKS, batch), LOS, sigma=1e-4), batch)
        assert_solution_shapes(ln.solve_pose(LANDMARKS, LOS, sigma=1e-4, guess=repeat(GUESS, batch)), batch)


@pytest.mark.parametrize("batch", [(), (3,), (0,)])
def test_solve_pose_robust(batch):
    solution = ln.solve_pose_robust(LANDMARKS, repeat(LOS, batch), sigma=1e-4)
    assert_solution_shapes(solution, batch)
    assert np.shape(solution.inliers) == (*batch, N)
    assert np.all(solution.inliers)


@pytest.mark.parametrize("count", [3, 4, 5, 7, 8, 9, 50, 1000])
def test_any_number_of_landmarks(count):
    rng = np.random.default_rng(count)
    landmarks = rng.uniform(-30, 30, (count, 3))
    los = ln.predict_los(landmarks, POSITION, MRP)
    solution = ln.solve_pose(landmarks, los, sigma=1e-5, guess=GUESS)
    assert solution.converged
    assert np.allclose(solution.position, POSITION, rtol=0, atol=1e-6)
    assert solution.dof == 2 * count - 6


@pytest.mark.parametrize("method", ["quest", "q-method", "svd", "foam", "esoq2"])
@pytest.mark.parametrize("batch", BATCHES)
def test_solve_attitude(batch, method):
    cores = {
        "dcm": (3, 3),
        "quaternion": (4,),
        "mrp": (3,),
        "covariance": (3, 3),
        "information": (3, 3),
        "loss": (),
        "chi2": (),
        "dof": (),
        "rank": (),
        "free_axis": (3,),
        "converged": (),
    }
    for body, reference, sigma in (
        (repeat(BODY, batch), REFERENCE, 1e-4),
        (repeat(BODY, batch), repeat(REFERENCE, batch), SIGMA),
        (BODY, repeat(REFERENCE, batch), SIGMA),
        (BODY, REFERENCE, repeat(SIGMA, batch)),
        (BODY, REFERENCE, repeat(SIGMA[:1], batch)),
    ):
        solution = ln.solve_attitude(body, reference, sigma=sigma, method=method)
        for field, core in cores.items():
            assert np.shape(getattr(solution, field)) == batch + core, field
        assert np.all(solution.converged)
        assert np.allclose(solution.dcm, DCM, rtol=0, atol=1e-12)


def test_solve_attitude_outer_product():
    found = ln.solve_attitude(repeat(BODY, (4, 1)), repeat(REFERENCE, (3,)))
    assert found.dcm.shape == (4, 3, 3, 3)

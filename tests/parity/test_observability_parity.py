"""pose_observability against the oracle's singular values, on generic and on every named singular case."""

import numpy as np
import pytest
from hypothesis import given

import losnav as ln
from tests import strategies as sts
from tests.oracle import observability as oracle
from tests.oracle import scenario

MRP = np.zeros(3)
RING = scenario.LANDMARKS
ABOVE = np.array([3.0, -2.0, 40.0])
CENTRE, RADIUS, NORMAL = oracle.circumscribed_circle(*RING[:3])
ON_CYLINDER = CENTRE + RADIUS * np.array([np.cos(0.7), np.sin(0.7), 0]) + 40 * NORMAL
ON_CIRCLE = CENTRE + RADIUS * np.array([np.cos(0.7), np.sin(0.7), 0])
LINE = np.outer([-1.0, 0.3, 2.0, 5.0], [1, 2, 0.5]) + np.array([4, 0, 1])
CIRCLE = np.array([[10 * np.cos(a), 10 * np.sin(a), 0] for a in (0.1, 1.3, 2.9, 4.0)])
CUBIC_CAMERA = np.array([1.0, 2.0, 3.0])
CUBIC = oracle.singular_cubic(
    CUBIC_CAMERA, np.array([0.3, -0.5, 0.8]), np.array([1, 0.4, -0.7]), [-2, -1, 0.5, 1, 2, 3]
)

# landmarks, camera, rank, a word of the diagnosis where the case has a name
CASES = {
    "one landmark": (RING[:1], ABOVE, 2, None),
    "two landmarks": (RING[:2], ABOVE, 4, None),
    "three landmarks": (RING[:3], ABOVE, 6, None),
    "four landmarks": (RING, ABOVE, 6, None),
    "collinear": (LINE, ABOVE, 5, "line"),
    "danger cylinder": (RING[:3], ON_CYLINDER, 5, "cylinder"),
    "fourth landmark cures the danger cylinder": (RING, ON_CYLINDER, 6, None),
    "camera in the plane of three": (RING[:3], np.array([70.0, 20, 0]), 6, None),
    "camera on the circle of three": (RING[:3], ON_CIRCLE, 5, None),
    "camera and four on one circle": (CIRCLE, np.array([10 * np.cos(5.2), 10 * np.sin(5.2), 0]), 5, "circle"),
    "twisted cubic": (CUBIC, CUBIC_CAMERA, 5, "cubic"),
    "off the twisted cubic": (CUBIC, CUBIC_CAMERA + 0.3, 6, None),
}


@pytest.mark.parametrize("case", CASES)
def test_named_cases(case):
    landmarks, position, rank, word = CASES[case]
    assert oracle.rank(landmarks, position, MRP) == rank
    found = ln.pose_observability(landmarks, position)
    assert found.rank == rank
    if word:
        assert word in str(found).lower()


@given(sts.scenes(minimum=3, max_depth=50))
def test_singular_values_and_degree(scene):
    found = ln.pose_observability(scene.landmarks, scene.position)
    expected = oracle.singular_values(scene.landmarks, scene.position, MRP)
    assert np.allclose(found.singular_values, expected, rtol=1e-6, atol=1e-7 * expected[0])
    assert found.degree == pytest.approx(expected[-1] / expected[0], rel=1e-5, abs=1e-7)


@given(sts.scenes(minimum=3, maximum=3))
def test_danger_cylinder_distance(scene):
    found = ln.pose_observability(scene.landmarks, scene.position)
    expected = oracle.danger_cylinder_distance(scene.landmarks, scene.position)
    size = np.linalg.norm(scene.landmarks - scene.position, axis=1).max()
    assert found.danger_cylinder_distance == pytest.approx(expected, rel=1e-9, abs=1e-9 * size)


def test_one_landmark_missing_on_the_descent():
    """With three of the four landmarks the way down crosses each danger cylinder at t = 213-231 s."""
    times = np.arange(200.0, 240.0, 0.5)
    for missing in range(4):
        three = np.delete(RING, missing, axis=0)
        distances = [
            ln.pose_observability(three, scenario.true_pose(t)[0]).danger_cylinder_distance for t in times
        ]
        assert 212 < times[np.argmin(distances)] < 232
        assert min(distances) < 0.5


def test_every_solution_carries_its_observability():
    los = ln.predict_los(RING, ABOVE, MRP)
    solution = ln.solve_pose(RING, los, sigma=1e-4)
    assert solution.observability.rank == 6
    direct = ln.pose_observability(RING, ABOVE)
    assert np.allclose(solution.observability.singular_values, direct.singular_values, rtol=1e-6)


def test_weakest_direction_is_the_null_direction():
    """On the danger cylinder the weakest direction moves no line of sight."""
    found = ln.pose_observability(RING[:3], ON_CYLINDER)
    expected = oracle.null_direction(RING[:3], ON_CYLINDER, MRP)
    weakest = np.asarray(found.unobservable).reshape(6, -1)[:, 0] if np.size(found.unobservable) else None
    assert weakest is not None
    mean_range = np.mean(np.linalg.norm(RING[:3] - ON_CYLINDER, axis=1))
    for scale in (1.0, mean_range):
        scaled = weakest / np.repeat([scale, 1.0], 3)
        if abs(scaled @ expected) / np.linalg.norm(scaled) > 1 - 1e-6:
            return
    pytest.fail(f"{weakest} is not along {expected}")

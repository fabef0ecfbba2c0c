"""Ranks and singular configurations of section 7, and the reference trajectory."""

import numpy as np
import pytest

from tests.oracle import attitude, observability, scenario

MRP = np.array([0.1, -0.2, 0.15])
ABOVE = np.array([3.0, -2.0, 40.0])
RING = scenario.LANDMARKS


@pytest.mark.parametrize(("count", "rank"), [(1, 2), (2, 4), (3, 6), (4, 6)])
def test_rank_by_number_of_landmarks(count, rank):
    assert observability.rank(RING[:count], ABOVE, MRP) == rank


def test_collinear_landmarks():
    line = np.outer([-1.0, 0.3, 2.0, 5.0], [1, 2, 0.5]) + np.array([4, 0, 1])
    assert observability.rank(line, ABOVE, MRP) == 5


def test_danger_cylinder():
    three = RING[:3]
    centre, radius, normal = observability.circumscribed_circle(*three)
    for point in three:
        assert np.linalg.norm(point - centre) == pytest.approx(radius, rel=1e-12)
    on = centre + radius * np.array([np.cos(0.7), np.sin(0.7), 0]) + 40 * normal
    assert observability.danger_cylinder_distance(three, on) < 1e-12
    assert observability.rank(three, on, MRP) == 5
    assert observability.rank(RING, on, MRP) == 6
    off = on + np.array([0, 0.5, 0])
    assert observability.rank(three, off, MRP) == 6


def test_camera_in_the_plane_of_three_landmarks():
    three = RING[:3]
    centre, radius, _ = observability.circumscribed_circle(*three)
    assert observability.rank(three, np.array([70.0, 20.0, 0.0]), MRP) == 6
    on_circle = centre + radius * np.array([np.cos(0.7), np.sin(0.7), 0])
    assert observability.rank(three, on_circle, MRP) == 5


def test_concyclic_camera_and_four_landmarks():
    circle = [[10 * np.cos(a), 10 * np.sin(a), 0] for a in (0.1, 1.3, 2.9, 4.0, 5.2)]
    assert observability.rank(np.array(circle[:4]), np.array(circle[4]), MRP) == 5


@pytest.mark.parametrize("count", [4, 6, 12])
def test_twisted_cubic_through_the_camera(rng, count):
    position = np.array([1.0, 2.0, 3.0])
    parameters = np.linspace(-2, 2, count) + 0.05
    landmarks = observability.singular_cubic(position, *rng.standard_normal((2, 3)), parameters)
    assert observability.rank(landmarks, position, MRP) == 5
    assert observability.rank(landmarks, position + np.array([0.1, 0, 0]), MRP) == 6


def test_null_direction_moves_no_line_of_sight():
    three = RING[:3]
    centre, radius, normal = observability.circumscribed_circle(*three)
    on = centre + radius * np.array([np.cos(0.7), np.sin(0.7), 0]) + 40 * normal
    direction = observability.null_direction(three, on, MRP)
    assert np.linalg.norm(observability.scaled_jacobian(three, on, MRP) @ direction) < 1e-12


def test_descent_crosses_the_danger_cylinder_of_every_three_landmarks():
    """With one landmark missing the way to the origin crosses once, at t = 213-231 s."""
    times = np.arange(0.0, 430.0, 0.5)
    for missing in range(4):
        three = np.delete(RING, missing, axis=0)
        crossings = observability.danger_cylinder_crossings(lambda t: scenario.true_pose(t)[0], three, times)
        assert len(crossings) == 1
        assert 212 < crossings[0] < 232


def test_profile_meets_its_boundary_conditions():
    assert len(scenario.EPOCHS) == 216
    position, mrp = scenario.true_pose(0.0)
    assert np.array_equal(position, scenario.POSITION_0)
    assert np.array_equal(mrp, scenario.MRP_0)
    end = scenario.true_pose(scenario.LANDING_TIME)
    assert np.abs(end).max() < 1e-13
    h = 1e-4
    speed = (scenario.true_pose(h)[0] - scenario.true_pose(0.0)[0]) / h
    assert np.allclose(speed, scenario.VELOCITY_0, rtol=0, atol=1e-5)
    rate = (scenario.true_pose(h)[1] - scenario.true_pose(0.0)[1]) / h
    body_rate = 4 * np.linalg.inv(attitude.mrp_kinematics(mrp)) @ rate
    assert np.allclose(body_rate, scenario.RATE_0, rtol=0, atol=1e-7)
    times = np.linspace(0, 430, 4301)
    path = np.array([scenario.true_pose(t)[0] for t in times])
    speeds = np.linalg.norm(np.gradient(path, times, axis=0), axis=1)
    assert speeds.max() == pytest.approx(1.71, abs=0.005)

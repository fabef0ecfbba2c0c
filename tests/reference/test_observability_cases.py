"""Section 7 of the model, row by row: ranks, names, numbers, and the words printed for each."""

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

import losnav as ln
from losnav.observability import Diagnosis
from tests.oracle import observability as oracle
from tests.oracle import scenario
from tests.oracle.attitude import cross_matrix, dcm_from_mrp
from tests.oracle.los import los_from_dcm

RING = scenario.LANDMARKS
THREE = RING[:3]
MRP = scenario.MRP_0
ABOVE = np.array([3.0, -2.0, 40.0])
CENTRE, RADIUS, _ = oracle.circumscribed_circle(*THREE)
ON_CYLINDER = CENTRE + RADIUS * np.array([0.6, 0.8, 0]) + [0, 0, 40]
ON_CIRCLE = CENTRE + RADIUS * np.array([0.6, 0.8, 0])
LINE = np.outer([-1.0, 0.3, 2.0, 5.0], [1, 2, 0.5]) + np.array([4, 0, 1])
SQUARE = 10 * np.array([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
CUBIC = oracle.singular_cubic(
    ABOVE, np.array([0.3, -0.5, 0.8]), np.array([7, 4, -9.0]), [-2, -1, 0.5, 1, 2, 3]
)
# Three on a line, the fourth below the camera.
TEE = np.array([[-30.0, 0, 0], [10, 0, 0], [25, 0, 0], [5, 20, 0]])

TABLE = {
    "one": (RING[:1], ABOVE, 2, Diagnosis.ONE_LANDMARK),
    "two": (RING[:2], ABOVE, 4, Diagnosis.TWO_LANDMARKS),
    "three": (THREE, ABOVE, 6, Diagnosis.GENERIC),
    "collinear": (LINE, ABOVE, 5, Diagnosis.COLLINEAR_LANDMARKS),
    "three collinear": (LINE[:3], ABOVE, 5, Diagnosis.COLLINEAR_LANDMARKS),
    "camera on their line": (LINE, LINE[0] + [9, 18, 4.5], 4, Diagnosis.CAMERA_ON_LANDMARK_LINE),
    "camera on the line of two": (LINE[:2], LINE[0] + [9, 18, 4.5], 4, Diagnosis.CAMERA_ON_LANDMARK_LINE),
    "danger cylinder": (THREE, ON_CYLINDER, 5, Diagnosis.DANGER_CYLINDER),
    "below the danger cylinder": (THREE, ON_CYLINDER - [0, 0, 200], 5, Diagnosis.DANGER_CYLINDER),
    "in the plane of three": (THREE, np.array([70.0, 20, 0]), 6, Diagnosis.GENERIC),
    "on the circle of three": (THREE, ON_CIRCLE, 5, Diagnosis.CONCYCLIC_CAMERA),
    "four coplanar": (RING, ABOVE, 6, Diagnosis.GENERIC),
    "four coplanar, cylinder of three": (RING, ON_CYLINDER, 6, Diagnosis.GENERIC),
    "above the circle of four": (SQUARE, np.array([6.0, 8, 30]), 6, Diagnosis.GENERIC),
    "on the circle of four": (SQUARE, np.array([6.0, 8, 0]), 5, Diagnosis.CONCYCLIC_CAMERA),
    "twisted cubic": (CUBIC, ABOVE, 5, Diagnosis.TWISTED_CUBIC),
    "four of a twisted cubic": (CUBIC[:4], ABOVE, 5, Diagnosis.DANGER_CYLINDERS_MEET),
    "off the twisted cubic": (CUBIC, ABOVE + np.array([0.1, 0, 0]), 6, Diagnosis.GENERIC),
    "three on a line, one below": (TEE, np.array([5.0, 20, 300]), 5, Diagnosis.LINE_AND_CIRCLE),
    "too far": (RING, np.array([0, 0, 5e5]), 4, Diagnosis.DISTANT_LANDMARKS),
}


@pytest.mark.parametrize("case", TABLE)
def test_rank_and_name(case):
    landmarks, position, rank, diagnosis = TABLE[case]
    for mrp in (None, MRP):
        found = ln.pose_observability(landmarks, position, mrp, 1e-4)
        assert found.rank == rank
        assert found.diagnosis is diagnosis
        assert oracle.rank(landmarks, position, MRP, threshold=1e-7) == rank


@pytest.mark.parametrize("case", TABLE)
def test_null_space_moves_no_line_of_sight(case):
    landmarks, position, rank, _ = TABLE[case]
    found = ln.pose_observability(landmarks, position, MRP)
    assert found.unobservable.shape == (6, 6 - rank)
    if case == "too far":
        return  # There the rank is lost to tolerance, not to geometry.
    scaled = found.unobservable / found.scale[:, None]
    assert np.allclose(scaled.T @ scaled, np.eye(6 - rank), rtol=0, atol=1e-13)
    moved = oracle.scaled_jacobian(landmarks, position, MRP) @ scaled
    assert np.abs(moved).max(initial=0.0) < 1e-13
    if rank == 6:
        assert np.isnan(found.null_twist).all()
        return
    w, v = found.null_twist[:3], found.null_twist[3:]
    for landmark in landmarks:
        d = landmark - position
        off = np.cross(d, np.cross(w, landmark) + v)
        assert np.linalg.norm(off) < 1e-10 * (1 + np.linalg.norm(v)) * (d @ d)


@pytest.mark.parametrize("case", TABLE)
def test_words(case):
    landmarks, position, rank, diagnosis = TABLE[case]
    text = str(ln.pose_observability(landmarks, position, MRP, 1e-4))
    assert text.startswith(f"rank {rank} of 6")
    assert "nan" not in text
    assert "inf" not in text
    if rank == 6:
        assert "weakest: position along" in text
        assert "1 sigma" in text
    else:
        assert str(diagnosis) in text.splitlines()[0]
        assert ("unobservable: position along" in text) == (rank == 5)


def test_the_text_of_the_first_epoch():
    """1-sigma of 1.07 m and 0.122 deg at t = 0 are, for the most part, one motion."""
    found = ln.pose_observability(RING, scenario.POSITION_0, MRP, scenario.SIGMA)
    assert str(found).splitlines() == [
        "rank 6 of 6: the pose is determined",
        "weakest: position along y (lateral) together with rotation about body -x: "
        "1.08 m and 0.123 deg, 1 sigma",
        "degree 0.00234 (smallest over largest singular value)",
        "danger cylinder 42.1 m away (the farthest of the triples)",
    ]


def test_the_text_of_the_danger_cylinder():
    text = str(ln.pose_observability(THREE, ON_CYLINDER))
    assert text.splitlines()[0] == (
        "rank 5 of 6 (danger cylinder): the camera is on the danger cylinder of the three landmarks "
        f"(radius {RADIUS:.4g} m, axis z)"
    )


# --- E6, E7, E8 ------------------------------------------------------------


def test_lines_of_sight_need_not_be_coplanar():
    """E6: rank is lost on the danger cylinder with directions that span space."""
    directions = los_from_dcm(THREE, ON_CYLINDER, np.eye(3))
    assert abs(np.linalg.det(directions)) > 0.1
    assert ln.pose_observability(THREE, ON_CYLINDER).rank == 5
    # And directions in one plane lose nothing by themselves.
    level = np.array([70.0, 20, 0])
    assert abs(np.linalg.det(los_from_dcm(THREE, level, np.eye(3)))) < 1e-15
    assert ln.pose_observability(THREE, level).rank == 6


def where_the_danger_cylinders_meet(landmarks, rng):
    """Camera positions on the cylinders of all four triples, by multistart."""
    circles = [oracle.circumscribed_circle(*np.delete(landmarks, k, axis=0)) for k in range(4)]

    def off(position):
        values = []
        for centre, radius, normal in circles:
            d = position - centre
            values.append((np.linalg.norm(d - normal * (normal @ d)) - radius) / radius)
        return np.array(values)

    found = []
    for start in rng.uniform(-40, 40, (150, 3)):
        result = least_squares(off, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
        apart = [np.linalg.norm(result.x - p) for p in [*found, *landmarks]]
        if result.cost < 1e-24 and min(apart) > 1.0:
            found.append(result.x)
    return found


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_four_danger_cylinders_meet(seed):
    """E7: four landmarks in general position have camera positions of rank 5."""
    rng = np.random.default_rng(seed)
    landmarks = rng.uniform(-10, 10, (4, 3))
    cameras = where_the_danger_cylinders_meet(landmarks, rng)
    assert 1 <= len(cameras) <= 6
    named = 0
    for camera in cameras:
        found = ln.pose_observability(landmarks, camera)
        assert found.danger_cylinder_distance < 1e-7
        assert found.rank == oracle.rank(landmarks, camera, MRP, threshold=1e-7)
        named += found.diagnosis is Diagnosis.DANGER_CYLINDERS_MEET
    assert named >= 1


@pytest.mark.parametrize("seed", range(5))
def test_rank_six_is_not_uniqueness(seed):
    """E8: four landmarks seen in the same directions from two poses, both of full rank.

    A body direction b meets in one point from both poses iff b' A1 [e x] A2' b = 0, e = p2 - p1; the
    landmarks are such points.
    """
    rng = np.random.default_rng(seed)
    p1, p2 = rng.standard_normal((2, 3))
    a1, a2 = (dcm_from_mrp(0.3 * rng.standard_normal(3)) for _ in range(2))
    form = a1 @ cross_matrix(p2 - p1) @ a2.T
    values, vectors = np.linalg.eigh(form + form.T)
    landmarks = []
    while len(landmarks) < 4:
        angle = rng.uniform(0, 2 * np.pi)
        plane = vectors[:, [0, 1]] if values[1] < 0 else vectors[:, [2, 1]]
        sole = vectors[:, 2] if values[1] < 0 else vectors[:, 0]
        weight = np.abs(values[[0, 1]] if values[1] < 0 else values[[2, 1]])
        lone = abs(values[2] if values[1] < 0 else values[0])
        b = plane @ (np.array([np.cos(angle), np.sin(angle)]) / np.sqrt(weight)) + sole / np.sqrt(lone)
        u, v = a1.T @ b, a2.T @ b
        s, t = np.linalg.lstsq(np.column_stack([u, -v]), p2 - p1, rcond=None)[0]
        if s * t > 0:
            landmarks.append(p1 + s * u)
    landmarks = np.array(landmarks)
    assert np.allclose(los_from_dcm(landmarks, p1, a1), los_from_dcm(landmarks, p2, a2), rtol=0, atol=1e-9)
    assert np.linalg.matrix_rank(landmarks[1:] - landmarks[0], tol=1e-6) == 3
    for position in (p1, p2):
        assert ln.pose_observability(landmarks, position).rank == 6


def test_two_landmarks_fix_two_things_by_themselves():
    """Attitude about n x d and position towards the centre of the circle, whatever the two ranges."""
    found = ln.pose_observability(RING[:2], ABOVE)
    a, b = RING[:2] - ABOVE
    axis = np.cross(np.cross(a, b), b - a)
    centre, radius, _ = oracle.circumscribed_circle(ABOVE, *RING[:2])
    for null in found.unobservable.T:
        scaled = null / found.scale
        assert abs(scaled[3:] @ axis) < 1e-13 * np.linalg.norm(axis)
        assert abs(scaled[:3] @ (centre - ABOVE)) < 1e-13 * radius
    # Nothing else stands alone: each of the two motions left moves and turns.
    assert np.linalg.matrix_rank(found.unobservable[:3]) == 2
    assert np.linalg.matrix_rank(found.unobservable[3:]) == 2
    for vector in (axis / np.linalg.norm(axis), (centre - ABOVE) / radius):
        words = ", ".join(f"{c:.2f}" for c in vector * np.sign(vector[np.abs(vector).argmax()]))
        assert words in str(found)


# --- the descent ------------------------------------------------------------


def side(three, t):
    """Distance outside (positive) or inside the danger cylinder."""
    centre, radius, normal = oracle.circumscribed_circle(*three)
    d = scenario.true_pose(t)[0] - centre
    return np.linalg.norm(d - normal * (normal @ d)) - radius


@pytest.fixture(scope="module")
def crossings():
    """Time at which the descent crosses the cylinder of the three left when one landmark is missing."""
    triples = [np.delete(RING, missing, axis=0) for missing in range(4)]
    return [(three, brentq(lambda t, three=three: side(three, t), 200, 240, xtol=1e-12)) for three in triples]


def test_crossing_times_and_altitudes(crossings):
    times = [t for _, t in crossings]
    altitudes = [scenario.true_pose(t)[0][2] for t in times]
    assert (round(min(times)), round(max(times))) == (213, 231)
    assert (round(min(altitudes)), round(max(altitudes))) == (212, 242)
    for three, t in crossings:
        position = scenario.true_pose(t)[0]
        found = ln.pose_observability(three, position)
        assert found.rank == 5
        assert found.diagnosis is Diagnosis.DANGER_CYLINDER
        assert found.danger_cylinder_distance < 1e-9
        assert ln.pose_observability(RING, position).rank == 6


def test_sigma_near_the_crossings(crossings):
    """25 m two seconds away, 240 m a fifth of a second away: one over the distance."""
    for before in (-1, 1):
        sigma = {}
        for seconds in (2.0, 0.2):
            sizes, products = [], []
            for three, t in crossings:
                position = scenario.true_pose(t + before * seconds)[0]
                found = ln.pose_observability(three, position, sigma=scenario.SIGMA)
                sizes.append(np.linalg.norm(found.weakest_sigma[:3]))
                products.append(sizes[-1] * found.danger_cylinder_distance)
            sigma[seconds] = np.mean(sizes)
            assert min(products) > 0
        assert sigma[2.0] == pytest.approx(25, rel=0.1)
        assert sigma[0.2] == pytest.approx(240, rel=0.05)


def test_condition_rises_with_range():
    """cond(F) of the scaled information: 2 at touchdown, 1.8e5 at 500 m."""
    times = np.linspace(0, scenario.LANDING_TIME, 44)
    positions = np.array([scenario.true_pose(t)[0] for t in times])
    condition = ln.pose_observability(RING, positions).degree ** -2.0
    assert condition[0] == pytest.approx(1.8e5, rel=0.02)
    assert condition[-1] == pytest.approx(2.1, abs=0.05)
    # On the way down it falls with the altitude, but for a bump of a few per cent near the ground.
    assert np.all(condition[1:] < 1.05 * condition[:-1])

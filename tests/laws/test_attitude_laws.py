"""Laws every attitude conversion obeys, for attitudes of every kind, half and full turns included."""

import numpy as np
from hypothesis import given

from losnav import attitude
from tests import strategies as sts
from tests.conftest import HALF_TURN, ROUND_TRIP
from tests.oracle import attitude as oracle


def same_attitude(a, b, tolerance=ROUND_TRIP):
    """Two dcms agree to ``tolerance`` rad."""
    return np.abs(a - b).max() < tolerance


def same_quaternion(a, b, tolerance=ROUND_TRIP):
    """Equal, or opposite where w = 0 leaves the sign free."""
    return min(np.abs(a - b).max(), np.abs(a + b).max() + (abs(a[3]) > tolerance)) < tolerance


@given(sts.mrps())
def test_dcm_is_a_rotation(mrp):
    dcm = attitude.dcm_from_mrp(mrp)
    assert np.abs(dcm @ dcm.T - np.eye(3)).max() < ROUND_TRIP
    assert abs(np.linalg.det(dcm) - 1) < ROUND_TRIP


@given(sts.mrps())
def test_inverse_is_the_opposite_mrp_and_the_transpose(mrp):
    assert same_attitude(attitude.dcm_from_mrp(-mrp), attitude.dcm_from_mrp(mrp).T)


@given(sts.quaternions())
def test_inverse_is_the_conjugate_quaternion(q):
    assert same_attitude(attitude.dcm_from_quaternion(q * [-1, -1, -1, 1]), attitude.dcm_from_quaternion(q).T)


@given(sts.quaternions(), sts.quaternions())
def test_group_product(a, b):
    """[CB][BN] has the quaternion q_BN * q_CB (Hamilton): the orientation is turned in body axes."""
    (av, aw), (bv, bw) = (a[:3], a[3]), (b[:3], b[3])
    product = np.append(bw * av + aw * bv + np.cross(bv, av), bw * aw - bv @ av)
    together = attitude.dcm_from_quaternion(a) @ attitude.dcm_from_quaternion(b)
    assert same_attitude(attitude.dcm_from_quaternion(product), together)


@given(sts.quaternions())
def test_opposite_quaternions_are_one_attitude(q):
    assert np.array_equal(attitude.dcm_from_quaternion(q), attitude.dcm_from_quaternion(-q))
    plus, minus = attitude.mrp_from_quaternion(q), attitude.mrp_from_quaternion(-q)
    half_turn = abs(q[3]) < ROUND_TRIP
    assert np.abs(plus - minus).max() < ROUND_TRIP or (half_turn and np.abs(plus + minus).max() < ROUND_TRIP)


@given(sts.dcms())
def test_round_trips_from_a_dcm(dcm):
    q = attitude.quaternion_from_dcm(dcm)
    mrp = attitude.mrp_from_dcm(dcm)
    assert q[3] >= 0
    assert abs(q @ q - 1) < ROUND_TRIP
    assert mrp @ mrp <= 1 + ROUND_TRIP
    assert same_attitude(attitude.dcm_from_quaternion(q), dcm, HALF_TURN)
    assert same_attitude(attitude.dcm_from_mrp(mrp), dcm, HALF_TURN)
    assert same_quaternion(attitude.quaternion_from_mrp(mrp), q, HALF_TURN)


@given(sts.quaternions())
def test_round_trips_from_a_quaternion(q):
    canonical = q if q[3] >= 0 else -q
    mrp = attitude.mrp_from_quaternion(q)
    assert mrp @ mrp <= 1 + ROUND_TRIP
    assert same_quaternion(attitude.quaternion_from_mrp(mrp), canonical)
    assert same_quaternion(
        attitude.quaternion_from_dcm(attitude.dcm_from_quaternion(q)), canonical, HALF_TURN
    )


@given(sts.mrps())
def test_round_trips_from_an_mrp(mrp):
    """Back to the MRP itself inside the ball, to its shadow outside."""
    inside = oracle.mrp_inside(mrp)
    on_the_ball = abs(inside @ inside - 1) < 1e-9
    for back in (
        attitude.mrp_from_dcm(attitude.dcm_from_mrp(mrp)),
        attitude.mrp_from_quaternion(attitude.quaternion_from_mrp(mrp)),
    ):
        error = np.abs(back - inside).max()
        assert error < HALF_TURN or (on_the_ball and np.abs(back + inside).max() < 1e-9)


@given(sts.mrps())
def test_shadow_is_an_involution_on_the_same_attitude(mrp):
    size = np.abs(mrp).max()
    if size < 1e-300:
        # A shadow past the largest number is refused; that has its own test.
        mrp, size = np.array([0.5, 0, 0]), 0.5
    shadow = attitude.mrp_shadow(mrp)
    assert np.allclose(attitude.mrp_shadow(shadow), mrp, rtol=ROUND_TRIP, atol=0)
    assert same_attitude(attitude.dcm_from_mrp(shadow), attitude.dcm_from_mrp(mrp))
    assert abs(np.linalg.norm(shadow * size) * np.linalg.norm(mrp / size) - 1) < ROUND_TRIP


@given(sts.dcms(), sts.rotation_vectors())
def test_rotation_error_inverts_the_exponential(dcm, phi):
    """dcm_true = exp(-[dalpha x]) dcm_estimate: small turns, half turns and beyond."""
    true = oracle.dcm_from_rotation_vector(phi) @ dcm
    error = attitude.rotation_error(true, dcm)
    assert np.linalg.norm(error) <= np.pi + HALF_TURN
    assert same_attitude(oracle.dcm_from_rotation_vector(error) @ dcm, true, HALF_TURN)


@given(sts.dcms(), sts.dcms(), sts.dcms())
def test_rotation_error_symmetries(a, b, c):
    """No error between equals; opposite when swapped; blind to the reference frame; turns with the body."""
    assert np.abs(attitude.rotation_error(a, a)).max() < ROUND_TRIP
    error = attitude.rotation_error(a, b)
    if np.pi - np.linalg.norm(error) < 1e-6:
        return_trip = oracle.dcm_from_rotation_vector(attitude.rotation_error(b, a))
        assert same_attitude(return_trip, b @ a.T, HALF_TURN)
        return
    assert np.abs(attitude.rotation_error(b, a) + error).max() < 1e-8
    assert np.abs(attitude.rotation_error(a @ c, b @ c) - error).max() < 1e-8
    assert np.abs(attitude.rotation_error(c @ a, c @ b) - c @ error).max() < 1e-8


def test_small_angles_on_both_sides_of_every_switch():
    """From 1e-16 rad to 1 rad in steps of 2 %: exact to rounding of the dcm's entries, and no jump."""
    axis = np.array([2.0, -3.0, 6.0]) / 7
    angles = np.geomspace(1e-16, 1.0, 1861)
    mrps = axis * np.tan(angles / 4)[:, None]
    dcms = attitude.dcm_from_mrp(mrps)
    errors = attitude.rotation_error(dcms, np.eye(3))
    assert np.abs(errors - axis * angles[:, None]).max() < 5e-16
    assert np.abs(attitude.mrp_from_dcm(dcms) - mrps).max() < 5e-16
    quaternions = attitude.quaternion_from_mrp(mrps)
    expected = np.column_stack([axis * np.sin(angles / 2)[:, None], np.cos(angles / 2)])
    assert np.abs(quaternions / expected - 1).max() < 1e-15
    assert np.abs(attitude.mrp_from_quaternion(quaternions) / mrps - 1).max() < 1e-15


def test_half_turns_on_both_sides():
    """Angles pi -+ 10^-k: the attitude survives, the MRP stays in the ball."""
    for axis in np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.8, 0], [0, -0.6, 0.8], [2 / 7, -3 / 7, 6 / 7]]]):
        deviations = np.concatenate([-np.geomspace(1e-16, 1e-1, 46), [0.0], np.geomspace(1e-16, 1e-1, 46)])
        for angle in np.pi + deviations:
            dcm = oracle.dcm_from_rotation_vector(axis * angle)
            mrp = attitude.mrp_from_dcm(dcm)
            assert mrp @ mrp <= 1 + ROUND_TRIP
            assert same_attitude(attitude.dcm_from_mrp(mrp), dcm, HALF_TURN)
            assert same_attitude(
                attitude.dcm_from_quaternion(attitude.quaternion_from_dcm(dcm)), dcm, HALF_TURN
            )


def test_full_turn():
    """An MRP on its way to infinity is the identity; its short-way form is near zero."""
    for size in (1e3, 1e8, 1e100, 1e150):
        mrp = size * np.array([0.6, 0.0, -0.8])
        assert same_attitude(attitude.dcm_from_mrp(mrp), np.eye(3), 5 / size + ROUND_TRIP)
        assert np.allclose(attitude.mrp_shadow(mrp), -mrp / size**2, rtol=1e-14, atol=0)
        q = attitude.quaternion_from_mrp(mrp)
        assert same_quaternion(q, np.append(-2 * mrp / size**2, 1.0), 5 / size**2 + ROUND_TRIP)

"""The navigation state: errors move it and come back, batches behave like arrays, bad input is named."""

import copy
import dataclasses
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import losnav as ln
from tests.conftest import SAME_FORMULA

PARTS = [field.name for field in dataclasses.fields(ln.NavState)]


def states(rng, *shape):
    """A batch with every part set."""
    q = rng.normal(size=(*shape, 4))
    return ln.NavState(
        1e3 * rng.normal(size=(*shape, 3)),
        10 * rng.normal(size=(*shape, 3)),
        q / np.linalg.norm(q, axis=-1, keepdims=True),
        1e-3 * rng.normal(size=(*shape, 3)),
        1e-5 * rng.normal(size=(*shape, 3)),
        acceleration=1e-3 * rng.normal(size=(*shape, 3)),
    )


@given(seed=st.integers(0, 2**32), n=st.sampled_from([9, 12, 15, 18]), angle=st.floats(0.0, 3.0))
def test_inject_and_minus_are_inverse(seed, n, angle):
    rng = np.random.default_rng(seed)
    state, delta = states(rng, 3), rng.normal(size=(3, n))
    delta[:, 6:9] *= angle / np.linalg.norm(delta[:, 6:9], axis=-1, keepdims=True)
    back = state.inject(delta).minus(state, n)
    # Positions of kilometres leave 1e-13 of a metre.
    np.testing.assert_allclose(back, delta, rtol=0, atol=2e-12)


def test_attitude_error_is_the_conventions(rng):
    """``dcm_true = exp(-[da x]) dcm_estimate``, which SciPy writes ``q_estimate * Rotation(da)``."""
    state, turn = states(rng), np.array([0.3, -0.2, 0.5])
    moved = state.inject(np.concatenate([np.zeros(6), turn]))
    expected = Rotation.from_quat(state.quaternion) * Rotation.from_rotvec(turn)
    np.testing.assert_allclose(moved.dcm, expected.as_matrix().T, atol=SAME_FORMULA)
    np.testing.assert_allclose(moved.minus(state, 9)[6:], turn, atol=SAME_FORMULA)
    np.testing.assert_allclose(
        moved.minus(state, 9)[6:], ln.attitude.rotation_error(moved.dcm, state.dcm), atol=SAME_FORMULA
    )


@pytest.mark.parametrize(
    ("n", "moving"),
    [
        (9, PARTS[:3]),
        (12, [*PARTS[:3], "acceleration"]),
        (15, PARTS[:5]),
        (18, PARTS),
    ],
)
def test_which_parts_an_error_of_a_size_moves(rng, n, moving):
    state = states(rng)
    moved = state.inject(np.full(n, 0.01))
    for name in PARTS:
        same = np.array_equal(getattr(moved, name), getattr(state, name))
        assert same != (name in moving), name


def test_broadcasting_and_indexing(rng):
    batch = states(rng, 4, 5)
    assert batch.shape == (4, 5)
    assert len(batch) == 4
    one = batch[2, 3]
    assert one.shape == ()
    assert batch[1].shape == (5,)
    assert batch[:, -1].shape == (4,)
    assert batch[..., 0].shape == (4,)
    assert batch[np.array([True, False, True, False])].shape == (2, 5)
    for name in PARTS:
        np.testing.assert_array_equal(getattr(one, name), getattr(batch, name)[2, 3])
    assert batch.minus(one, 18).shape == (4, 5, 18)
    assert not batch.minus(one, 18)[2, 3].any()
    assert one.inject(np.zeros((7, 1, 9))).shape == (7, 1)
    assert [state.shape for state in batch] == [(5,)] * 4
    assert batch
    assert one
    again = ln.NavState.stack(list(batch))
    for name in PARTS:
        np.testing.assert_array_equal(getattr(again, name), getattr(batch, name))


def test_fields_broadcast_and_a_plain_zero_stands_for_three():
    state = ln.NavState(np.zeros((6, 3)), [1, 2, 3], [0, 0, 0, 2e-3 + 1], 0, 0.0, acceleration=0)
    assert state.shape == (6,)
    assert all(getattr(state, name).shape[:-1] == (6,) for name in PARTS)
    np.testing.assert_array_equal(state.quaternion[0], [0, 0, 0, 1])


def test_quaternions_are_unique():
    for given_, kept in [
        ([0.6, 0, 0, -0.8], [-0.6, 0, 0, 0.8]),
        ([0, -1, 0, 0], [0, 1, 0, 0]),
        ([0, 0, 0, -1], [0, 0, 0, 1]),
    ]:
        state = ln.NavState([0, 0, 0], [0, 0, 0], given_)
        np.testing.assert_array_equal(state.quaternion, kept)
        assert not np.signbit(state.quaternion).any() or min(kept) < 0


def test_from_dcm(rng):
    state = states(rng, 3)
    twin = ln.NavState.from_dcm(
        state.position, state.velocity, state.dcm, gyroscope_bias=state.gyroscope_bias
    )
    np.testing.assert_allclose(twin.quaternion, state.quaternion, atol=SAME_FORMULA)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_and_pickles(rng, duplicate):
    state = states(rng, 2)
    twin = duplicate(state)
    assert type(twin) is ln.NavState
    assert repr(twin) == repr(state)
    for name in PARTS:
        np.testing.assert_array_equal(getattr(twin, name), getattr(state, name))


def test_frozen(rng):
    state = states(rng)
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.position = np.zeros(3)
    with pytest.raises(ValueError, match="read-only"):
        state.position[0] = 1.0


def test_arguments_stay_the_callers(rng):
    position, quaternion = rng.normal(size=(2, 3)), np.array([0.0, 0.0, 0.6, 0.8])
    state = ln.NavState(position, np.zeros(3), quaternion)
    kept = position.copy()
    position[0] = 7.0
    quaternion[:] = 0.5
    np.testing.assert_array_equal(state.position, kept)
    np.testing.assert_allclose(state.quaternion[1], [0.0, 0.0, 0.6, 0.8])


def test_reads_well(rng):
    state = ln.NavState([1.0, 2, 3], [0, 0, 0], [0, 0, 0, 1.0])
    assert repr(state) == (
        "NavState(position=[1.0, 2.0, 3.0], velocity=[0.0, 0.0, 0.0], quaternion=[0.0, 0.0, 0.0, 1.0])"
    )
    assert repr(states(rng, 3, 2)) == "NavState of shape (3, 2)"


ZERO, UNIT = [0.0, 0, 0], [0.0, 0, 0, 1]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ln.NavState([0, 0], ZERO, UNIT), r"position: expected shape \(\.\.\., 3\), got \(2,\)"),
        (lambda: ln.NavState(ZERO, ZERO, ZERO), r"quaternion: expected shape \(\.\.\., 4\)"),
        (lambda: ln.NavState(ZERO, ZERO, [0, 0, 0, 2]), r"quaternion: expected a unit quaternion.*norm 2"),
        (lambda: ln.NavState(ZERO, [0, np.nan, 0], UNIT), r"velocity\[1\]: expected a finite number"),
        (lambda: ln.NavState(np.zeros((2, 3)), np.zeros((3, 3)), UNIT), "do not broadcast.*position"),
        (lambda: ln.NavState(ZERO, ZERO, UNIT).inject(np.zeros(10)), r"delta: expected shape \(\.\.\., 9\)"),
        (lambda: ln.NavState(ZERO, ZERO, UNIT).inject(0.0), r"delta: expected shape \(\.\.\., 9\)"),
        (
            lambda: ln.NavState(np.zeros((2, 3)), ZERO, UNIT).inject(np.zeros((3, 9))),
            "delta: leading dimensions",
        ),
        (lambda: ln.NavState(ZERO, ZERO, UNIT).minus(ln.NavState(ZERO, ZERO, UNIT), 10), "n: expected 9, 12"),
        (lambda: ln.NavState(ZERO, ZERO, UNIT).minus(np.zeros(9)), "other: expected a NavState, got ndarray"),
        (lambda: ln.NavState.stack([]), "states: expected one or more"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ln.InvalidInputError, match=message):
        call()


def test_one_state_is_no_batch():
    one = ln.NavState(ZERO, ZERO, UNIT)
    with pytest.raises(TypeError, match="no members"):
        one[0]
    with pytest.raises(TypeError, match="no length"):
        len(one)
    with pytest.raises(TypeError, match="no length"):
        list(one)

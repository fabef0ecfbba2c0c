"""The same numbers in any layout, container or type give the same answer, bit for bit."""

import numpy as np
import pytest

from tests import strategies as sts
from tests.api.calls import CALLS, DOORS, numbers, same

INTEGER_ARGUMENTS = {"landmarks", "position"}
MAY_BE_ZERO = {"landmarks", "position", "mrp", "dcm_estimate", "guess", "state", "control"}


@pytest.mark.parametrize("layout", sorted(sts.LAYOUTS))
@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_layout(name, argument, layout):
    call = CALLS[name]
    same_values = sts.LAYOUTS[layout](call.arrays[argument])
    assert same(call(**{argument: same_values}), call())


@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_arguments_are_left_alone(name, argument):
    call = CALLS[name]
    value = call.arrays[argument].copy()
    call(**{argument: value})
    assert np.array_equal(value, call.arrays[argument])


@pytest.mark.parametrize("kind", [np.float32, ">f4"])
@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_short_floats_mean_their_own_value(name, argument, kind):
    """A float32 array is converted exactly; what it had lost before is not our affair."""
    call = CALLS[name]
    short = call.arrays[argument].astype(kind)
    assert same(call(**{argument: short}), call(**{argument: short.astype(np.float64)}))


@pytest.mark.parametrize("kind", [np.int8, np.int64, ">i4", "python"])
@pytest.mark.parametrize(("name", "argument"), [d for d in DOORS if d[1] in INTEGER_ARGUMENTS])
def test_integers(name, argument, kind):
    call = CALLS[name]
    value = call.arrays[argument]
    whole = value.astype(int).tolist() if kind == "python" else value.astype(kind)
    assert same(call(**{argument: whole}), call())


@pytest.mark.parametrize("name", ["dcm_from_mrp", "quaternion_from_mrp", "predict_los"])
def test_half_precision(name):
    """Where no unit length is asked for, float16 is a number like any other."""
    mrp = CALLS[name].arrays["mrp"].astype(np.float16)
    assert same(CALLS[name](mrp=mrp), CALLS[name](mrp=mrp.astype(np.float64)))


def test_unsigned_integers():
    landmarks = np.abs(CALLS["predict_los"].arrays["landmarks"])
    call = CALLS["predict_los"]
    assert same(call(landmarks=landmarks.astype(np.uint8)), call(landmarks=landmarks))


@pytest.mark.parametrize(("name", "argument"), [d for d in DOORS if d[1] in MAY_BE_ZERO])
def test_negative_zero_is_zero(name, argument):
    call = CALLS[name]
    value = call.arrays[argument].copy()
    value[value == value.flat[0]] = 0.0
    if argument == "dcm_estimate":
        value = np.eye(3)
    negative = np.where(value == 0, -0.0, value)
    for a, b in zip(numbers(call(**{argument: negative})), numbers(call(**{argument: value})), strict=True):
        assert np.array_equal(a, b)


# The shadow of a denormal is not a finite vector.
SMALL_DOORS = [d for d in DOORS if d[1] in {"mrp", "position", "landmarks", "state"} and d[0] != "mrp_shadow"]


@pytest.mark.parametrize(("name", "argument"), SMALL_DOORS)
def test_denormals_are_as_good_as_zero(name, argument):
    call = CALLS[name]
    value = call.arrays[argument].copy()
    value.flat[0] = 5e-324
    tiny = call(**{argument: value})
    value.flat[0] = 0.0
    for a, b in zip(numbers(tiny), numbers(call(**{argument: value})), strict=True):
        assert np.allclose(a, b, rtol=1e-9, atol=1e-12)

"""Whatever comes through the door: a right answer or one InvalidInputError.

HYPOTHESIS_PROFILE=deep runs a hundred times more."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from losnav import LosnavError
from tests.api.calls import CALLS, numbers

# Sixteen calls, two tests: sixty each by default, a deep profile's own number otherwise.
EXAMPLES = 60 if settings().max_examples <= 100 else settings().max_examples
EXTREMES = st.sampled_from(
    [
        0.0,
        -0.0,
        1.0,
        -1.0,
        np.nan,
        np.inf,
        -np.inf,
        5e-324,
        1e-310,
        1e-160,
        1e160,
        1.7e308,
        -1.7e308,
        2**53 + 1.0,
    ]
)
NUMBERS = EXTREMES | st.floats(allow_nan=True, allow_infinity=True) | st.floats(-10, 10)
SHAPES = hnp.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=6) | st.sampled_from(
    [
        (3,),
        (4,),
        (3, 3),
        (6, 3),
        (6, 3, 3),
        (2, 3),
        (2, 6, 3),
        (6,),
        (2, 6),
        (1, 3),
        (0, 3),
        (6, 1),
        (1, 6, 3),
    ]
)
KINDS = st.sampled_from([np.float64, np.float32, ">f8", np.float16, np.longdouble])


@st.composite
def arrays(draw):
    """Any floats in any shape; any small integers; or a whole container of Python numbers."""
    if draw(st.integers(0, 4)) == 0:
        return draw(hnp.arrays(draw(st.sampled_from([np.int8, np.int64, np.uint32, bool])), draw(SHAPES)))
    with np.errstate(over="ignore"):
        value = draw(hnp.arrays(np.float64, draw(SHAPES), elements=NUMBERS)).astype(draw(KINDS))
    return value.tolist() if draw(st.integers(0, 5)) == 0 else value


@st.composite
def spoiled(draw, value):
    """A good argument with some of its numbers replaced, scaled or broadcast."""
    value = value.copy()
    for _ in range(draw(st.integers(1, 3))):
        value.flat[draw(st.integers(0, value.size - 1))] = draw(NUMBERS)
    if draw(st.booleans()):
        with np.errstate(over="ignore", invalid="ignore"):
            value = value * draw(st.sampled_from([1.0, 1e-300, 1e-150, 1e150, 1e300]))
    return np.broadcast_to(value, (draw(st.integers(0, 3)), *value.shape)) if draw(st.booleans()) else value


def assert_answered(call, changes):
    """Finite numbers, or a solution that does not claim success, or the library's own error."""
    try:
        result = call(**changes)
    except LosnavError:
        return
    converged = np.asarray(getattr(result, "converged", True))
    for value in numbers(result):
        if converged.shape and value.dtype.kind == "f":
            assert np.isfinite(value[converged]).all()
        elif converged.all():
            assert np.isfinite(value).all()


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_any_arrays(name, data):
    call = CALLS[name]
    chosen = data.draw(st.sets(st.sampled_from(sorted(call.arrays)), min_size=1))
    assert_answered(call, {argument: data.draw(arrays(), label=argument) for argument in sorted(chosen)})


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=EXAMPLES)
@given(data=st.data())
def test_spoiled_arguments(name, data):
    """Near misses reach deeper than noise."""
    call = CALLS[name]
    chosen = data.draw(st.sets(st.sampled_from(sorted(call.arrays)), min_size=1))
    changes = {
        argument: data.draw(spoiled(call.arrays[argument]), label=argument) for argument in sorted(chosen)
    }
    assert_answered(call, changes)


@pytest.mark.parametrize("name", [n for n in CALLS if "landmarks" in CALLS[n].arrays])
@pytest.mark.parametrize("scale", [1e-150, 1e-30, 1e-6, 1e6, 1e30, 1e100])
def test_unit_of_length_does_not_matter(name, scale):
    """Landmarks and positions in any unit: the same attitude, the same rank, positions in that unit."""
    call = CALLS[name]
    changes = {"landmarks": call.arrays["landmarks"] * scale}
    if "position" in call.arrays:
        changes["position"] = call.arrays["position"] * scale
    if "state" in call.arrays:
        changes["state"] = call.arrays["state"] * scale
    if "guess" in call.arrays:
        changes["guess"] = call.arrays["guess"] * np.repeat([scale, 1.0], 3)
    scaled, plain = call(**changes), call()
    if hasattr(plain, "converged"):
        assert scaled.converged
        assert np.allclose(np.asarray(scaled.position) / scale, plain.position, rtol=1e-9, atol=1e-7)
        assert np.allclose(scaled.dcm, plain.dcm, rtol=0, atol=1e-9)
    elif hasattr(plain, "rank"):
        assert scaled.rank == plain.rank
        assert np.allclose(scaled.singular_values, plain.singular_values, rtol=1e-9)
    elif name in ("predict_los", "LandmarkCamera.predict"):
        assert np.allclose(scaled, plain, rtol=1e-13, atol=1e-14)
    else:
        assert np.isfinite(scaled).all()

"""Every conversion, batched, against the oracle one attitude at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from losnav import attitude
from tests import strategies as sts
from tests.conftest import HALF_TURN, ROUND_TRIP
from tests.oracle import attitude as oracle

MAPS = {
    "dcm_from_mrp": sts.mrps(),
    "dcm_from_quaternion": sts.quaternions(),
    "mrp_from_quaternion": sts.quaternions(),
    "quaternion_from_mrp": sts.mrps(),
    "quaternion_from_dcm": sts.dcms(),
    "mrp_from_dcm": sts.dcms(),
}


@pytest.mark.parametrize("name", MAPS)
@given(data=st.data())
def test_conversion(name, data):
    inputs = data.draw(st.lists(MAPS[name], min_size=1, max_size=20))
    found = getattr(attitude, name)(np.array(inputs))
    for one, value in zip(found, inputs, strict=True):
        expected = getattr(oracle, name)(value)
        error = np.abs(one - expected).max()
        half_turn = not name.startswith("dcm") and np.abs(one + expected).max() < HALF_TURN
        assert error < ROUND_TRIP or half_turn or (name.endswith("dcm") and error < HALF_TURN)


@given(st.lists(st.tuples(sts.dcms(), sts.dcms()), min_size=1, max_size=20))
def test_rotation_error(pairs):
    true, estimate = (np.array(side) for side in zip(*pairs, strict=True))
    for found, a, b in zip(attitude.rotation_error(true, estimate), true, estimate, strict=True):
        expected = oracle.rotation_error(a, b)
        # At a half turn both signs are right; next to it the sign is still decided, so compare attitudes.
        error = np.abs(found - expected).max()
        turned = oracle.dcm_from_rotation_vector(found) - oracle.dcm_from_rotation_vector(expected)
        assert error < HALF_TURN or (np.linalg.norm(expected) > 3.1 and np.abs(turned).max() < HALF_TURN)

"""Conversions against scipy.spatial.transform.Rotation.

| losnav                 | SciPy                                             |
|------------------------|---------------------------------------------------|
| dcm (reference -> body)| ``as_matrix().T`` (SciPy turns body into reference) |
| quaternion, w >= 0     | ``as_quat(canonical=True)``, same order           |
| mrp                    | ``as_mrp()``                                      |
| rotation_error         | ``(estimate.inv() * true).as_rotvec()``           |
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from losnav import attitude
from tests.conftest import HALF_TURN, ROUND_TRIP


@pytest.fixture(scope="module")
def rotations():
    """Ten thousand uniform attitudes, and small and large turns about every kind of axis."""
    rng = np.random.default_rng(3)
    axes = np.vstack([np.eye(3), -np.eye(3), rng.standard_normal((20, 3))])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = [0, 1e-12, 1e-8, 1e-5, 1e-3, 0.5, 2.0, 3.1, np.pi - 1e-5, np.pi - 1e-9]
    special = np.concatenate([a * axes for a in angles])
    return Rotation.concatenate([Rotation.random(10_000, rng=rng), Rotation.from_rotvec(special)])


def test_from_mrp(rotations):
    mrp = rotations.as_mrp()
    assert np.abs(attitude.dcm_from_mrp(mrp) - rotations.as_matrix().swapaxes(1, 2)).max() < ROUND_TRIP
    assert np.abs(attitude.quaternion_from_mrp(mrp) - rotations.as_quat(canonical=True)).max() < ROUND_TRIP


def test_from_quaternion(rotations):
    q = rotations.as_quat()
    assert np.abs(attitude.dcm_from_quaternion(q) - rotations.as_matrix().swapaxes(1, 2)).max() < ROUND_TRIP
    assert np.abs(attitude.mrp_from_quaternion(q) - rotations.as_mrp()).max() < ROUND_TRIP


def test_from_dcm(rotations):
    dcm = rotations.as_matrix().swapaxes(1, 2)
    assert np.abs(attitude.quaternion_from_dcm(dcm) - rotations.as_quat(canonical=True)).max() < HALF_TURN
    assert np.abs(attitude.mrp_from_dcm(dcm) - rotations.as_mrp()).max() < HALF_TURN


def test_rotation_error(rotations):
    rng = np.random.default_rng(4)
    estimates = Rotation.random(len(rotations), rng=rng)
    true = estimates * rotations
    found = attitude.rotation_error(
        true.as_matrix().swapaxes(1, 2),
        estimates.as_matrix().swapaxes(1, 2),
    )
    expected = rotations.as_rotvec()
    away = np.linalg.norm(expected, axis=1) < np.pi - 1e-6
    assert away.sum() > 10_000
    assert np.abs(found - expected)[away].max() < 1e-9
    assert np.abs(found - expected)[np.linalg.norm(expected, axis=1) < 1].max() < 1e-15 * 10

"""predict_los, los_jacobian and fisher_information against the oracle, by property."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import losnav as ln
from tests import strategies as sts
from tests.conftest import JACOBIAN, ROUNDING, SAME_FORMULA
from tests.oracle import los as oracle

COMPLEX_STEP = 1e-30


def normalised(information):
    """Entries over the geometric mean of their diagonals: scale-free comparison of information matrices."""
    d = np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    return information / (d[..., :, None] * d[..., None, :])


@given(sts.scenes(minimum=1, max_depth=50))
def test_predict_los(scene):
    found = ln.predict_los(scene.landmarks, scene.position, scene.mrp)
    assert np.abs(found - scene.los).max() < SAME_FORMULA
    assert np.abs(np.linalg.norm(found, axis=-1) - 1).max() < ROUNDING


@given(sts.scenes(minimum=1, max_depth=50), sts.mrps())
def test_los_jacobian_by_complex_step(scene, mrp):
    """Position columns are compared times the range, the size their entries have."""
    found = ln.los_jacobian(scene.landmarks, scene.position, mrp)
    ranges = np.linalg.norm(scene.landmarks - scene.position, axis=1)
    for k in range(6):
        step = 1j * COMPLEX_STEP * np.eye(6)[k]
        if k < 3:
            step = step * ranges.mean()
        numeric = oracle.predict_los(scene.landmarks, scene.position + step[:3], mrp + step[3:]).imag
        numeric = numeric / COMPLEX_STEP
        column = found[..., k] * (ranges.mean() if k < 3 else 1.0)
        assert np.abs(column - numeric).max() < JACOBIAN * max(1.0, np.abs(numeric).max())


@given(sts.scenes(minimum=1))
def test_los_jacobian_is_the_paper_s(scene):
    found = ln.los_jacobian(scene.landmarks, scene.position, scene.mrp)
    expected = oracle.los_jacobian(scene.landmarks, scene.position, scene.mrp)
    assert np.abs(found - expected).max() < SAME_FORMULA * np.abs(expected).max()


@given(sts.scenes(minimum=1), st.booleans())
def test_fisher_information(scene, per_landmark):
    rng = np.random.default_rng(scene.seed)
    sigma = scene.sigma * rng.uniform(0.5, 2, scene.count) if per_landmark else scene.sigma
    found = ln.fisher_information(scene.landmarks, scene.position, scene.mrp, sigma)
    weights = oracle.isotropic_weights(sigma, scene.count)
    expected = oracle.fisher_information(scene.landmarks, scene.position, scene.mrp, weights)
    d = np.sqrt(np.diag(expected))
    assert np.abs((found - expected) / np.outer(d, d)).max() < SAME_FORMULA
    assert np.array_equal(found, found.T)


@given(sts.scenes(minimum=2))
def test_one_batch_is_many_single_calls(scene):
    """(2, 3) poses at once equal six calls: same values to rounding of the vector path."""
    rng = np.random.default_rng(scene.seed)
    positions = scene.position + 0.01 * np.abs(scene.position).max() * rng.standard_normal((2, 3, 3))
    mrps = scene.mrp + 0.05 * rng.standard_normal((2, 3, 3))
    sigma = scene.sigma
    los = ln.predict_los(scene.landmarks, positions, mrps)
    jacobian = ln.los_jacobian(scene.landmarks, positions, mrps)
    information = ln.fisher_information(scene.landmarks, positions, mrps, sigma)
    assert los.shape == (2, 3, scene.count, 3)
    assert jacobian.shape == (2, 3, scene.count, 3, 6)
    assert information.shape == (2, 3, 6, 6)
    for i in np.ndindex(2, 3):
        pose = scene.landmarks, positions[i], mrps[i]
        assert np.abs(los[i] - ln.predict_los(*pose)).max() < ROUNDING
        single = ln.los_jacobian(*pose)
        assert np.abs(jacobian[i] - single).max() < SAME_FORMULA * np.abs(single).max()
        single = ln.fisher_information(*pose, sigma)
        assert np.abs(normalised(information[i]) - normalised(single)).max() < SAME_FORMULA

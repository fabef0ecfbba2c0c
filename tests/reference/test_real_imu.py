"""A real inertial unit and real tracks of mapped landmarks, 14 s of a flight, against motion capture.

Whoever made the file gives poses and biases of a batch adjustment of everything, the unit included. Tracks
are real: some follow a reflection or an edge, and are wrong from some image on.
"""

import importlib.util

import numpy as np
import pytest

import losnav as ln
from tests.conftest import REPOSITORY

# rms, mm: what a 15-state filter in plain NumPy reaches on the same file is 12 with a gate and 33 without.
GATED, UNGATED = 15.0, 25.0
# Biases against the batch adjustment's, m/s^2 and rad/s: of 0.18 and 0.08, found in 14 s.
ACCELEROMETER, GYROSCOPE = 0.03, 1e-3
# Pixels at the poses of the batch adjustment: surely wrong, surely right.
WRONG, RIGHT = 8.0, 3.0


def load_example():
    """The example that users run on files of their own."""
    path = REPOSITORY / "examples" / "imu_and_landmarks.py"
    spec = importlib.util.spec_from_file_location("imu_and_landmarks", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def path(data_folder):
    path = data_folder / "imu_landmarks.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    return path


@pytest.fixture(scope="module")
def file(path):
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


@pytest.fixture(scope="module")
def example():
    return load_example()


@pytest.fixture(scope="module")
def drive(example, path):
    return example.load(path)


@pytest.fixture(scope="module")
def found(example, drive):
    return example.navigate(drive)


def rms(example, drive, found):
    """mm, the first second left out."""
    settled = drive.times[1:] > drive.times[0] + 1.0
    return 1e3 * np.sqrt((example.error(drive, found)[settled] ** 2).sum(axis=1).mean())


@pytest.fixture(scope="module")
def residuals(file, drive):
    """Pixels between looks and landmarks at the poses of the batch adjustment, (F, L), NaN where not seen."""
    poses = ln.NavState.from_dcm(file["p_wb_ref"], file["v_wb_ref"], file["R_wb_ref"].transpose(0, 2, 1))
    off = np.full(drive.pixels[:, ::2].shape, np.nan)
    for k in range(len(drive.times)):
        seen = np.isfinite(drive.pixels[k, ::2])
        expected = drive.camera.predict(poses[k], landmarks=_front(drive, poses[k])).reshape(-1, 2)
        difference = drive.pixels[k].reshape(-1, 2) - expected
        off[k, seen] = np.linalg.norm(difference[seen], axis=1)
    return off


def _front(drive, state):
    """The map, what is behind the camera moved to the first landmark in front: nobody looks at it."""
    front = drive.camera.visible(state)
    return np.where(front[:, np.newaxis], drive.camera.landmarks, drive.camera.landmarks[front.argmax()])


def test_axes_and_signs(residuals, drive):
    """The mounting is body from camera in the file: with it the typical look is right to a pixel."""
    assert np.nanmedian(residuals) < 1.5
    assert drive.substeps == 10
    assert drive.controls.shape == (10 * (len(drive.times) - 1), 6)


def test_position_against_motion_capture(example, drive, found):
    with_gate = rms(example, drive, found)
    without = rms(example, drive, example.navigate(drive, gate=None))
    print(f"{with_gate:.1f} mm with the gate, {without:.1f} mm without")
    assert with_gate <= GATED
    assert without > UNGATED


def test_the_factorised_form_is_the_same_filter(example, drive, found):
    """From a start of its own: 17 cm and 3 degrees off."""
    model = ln.dynamics.Strapdown(
        ln.dynamics.Site.inertial(), ln.gravity.Uniform(drive.gravity), example.UNIT
    )
    off = example.first_state(drive).inject([0.1, -0.1, 0.1, 0, 0, 0, 0.03, -0.03, 0.03])
    sigma = np.repeat([0.1, 0.5, 0.05, 0.2, 0.1], 3)
    paths = []
    for form in ("joseph", "ud"):
        ekf = ln.ExtendedKalmanFilter(model, off, np.diag(sigma**2), gate=example.GATE, form=form)
        log = ekf.run(
            drive.times[1:],
            [(drive.camera, drive.pixels[1:])],
            controls=(drive.controls[:, :3], drive.controls[:, 3:]),
            substeps=drive.substeps,
        )
        paths.append(log.state.position)
        error = (paths[-1] - drive.truth[1:])[drive.times[1:] > 1.0]
        assert 1e3 * np.sqrt((error**2).sum(axis=1).mean()) <= GATED
    np.testing.assert_allclose(paths[0], paths[1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(paths[0][-1], found.log.state.position[-1], rtol=0, atol=1e-3)


def test_biases_are_recovered(file, found):
    accelerometer = found.state.accelerometer_bias - file["bias_acc_ref"][-1]
    gyroscope = found.state.gyroscope_bias - file["bias_gyro_ref"][-1]
    assert np.abs(accelerometer).max() < ACCELEROMETER
    assert np.abs(gyroscope).max() < GYROSCOPE


def test_wrong_looks_are_rejected_and_right_ones_are_not(residuals, found):
    off, rejected = residuals[1:], found.seen & ~found.used
    wrong, right = off > WRONG, off < RIGHT
    assert wrong.sum() > 0.05 * found.seen.sum()
    assert (rejected & wrong).sum() > 0.95 * wrong.sum()
    assert (rejected & right).sum() < 0.015 * right.sum()


def test_wrong_tracks_are_named(residuals, found):
    """Those whose typical look is off, if there are enough looks to tell."""
    off = residuals[1:]
    enough = np.flatnonzero(found.seen.sum(axis=0) >= 20)
    typical = np.nanmedian(off[:, enough], axis=0)
    assert set(found.wrong) == set(enough[typical > 5.0])
    assert found.wrong.size >= 4

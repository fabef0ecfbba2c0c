"""Two satellites, 160 km to 2 km: where Clohessy-Wiltshire breaks, that the filter says so, what repairs it.

Orbits from public two-line elements (SGP4). Theirs: x radial, y along track, z cross track, in the target's
orbital frame; ours: x = y', y = -z', z = -x'.
"""

import numpy as np
import pytest

import losnav as ln
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from losnav.scenarios.relative_navigation.recorded import CurvilinearCamera, Recorded, follow

OURS_FROM_THEIRS = np.array([[0.0, 1, 0], [0, 0, -1], [-1, 0, 0]])
STRIDE = 2  # of 30 s
RUNS = 3


@pytest.fixture(scope="module")
def file(data_folder):
    path = data_folder / "oneweb_approach.npz"
    if not path.is_file():
        pytest.skip(f"{path} is absent")
    with np.load(path) as arrays:
        return {name: arrays[name] for name in arrays.files}


@pytest.fixture(scope="module")
def recorded(file):
    states = [np.concatenate([file[f"{who}_r"], file[f"{who}_v"]], axis=1) for who in ("chief", "deputy")]
    return Recorded(file["t"], *states).every(STRIDE)


def between(recorded, nearest, farthest):
    """Measured epochs in a band of ranges, the convergence of the first guess left out."""
    distance = recorded.range[1:]
    return (distance >= nearest) & (distance < farthest) & (np.arange(len(distance)) >= 30)


def rms(followed, epochs):
    return float(np.sqrt((followed.error[:, epochs, :3] ** 2).sum(axis=-1).mean()))


def test_frames_and_signs(file, recorded):
    assert recorded.range[0] == pytest.approx(160.4e3, abs=100)
    assert recorded.range.min() == pytest.approx(2.15e3, abs=50)
    np.testing.assert_allclose(
        recorded.relative[:, :3], file["rho"][::STRIDE] @ OURS_FROM_THEIRS.T, atol=1e-6
    )
    velocity = file["rhodot"][::STRIDE] @ OURS_FROM_THEIRS.T
    np.testing.assert_allclose(recorded.relative[:, [3, 5]], velocity[:, [0, 2]], atol=1e-3)
    # The file's frame does not turn with the plane of the orbit; ours does, 3 cm/s at 160 km, as the
    # positions' own rate has it.
    step = 2 * STRIDE * 30.0
    rate = (recorded.relative[2:, 1] - recorded.relative[:-2, 1]) / step
    curvature = 1e-3  # of central differences over two minutes
    ours, theirs = (np.abs(rate - v[1:-1]).max() for v in (recorded.relative[:, 4], velocity[:, 1]))
    assert ours < curvature + 0.2 * theirs
    assert 0.02 < theirs < 0.05


@pytest.mark.parametrize(
    ("model", "least", "most"), [("cw", 4e-3, 8e-3), ("curvilinear", 5e-4, 1.5e-3), ("j2", 0.0, 5e-6)]
)
def test_what_each_model_leaves_out(recorded, model, least, most):
    """Acceleration that explains the error of a prediction over a minute, at 150 km and more, m/s^2."""
    far = np.flatnonzero(recorded.range > 150e3)[:-1]
    dt = recorded.times[1] - recorded.times[0]
    x = recorded.relative
    mean_motion = ln.orbits.mean_motion(EARTH_MU, recorded.radius)
    dynamics = ln.dynamics.ClohessyWiltshire(mean_motion)
    if model == "j2":
        planet = {"j2": EARTH_J2, "radius": EARTH_RADIUS}
        aware = ln.dynamics.RelativeTwoBody(EARTH_MU, recorded.chaser, recorded.times, **planet)
        moved = np.stack([aware.propagate(x[k], dt, time=recorded.times[k]) for k in far])
    else:
        if model == "curvilinear":
            x = ln.orbits.curvilinear_from_lvlh(x, recorded.radius)
        moved = dynamics.propagate(x[far], dt)
    error = np.linalg.norm((x[far + 1] - moved)[:, 3:], axis=1) / dt
    assert least <= np.sqrt(np.mean(error**2)) <= most


@pytest.fixture(scope="module")
def linear(recorded):
    return follow(recorded, "cw", 1e-9, runs=RUNS)


def test_the_linear_filter_breaks_with_distance_and_says_so(recorded, linear):
    far, near = between(recorded, 100e3, np.inf), between(recorded, 0, 10e3)
    assert linear.nis.verdict == linear.nees.verdict == "optimistic"
    assert linear.nis.value[:, far].mean() > 300  # 3 if consistent
    assert linear.nees.value[:, far].mean() > 1e6  # 6 if consistent
    # An angle of 0.6 mrad alone is 90 m at 150 km.
    assert rms(linear, far) > 500
    assert linear.nis.value[:, near].mean() < 20


def test_more_process_noise_makes_it_honest_not_good(recorded, linear):
    loose = follow(recorded, "cw", 1e-3, runs=RUNS)
    far = between(recorded, 100e3, np.inf)
    assert loose.nees.value[:, far].mean() < 12
    assert rms(loose, far) > 60
    assert rms(loose, between(recorded, 0, 10e3)) > 0.7 * rms(linear, between(recorded, 0, 10e3))


def test_curvilinear_coordinates_repair_the_curvature(recorded, linear):
    # Python in the loop: the far part of the arc is enough.
    start = Recorded(recorded.times[:240], recorded.target[:240], recorded.chaser[:240])
    bent = follow(start, "curvilinear", 1e-9, runs=1)
    repaired = follow(start, "curvilinear", 2e-5, runs=1)
    epochs = np.arange(239) >= 30
    straight = Recorded(recorded.times[:240], recorded.target[:240], recorded.chaser[:240])
    assert rms(bent, epochs) < 0.3 * rms(follow(straight, "cw", 1e-9, runs=1), epochs)
    # What J2 and eccentricity leave still needs its noise.
    assert bent.nis.verdict == "optimistic"
    assert repaired.nis.value[:, epochs].mean() == pytest.approx(3.0, abs=0.5)
    assert rms(repaired, epochs) < rms(bent, epochs)


def test_two_j2_orbits_repair_everything(recorded, linear):
    aware = follow(recorded, "j2", 1e-9, runs=RUNS)
    far, near = between(recorded, 100e3, np.inf), between(recorded, 0, 10e3)
    assert aware.nees.verdict == "consistent"
    assert aware.nis.mean == pytest.approx(3.0, abs=0.15)
    # 9 m at 150 km, where one angle is 90 m; 0.9 m near by.
    assert rms(aware, far) < 0.02 * rms(linear, far)
    assert rms(aware, near) < 0.3 * rms(linear, near)


def test_the_users_sensor_has_the_right_jacobian():
    camera = ln.sensors.RangeBearing(0.2, 6e-4)
    sensor, rng = CurvilinearCamera(camera, 7e6), np.random.default_rng(0)
    state = np.array([-150e3, 3e3, -2e3, 1.0, 2.0, 3.0])
    dcm = ln.attitude.dcm_from_mrp(rng.standard_normal(3) / 4)
    steps = np.pad(np.eye(3), ((0, 0), (0, 3))) * 10.0
    numeric = (sensor.predict(state + steps, dcm=dcm) - sensor.predict(state - steps, dcm=dcm)).T / 20.0
    np.testing.assert_allclose(sensor.jacobian(state, dcm=dcm)[:, :3], numeric, rtol=1e-6, atol=1e-11)

"""The landing scenario: its parameters, its numbers, and verdicts that follow the runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from losnav import pose_observability, predict_los, scenarios, solve_pose
from losnav.campaign import worker_pool
from losnav.consistency import nees_bounds
from losnav.errors import InvalidInputError, LosnavError
from losnav.scenarios.landmark_landing.claims import judge_claims
from losnav.scenarios.landmark_landing.geometry import (
    cylinder_distance,
    danger_crossings,
    singular_landmarks,
    twin_poses,
)
from losnav.scenarios.landmark_landing.result import LandingResult
from tests.conftest import SAME_FORMULA
from tests.oracle import scenario as oracle

RUNS, SEED = 60, 4
BAND = 0.999


@pytest.fixture(scope="module")
def landing():
    return scenarios.load("landmark-landing")


@pytest.fixture(scope="module")
def result(landing):
    return landing.run(RUNS, SEED)


@pytest.fixture(scope="module")
def claims(result):
    return {claim.number: claim for claim in result.claims()}


# --- the registry -----------------------------------------------------------------------------------------


def test_names_are_the_five_systems():
    assert scenarios.NAMES == (
        "landmark-landing",
        "relative-navigation",
        "sun-line-of-sight",
        "small-body-landing",
        "star-tracker",
    )


def test_a_later_scenario_says_which_are_available():
    later = [name for name in scenarios.NAMES if name not in scenarios.available()]
    for name in later:
        with pytest.raises(LosnavError, match="landmark-landing") as caught:
            scenarios.load(name)
        assert not isinstance(caught.value, InvalidInputError)


def test_unknown_name_and_parameter():
    with pytest.raises(InvalidInputError, match="moon"):
        scenarios.load("moon")
    with pytest.raises(InvalidInputError, match="focal_lenght"):
        scenarios.load("landmark-landing", focal_lenght=0.05)


@pytest.mark.parametrize(
    "override",
    [
        {"sampling": 0.0},
        {"sampling": np.nan},
        {"sampling": 1e6},
        {"noise": "pink"},
        {"landmarks": ((0, 0, 0), (1, 0, 0), (0, 1, 0))},
        {"landmarks": ((0, 0), (1, 0), (0, 1), (1, 1))},
        {"initial_position": (1, 2)},
        {"initial_mrp": "abc"},
        {"cold_times": ()},
        {"cold_times": (-1.0,)},
        {"cold_angles": (np.inf,)},
        {"min_landmarks": 5},
    ],
)
def test_impossible_parameters(override):
    with pytest.raises(InvalidInputError, match=next(iter(override))):
        scenarios.load("landmark-landing", **override)


def test_parameters_are_the_published_ones(landing):
    assert dataclasses.is_dataclass(landing)
    with pytest.raises(dataclasses.FrozenInstanceError):
        landing.duration = 1.0
    assert landing.landmarks == ((32.5, 0, 0), (0, 30, 0), (-31.5, 0, 0), (0, -30.5, 0))
    assert landing.los_sigma == pytest.approx(2e-5)
    assert (landing.duration, landing.sampling, landing.focal_length) == (430, 2, 0.05)
    assert (landing.cost_tolerance, landing.max_iterations) == (0.1, 10)
    assert landing.initial_rate == pytest.approx(np.radians([0.1] * 3))


def test_every_parameter_is_documented(landing):
    for field in dataclasses.fields(landing):
        assert field.name in type(landing).__doc__


# --- the descent ------------------------------------------------------------------------------------------


def test_descent_meets_both_ends(landing):
    descent = landing.descent
    assert len(descent.times) == 216
    np.testing.assert_allclose(descent.position[0], (-50, 50, 500))
    np.testing.assert_allclose(descent.position[-1], 0, atol=1e-12)
    np.testing.assert_allclose(descent.mrp[-1], 0, atol=1e-15)
    near = landing.descent_at([0.0, 1e-3, 430.0 - 1e-3, 430.0])
    np.testing.assert_allclose(
        (near.position[1] - near.position[0]) / 1e-3, landing.initial_velocity, atol=1e-4
    )
    np.testing.assert_allclose((near.position[3] - near.position[2]) / 1e-3, 0, atol=1e-4)
    # A small turn by the MRP kinematics is the body rate.
    turn = near.dcm[1] @ near.dcm[0].T
    rate = np.array([turn[1, 2], turn[2, 0], turn[0, 1]]) / 1e-3
    np.testing.assert_allclose(rate, landing.initial_rate, rtol=1e-3)


def test_descent_is_the_oracles(landing):
    descent = landing.descent
    expected = [oracle.true_pose(t) for t in descent.times]
    np.testing.assert_allclose(descent.position, [p for p, _ in expected], rtol=SAME_FORMULA, atol=1e-11)
    np.testing.assert_allclose(descent.mrp, [s for _, s in expected], rtol=SAME_FORMULA, atol=1e-15)
    los = np.stack([predict_los(oracle.LANDMARKS, *pose) for pose in expected])
    np.testing.assert_allclose(descent.los, los, atol=SAME_FORMULA)


def test_printed_sign_of_the_lines_of_sight_gives_the_mirror_camera(landing):
    """The published unit vectors assume landmarks at +z; these are at -z: they fit a camera underground."""
    los = landing.descent.los[0]
    assert (los[:, 2] < 0).all()
    solution = solve_pose(landing.landmarks, -los)
    np.testing.assert_allclose(solution.position, (-50, 50, -500), atol=1e-6)
    np.testing.assert_allclose(solution.dcm, landing.descent.dcm[0] @ np.diag([-1, -1, 1]), atol=1e-9)


def test_landmarks_leave_the_field_of_view_where_published(landing):
    descent = landing.descent_at(np.arange(0, 430.5, 1.0))
    assert np.degrees(descent.off_axis[0].max()) < 33
    off = [descent.nav_off(np.radians(angle), 4) for angle in (35, 45, 60)]
    assert [descent.times[k] for k in off] == pytest.approx([335, 357, 377], abs=1)
    assert [descent.altitude[k] for k in off] == pytest.approx([59, 36, 20], abs=1.5)


# --- the Monte Carlo --------------------------------------------------------------------------------------


def test_nees_at_three_epochs_and_overall(landing, result):
    low, high = nees_bounds(6, RUNS, BAND)
    for time in (0, 200, 400):
        epoch = int(np.argmin(abs(landing.descent.times - time)))
        assert low <= result.arrays["ml_nees"][:, epoch].mean() <= high
    low, high = nees_bounds(6, RUNS * 216, BAND)
    assert low <= result.arrays["ml_nees"].mean() <= high


def test_focal_plane_noise_is_consistent_with_its_own_covariance():
    landing = scenarios.load("landmark-landing", noise="focal-plane", sampling=10.0, cold_times=(0.0,))
    result = landing.run(50, SEED)
    nees = result.arrays["ml_nees"]
    low, high = nees_bounds(6, nees.size, BAND)
    assert low <= nees.mean() <= high
    # The bound, computed at the truth, is that covariance too.
    error = result.arrays["ml_error"]
    predicted = np.einsum("rti,tij,rtj->rt", error, np.linalg.inv(result.bound), error)
    assert low <= predicted.mean() <= high
    # Off axis a pixel is less angle: better than the tangent model at 23 to 33 degrees.
    tangent = scenarios.load("landmark-landing").run(1).sigma[0]
    assert np.all(result.sigma[0] < 0.95 * tangent)


def test_bound_at_the_start_is_the_published_one(result):
    assert result.sigma[0, :3] == pytest.approx([1.05, 1.07, 0.24], abs=0.005)
    assert np.degrees(result.sigma[0, 3:].max()) == pytest.approx(0.122, abs=0.001)


def test_warm_iterations_of_glsdc(result):
    assert result.arrays["glsdc_iterations"][:, 1:].mean() == pytest.approx(2.97, abs=0.05)


def test_every_warm_solution_converges(result):
    assert result.arrays["ml_converged"].all()


def test_cold_starts(result):
    success, converged = result.arrays["cold_lm_success"], result.arrays["cold_lm_converged"]
    assert success.mean() >= 0.995
    assert not (converged & ~success).any()
    assert result.arrays["cold_gn_success"].mean() < success.mean()


def test_without_a_guess_every_image_gives_its_pose(result):
    assert result.arrays["free_success"].all()


def test_limited_camera(result):
    camera = result.limited()
    times = result.scenario.descent.times
    assert times[camera.nav_off] == 358
    np.testing.assert_array_equal(
        camera.error[:, : camera.nav_off], result.arrays["ml_error"][:, : camera.nav_off]
    )
    # The propagated errors match the covariance carried along with them.
    error, covariance = camera.error[:, -1], camera.covariance[-1]
    nees = np.einsum("ri,ij,rj->r", error, np.linalg.inv(covariance), error).mean()
    low, high = nees_bounds(6, RUNS, BAND)
    assert low <= nees <= high


def test_a_camera_that_never_sees_enough_has_no_fix(result):
    assert np.isnan(result.limited(np.radians(10.0)).error).all()
    blind = scenarios.load("landmark-landing", half_fov=0.1)
    rows = LandingResult(blind, RUNS, SEED, result.arrays).camera_table().records()
    assert rows[0]["rms at touchdown [m]"] is None


def test_bits_do_not_depend_on_the_executor(landing, result):
    with worker_pool(2) as pool:
        parallel = landing.run(RUNS, SEED, executor=pool)
    for name, values in result.arrays.items():
        assert values.tobytes() == parallel.arrays[name].tobytes(), name


def test_resume_rebuilds_the_result(tmp_path):
    landing = scenarios.load("landmark-landing", sampling=86.0, cold_times=(0.0,))
    first = landing.run(4, SEED, out=tmp_path)
    again = landing.run(4, SEED, out=tmp_path, resume=True)
    assert {k: v.tobytes() for k, v in first.arrays.items()} == {
        k: v.tobytes() for k, v in again.arrays.items()
    }
    other = scenarios.load("landmark-landing", sampling=86.0, cold_times=(0.0,), damping=1e-2)
    with pytest.raises(InvalidInputError, match="damping"):
        other.run(4, SEED, out=tmp_path, resume=True)


# --- geometry ---------------------------------------------------------------------------------------------


def test_descent_crosses_the_danger_cylinders_where_published(landing):
    descent = landing.descent
    crossings = danger_crossings(descent.landmarks, descent.times, descent.position)
    times = sorted(time for _, time in crossings)
    assert len(times) == 4
    assert times[0] == pytest.approx(213, abs=1)
    assert times[-1] == pytest.approx(231, abs=1)


def test_cylinder_distance_is_zero_on_the_landmarks_and_minus_radius_on_the_axis():
    triple = np.array([[1.0, 0, 2], [0, 1, 2], [-1, 0, 2]])
    np.testing.assert_allclose(cylinder_distance(triple, triple), 0, atol=1e-15)
    assert cylinder_distance(triple, np.array([0.0, 0, 9])) == pytest.approx(-1)


def test_cylinder_distance_is_the_librarys(landing):
    descent = landing.descent
    expected = pose_observability(descent.landmarks[:3], descent.position).danger_cylinder_distance
    np.testing.assert_allclose(
        np.abs(cylinder_distance(descent.landmarks[:3], descent.position)), expected, atol=1e-9
    )


def test_twin_poses_disprove_uniqueness():
    assert twin_poses().valid


def test_singular_landmarks_move_along_their_lines_of_sight():
    rng = np.random.default_rng(0)
    camera, spin, velocity = rng.normal(size=(3, 3))
    landmarks = singular_landmarks(camera, spin, velocity, np.array([-2.0, -0.3, 0.5, 1.0, 3.0]))
    motion = np.cross(spin, landmarks) + velocity
    np.testing.assert_allclose(np.cross(motion, landmarks - camera), 0, atol=1e-12)


# --- claims -----------------------------------------------------------------------------------------------


def test_ten_claims_are_judged(claims):
    assert {number.rstrip("abcdef") for number in claims} == {str(k) for k in range(1, 11)}
    for claim in claims.values():
        assert claim.verdict in ("holds", "does not", "ambiguous")
        assert claim.why
        assert claim.interval[0] <= claim.value <= claim.interval[1]


def test_no_verdict_contradicts_the_established_one(claims):
    for claim in claims.values():
        assert claim.verdict in (claim.established, "ambiguous"), str(claim)
    assert sum(claim.verdict == "ambiguous" for claim in claims.values()) <= 3


def test_three_sigma_times_are_the_published_ones(claims):
    assert claims["2c"].value == pytest.approx(185, abs=2)
    assert claims["3c"].value == pytest.approx(292, abs=2)
    assert claims["2d"].value == pytest.approx(2.6, abs=0.2)


def altered(result, **changes):
    arrays = {name: changes.get(name, values) for name, values in result.arrays.items()}
    return {
        c.number: c for c in judge_claims(LandingResult(result.scenario, result.runs, result.seed, arrays))
    }


def test_verdicts_follow_the_runs(result, claims):
    a = result.arrays
    wrong = altered(result, ml_error=1.2 * a["ml_error"], ml_nees=1.44 * a["ml_nees"])
    assert claims["1a"].verdict == claims["9"].verdict == "holds"
    assert wrong["1a"].verdict == wrong["9"].verdict == "does not"
    small = altered(result, ml_error=0.1 * a["ml_error"])
    assert (small["2a"].verdict, small["2d"].verdict) == ("holds", "holds")
    quick = altered(result, lm_iterations=np.ones_like(a["lm_iterations"]))
    assert claims["5a"].verdict == claims["5b"].verdict == "does not"
    assert quick["5a"].verdict == quick["5b"].verdict == "holds"
    swapped = altered(result, cold_gn_success=a["cold_lm_success"], cold_lm_success=a["cold_gn_success"])
    assert swapped["5e"].verdict == "does not"
    assert altered(result, cold_gn_success=a["cold_gn_success"][:, ::-1])["6a"].verdict == "does not"


def test_one_run_is_judged_without_warnings():
    landing = scenarios.load("landmark-landing", sampling=86.0, cold_times=(0.0,), cold_offsets=(20.0,))
    assert len(landing.run(1).claims()) > 10


def test_tables_and_claims_read_well(result):
    table = result.table()
    assert len(table.records()) == len(table.rows)
    assert table.records()[0]["altitude [m]"] == pytest.approx(500)
    text = str(result.claims())
    assert "DOES NOT" in text
    assert str(result.claims().table()).count("\n") == len(result.claims()) + 2
    assert all(len(row) == len(table.columns) for row in table.rows)
    assert len(result.tables()[1].rows) == 3


def test_figures(result, tmp_path):
    pytest.importorskip("matplotlib")
    paths = result.plot(tmp_path)
    assert len(paths) == 7
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 20_000
    assert sorted(paths) == sorted(tmp_path.iterdir())

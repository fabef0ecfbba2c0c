"""The rendezvous: its parameters, its truth, its sensors, and verdicts that follow the runs."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import losnav as ln
from losnav import scenarios
from losnav.campaign import worker_pool
from losnav.errors import InvalidInputError
from losnav.scenarios.relative_navigation.claims import exponential, judge_claims
from losnav.scenarios.relative_navigation.result import RelativeNavigationResult
from losnav.scenarios.relative_navigation.sensing import Draws, corrected, measure, small_rotation
from losnav.scenarios.relative_navigation.study import PrintedTransition, cases, covariance_bound
from losnav.scenarios.relative_navigation.truth import Burn, fly, frame_angles, linear
from tests.conftest import SAME_FORMULA

RUNS, SEED = 60, 4


@pytest.fixture(scope="module")
def rendezvous():
    return scenarios.load("relative-navigation")


@pytest.fixture(scope="module")
def result(rendezvous):
    return rendezvous.run(RUNS, SEED)


@pytest.fixture(scope="module")
def claims(result):
    return {claim.number: claim for claim in result.claims()}


# --- parameters -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "override",
    [
        {"sampling": 0.0},
        {"sampling": np.nan},
        {"sampling": "60"},
        {"acceleration_psd": -1e-9},
        {"psd_grid": (-1e-9,)},
        {"psd_grid": ()},
        {"initial_position": (1, 2)},
        {"initial_velocity": "abc"},
        {"filter_position": (np.inf, 0, 0)},
        {"frame": "body"},
        {"short_duration": 1e5},
        {"settled": 5000.0},
        {"burn_start": 5900.0},
        {"range_sigma": 0.0},
    ],
)
def test_impossible_parameters(override):
    with pytest.raises(InvalidInputError, match=next(iter(override))):
        scenarios.load("relative-navigation", **override)


def test_parameters_are_the_published_ones(rendezvous):
    assert dataclasses.is_dataclass(rendezvous)
    with pytest.raises(dataclasses.FrozenInstanceError):
        rendezvous.duration = 1.0
    assert rendezvous.initial_position == (-520, 10, 20)
    assert rendezvous.initial_velocity == (-0.0324, -0.02, 0.02)
    assert rendezvous.approach_velocity == (0.0324, -0.02, 0.02)
    assert (rendezvous.filter_position, rendezvous.filter_velocity) == ((-510, 0, 10), (0, 0, 0))
    three_sigma = 3 * np.array([rendezvous.range_sigma, rendezvous.gps_position_sigma])
    np.testing.assert_allclose(three_sigma, (0.6, 45))
    np.testing.assert_allclose(3 * np.degrees([rendezvous.angle_sigma]), 0.1)
    np.testing.assert_allclose(3 * np.degrees([rendezvous.star_tracker_sigma]) * 60, 1)
    assert 3 * rendezvous.gps_velocity_sigma == pytest.approx(0.2)
    assert rendezvous.mean_motion == pytest.approx(1.04248275e-3, rel=1e-8)
    assert rendezvous.period == pytest.approx(6027.14, abs=0.01)


def test_every_parameter_is_documented(rendezvous):
    for field in dataclasses.fields(rendezvous):
        assert field.name in type(rendezvous).__doc__


# --- the truth --------------------------------------------------------------------------------------------


def acceleration(position, s):
    """Central term and J2, written from the textbook."""
    r = np.linalg.norm(position)
    z = 5 * position[2] ** 2 / r**2
    oblate = -1.5 * s.j2 * s.mu * s.earth_radius**2 / r**5 * position * [1 - z, 1 - z, 3 - z]
    return -s.mu * position / r**3 + oblate


def test_both_orbits_are_those_of_another_integrator(rendezvous):
    arc = rendezvous.printed

    def motion(_, y):
        both = [[y[3:6], acceleration(y[:3], rendezvous)], [y[9:], acceleration(y[6:9], rendezvous)]]
        return np.ravel(both)

    start = np.concatenate([arc.target[0], arc.chaser[0]])
    end = solve_ivp(motion, (60, 6000), start, method="DOP853", rtol=1e-13, atol=1e-9).y[:, -1]
    np.testing.assert_allclose(arc.target[-1], end[:6], atol=1e-4)
    # What the study needs is the difference.
    np.testing.assert_allclose(arc.chaser[-1] - arc.target[-1], end[6:] - end[:6], atol=1e-6)


def test_relative_velocity_is_the_rate_of_the_relative_position():
    s = scenarios.load("relative-navigation", sampling=1.0, duration=3000.0, short_duration=3000.0)
    x = s.printed.relative
    rate = (x[2:, :3] - x[:-2, :3]) / 2
    # The rate of the frame that the third axis gets from J2 is 0.3 mm/s here.
    np.testing.assert_allclose(rate, x[1:-1, 3:], rtol=0, atol=1e-6)


def test_the_printed_arc_passes_below_and_leaves(rendezvous):
    arc = rendezvous.printed
    near = int(np.argmin(arc.range))
    assert arc.times[near] == pytest.approx(2490, abs=60)
    assert arc.range[near] == pytest.approx(258, abs=1)
    assert arc.relative[near, 2] > 250  # z is nadir: below
    assert arc.relative[-1, 0] == pytest.approx(816, abs=1)


def test_the_other_sign_approaches(rendezvous):
    arc = rendezvous.approach
    along = [arc.relative[int(t / 60) - 1, 0] for t in (6000, 12000, 17340)]
    assert along == pytest.approx([-353, -186, -29], abs=1.5)


def test_the_start_is_the_relative_state_given(rendezvous):
    times = {"sampling": 1e-3, "duration": 0.01, "short_duration": 0.01, "settled": 0.0}
    s = dataclasses.replace(rendezvous, **times, burn_start=1e-3, burn_duration=1e-3)
    first = s.printed.relative[0]
    np.testing.assert_allclose(
        first[:3], np.add((-520, 10, 20), 1e-3 * np.array((-0.0324, -0.02, 0.02))), atol=1e-6
    )
    np.testing.assert_allclose(first[3:], (-0.0324, -0.02, 0.02), atol=1e-6)


def test_a_burn_adds_what_it_should(rendezvous):
    s = rendezvous
    burn = Burn(s.burn_acceleration, s.burn_start, s.burn_duration)
    quiet, burning = s.printed, fly(s, s.initial_position, s.initial_velocity, s.duration, burn)
    assert burning.control.sum(axis=0) * s.sampling == pytest.approx([1.2, 0, 0])
    before = burning.times <= s.burn_start
    np.testing.assert_allclose(burning.relative[before], quiet.relative[before], atol=1e-6)
    # The linear model with the same control explains the difference, but for the curvature of a km.
    model = ln.dynamics.ClohessyWiltshire(s.mean_motion)
    added = model.trajectory(np.zeros(6), np.concatenate([[0.0], burning.times]), burning.control)[1:]
    end = int((s.burn_start + s.burn_duration) / s.sampling) - 1
    difference = burning.relative - quiet.relative
    np.testing.assert_allclose(difference[: end + 1], added[: end + 1], atol=0.15)


def test_frames_differ_by_the_first_order_rotation(rendezvous):
    s = rendezvous
    arc = fly(s, (-2000.0, 1500.0, 300.0), (0.1, 0.5, -0.2), s.duration)
    exact = arc.pointing @ np.swapaxes(arc.target_frame, -1, -2)
    near = arc.pointing @ np.swapaxes(arc.chaser_frame, -1, -2)
    repaired = corrected(s, arc, near, arc.relative)
    error = [np.linalg.norm(ln.attitude.rotation_error(exact, m), axis=-1).max() for m in (near, repaired)]
    assert error[0] > 2e-4
    assert error[1] < 2e-6
    assert np.degrees(frame_angles(s, 10e3).max()) == pytest.approx(0.0800, abs=2e-4)


def test_linear_truth_is_the_models_own(rendezvous):
    s = rendezvous
    arc = linear(s, s.far_position, s.far_velocity, s.duration)
    offset = np.einsum("kij,kj->ki", arc.target_frame, arc.chaser[:, :3] - arc.target[:, :3])
    np.testing.assert_allclose(offset, arc.relative[:, :3], atol=1e-6)


# --- sensing ----------------------------------------------------------------------------------------------


def draws(runs, epochs, seed=0):
    return Draws.of([np.random.default_rng(k) for k in np.random.SeedSequence(seed).spawn(runs)], epochs)


def test_without_errors_the_target_is_on_the_boresight(rendezvous):
    quiet = dict.fromkeys(("star_tracker_sigma", "gps_position_sigma", "gps_velocity_sigma"), 0.0)
    s = dataclasses.replace(rendezvous, frame="target", **quiet, range_sigma=1e-12, angle_sigma=1e-15)
    m = measure(s, s.printed, draws(1, 100))
    np.testing.assert_allclose(m.z[0, :, 0], s.printed.range, rtol=SAME_FORMULA)
    np.testing.assert_allclose(m.z[0, :, 1:], 0, atol=1e-11)
    np.testing.assert_allclose(m.sensor.predict(s.printed.relative, dcm=m.dcm[0]), m.z[0], atol=1e-9)


def test_errors_have_the_sizes_asked_for(rendezvous):
    s = dataclasses.replace(rendezvous, frame="target", control_sigma=np.radians(1.0), control_bias=0.02)
    arc, runs = s.printed, 200
    m = measure(s, arc, draws(runs, 100))
    innovation = m.sensor.residual(
        m.z, m.sensor.predict(np.broadcast_to(arc.relative, (runs, 100, 6)), dcm=m.dcm)
    )
    expected = np.diag(m.sensor.noise())
    assert expected[1] == pytest.approx(s.angle_sigma**2 + s.star_tracker_sigma**2)
    np.testing.assert_allclose(innovation.var(axis=(0, 1)), expected, rtol=0.05)
    # Where the body really points: a constant part and a random one about each axis.
    np.testing.assert_allclose(m.z[..., 1].mean(), -0.02, atol=1e-3)
    np.testing.assert_allclose(m.z[..., 1:].std(axis=(0, 1)), np.radians(1.0), rtol=0.05)


def test_small_rotation_is_the_exponential():
    rng = np.random.default_rng(1)
    for size in (0.0, 1e-9, 1e-4, 4e-4, 1.0, 3.0):
        a = rng.standard_normal(3)
        a *= size / np.linalg.norm(a)
        cross = np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])
        np.testing.assert_allclose(small_rotation(a), exponential(-cross), atol=1e-14)


# --- the Monte Carlo --------------------------------------------------------------------------------------


def test_bits_do_not_depend_on_the_executor(rendezvous, result):
    with worker_pool(2) as pool:
        parallel = rendezvous.run(RUNS, SEED, executor=pool)
    assert set(parallel.arrays) == set(result.arrays)
    for name, values in result.arrays.items():
        assert values.tobytes() == parallel.arrays[name].tobytes(), name


def test_resume_rebuilds_the_result(tmp_path):
    s = scenarios.load("relative-navigation", approach_duration=6000.0)
    first = s.run(4, SEED, out=tmp_path)
    again = s.run(4, SEED, out=tmp_path, resume=True)
    assert {k: v.tobytes() for k, v in first.arrays.items()} == {
        k: v.tobytes() for k, v in again.arrays.items()
    }
    other = scenarios.load("relative-navigation", approach_duration=6000.0, acceleration_psd=1e-8)
    with pytest.raises(InvalidInputError, match="acceleration_psd"):
        other.run(4, SEED, out=tmp_path, resume=True)


def test_studies_share_their_draws(result):
    """The unvaried case is the printed arc, and a star tracker of the published size changes nothing."""
    late = result.scenario.printed.times >= result.scenario.settled
    expected = np.mean(result.arrays["printed_error"][:, late] ** 2, axis=1)
    np.testing.assert_array_equal(result.case("as published")["square"], expected)
    np.testing.assert_allclose(result.case("star tracker 1' (3-sigma)")["square"], expected, rtol=1e-9)


def test_every_case_is_named_once(rendezvous, result):
    names = [case.name for case in cases(rendezvous)]
    assert len(set(names)) == len(names) == result.arrays["case_square"].shape[1]


def test_the_printed_transition_differs_in_one_element(rendezvous):
    right = ln.dynamics.ClohessyWiltshire(rendezvous.mean_motion, 1e-9)
    printed = PrintedTransition(right)
    difference = printed.transition(np.zeros(6), 600.0) - right.transition(np.zeros(6), 600.0)
    assert [tuple(place) for place in np.argwhere(difference)] == [(0, 5)]
    state, u = np.arange(6.0), [1e-3, 2e-3, 3e-3]
    expected = right.propagate(state, 600.0, u) + difference @ state
    np.testing.assert_allclose(printed.propagate(state, 600.0, u), expected, rtol=SAME_FORMULA)


def test_the_bound_falls_as_published(rendezvous):
    sigma = covariance_bound(rendezvous, 12000.0)
    rss = 3 * np.linalg.norm(sigma[[49, 99, 199], :3], axis=1)
    assert rss == pytest.approx([0.29, 0.225, 0.150], abs=0.003)


# --- claims -----------------------------------------------------------------------------------------------


def test_nine_claims_are_judged(claims):
    assert {number.rstrip("abcdefgh") for number in claims} == {str(k) for k in range(1, 10)}
    for claim in claims.values():
        assert claim.verdict in ("holds", "does not", "ambiguous")
        assert claim.why
        assert claim.interval[0] <= claim.value <= claim.interval[1]


def test_no_verdict_contradicts_the_established_one(claims):
    for claim in claims.values():
        assert claim.verdict in (claim.established, "ambiguous"), str(claim)
    assert sum(claim.verdict == "ambiguous" for claim in claims.values()) <= 2


def altered(result, **changes):
    arrays = {name: changes.get(name, values) for name, values in result.arrays.items()}
    wrong = RelativeNavigationResult(result.scenario, result.runs, result.seed, arrays)
    return {c.number: c for c in judge_claims(wrong)}


def test_verdicts_follow_the_runs(result, claims):
    a = result.arrays
    small = altered(result, printed_error=0.1 * a["printed_error"])
    assert small["5a"].verdict == small["5b"].verdict == "holds"
    large = altered(
        result, printed_error=3 * a["printed_error"], approach_grid_square=9 * a["approach_grid_square"]
    )
    assert {large[k].verdict for k in ("4a", "4b", "5f", "6a", "6b", "6c")} == {"does not"}
    deaf = altered(result, burn_error=a["burn_error"][:, :, ::-1], burn_nis=a["burn_nis"][:, :, ::-1])
    assert deaf["7a"].verdict == deaf["7b"].verdict == "does not"
    swapped = np.array(a["case_square"])
    names = list(result.case_names)
    printed, mutated = names.index("as published"), names.index("printed sign of Φ(1,6)")
    swapped[:, [printed, mutated]] = swapped[:, [mutated, printed]]
    assert altered(result, case_square=swapped)["1c"].verdict == "holds"
    biased = np.array(a["case_bias"])
    biased[..., 2] += 20.0
    assert altered(result, case_bias=biased)["9c"].verdict == "does not"
    consistent = altered(result, printed_grid_nees=np.full_like(a["printed_grid_nees"], 6.0))
    assert claims["2b"].verdict == "does not"
    assert consistent["2b"].verdict == "holds"


def test_one_run_is_judged_without_warnings():
    s = scenarios.load("relative-navigation", approach_duration=6000.0, far_psds=(1e-6,), burn_psds=(1e-7,))
    assert len(s.run(1).claims()) > 20


def test_other_parameters_are_judged_too():
    s = scenarios.load(
        "relative-navigation",
        frame="corrected",
        psd_grid=(1e-10,),
        star_tracker_sigmas=(1e-4,),
        control_sigmas=(0.1,),
        control_biases=(0.1,),
        approach_duration=6000.0,
        control_sigma=0.01,
    )
    claims = s.run(3).claims()
    assert "2b" not in {c.number for c in claims}  # no filter without process noise was run
    assert len(claims) > 20


def test_tables_and_claims_read_well(result):
    for table in result.tables():
        assert len(table.records()) == len(table.rows)
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert result.table().records()[0]["t [s]"] == 60
    text = str(result.claims())
    assert "DOES NOT" in text
    assert str(result.claims().table()).count("\n") == len(result.claims()) + 2


def test_figures(result, tmp_path):
    pytest.importorskip("matplotlib")
    paths = result.plot(tmp_path)
    assert len(paths) == 7
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 20_000
    assert sorted(paths) == sorted(tmp_path.iterdir())

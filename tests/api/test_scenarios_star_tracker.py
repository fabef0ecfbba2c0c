"""The star-tracker scenario: its parameters, its numbers, and verdicts that follow the runs."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest

from losnav import scenarios
from losnav.campaign import worker_pool
from losnav.cli import main
from losnav.errors import InvalidInputError
from losnav.scenarios.star_tracker.judging import ARCSEC, best_angle, tried
from losnav.scenarios.star_tracker.property_claims import _levelled
from losnav.scenarios.star_tracker.result import StarTrackerResult

RUNS, SEED = 200, 4
# Too short a campaign for a shift of 4 % in variance.
UNDECIDED = {"1c"}
QUICK = {
    "search_cases": 200,
    "star_fields": 20,
    "pixel_images": 2,
    "alignments": 3,
    "alignment_frames": 10,
    "sweep_step": math.radians(2.0),
}


@pytest.fixture(scope="module")
def tracker():
    return scenarios.load("star-tracker", search_cases=2000, star_fields=60, pixel_images=4, alignments=10)


@pytest.fixture(scope="module")
def result(tracker):
    return tracker.run(RUNS, SEED)


@pytest.fixture(scope="module")
def claims(result):
    return {claim.number: claim for claim in result.claims()}


# --- parameters -------------------------------------------------------------------------------------------


def test_parameters_are_those_of_the_specification():
    tracker = scenarios.load("star-tracker")
    assert dataclasses.is_dataclass(tracker)
    with pytest.raises(dataclasses.FrozenInstanceError):
        tracker.stars = 3
    assert tracker.star_sigma / ARCSEC == pytest.approx(7.03, abs=0.005)
    assert tracker.head_sigma / ARCSEC == pytest.approx(2.50, abs=0.005)
    assert tracker.boresight_ratio == pytest.approx(7.01, abs=0.005)
    np.testing.assert_allclose(
        np.array(tracker.unequal_sigmas) / ARCSEC, [[3, 3, 24], [4, 4, 30], [5, 5, 40]]
    )
    assert math.degrees(tracker.pair_angle) == pytest.approx(43)


def test_every_parameter_is_documented(tracker):
    for field in dataclasses.fields(tracker):
        assert field.name in type(tracker).__doc__


@pytest.mark.parametrize(
    "override",
    [
        {"fov": 0.0},
        {"fov": 20.0},
        {"fov": np.nan},
        {"stars": 1},
        {"centroid_sigma": -0.1},
        {"unequal_sigmas": ((1, 1, 1),)},
        {"unequal_sigmas": ((1, 1), (1, 1), (1, 1))},
        {"check_angles": (2.5,)},
        {"check_angles": ()},
        {"third_angles": (0.1,)},
        {"noise_ratios": (1, 2)},
        {"noise_ratios": "abc"},
        {"sweep_step": 1.0},
        {"search_cases": 0},
        {"pair_angle": 4.0},
    ],
)
def test_impossible_parameters(override):
    with pytest.raises(InvalidInputError, match=next(iter(override))):
        scenarios.load("star-tracker", **override)


# --- the Monte Carlo --------------------------------------------------------------------------------------


def test_tables(result):
    rows = {row["configuration"]: row for row in result.table().records()}
    single, three = rows["single head"], rows["three heads, 90° apart"]
    assert three["1-sigma x"] == pytest.approx(1.758, abs=0.01)
    assert single["1-sigma z"] > 15
    assert three["rms z"] == pytest.approx(three["1-sigma z"], rel=0.2)
    angles = {row["angle [deg]"]: row for row in result.separation_table().records()}
    assert angles[90.0]["symmetric z"] == pytest.approx(1.758, abs=5e-4)
    assert angles[90.0]["asymmetric z"] == pytest.approx(2.110, abs=5e-4)


def test_closed_form_of_the_symmetric_sweep(tracker):
    from losnav import star_tracker

    s, k = tracker.head_sigma, tracker.boresight_ratio
    c, t = 1 - 1 / k**2, np.radians(np.linspace(0, 120, 25))
    cos = np.cos(t)
    expected = (1 + 2 * cos) / 3 / (3 - c * (1 + 2 * cos)) + (2 - 2 * cos) / 3 / (3 - c * (1 - cos))
    sigma = star_tracker.separation_sweep([tracker.head_covariance] * 3, t).sigma[:, 2]
    np.testing.assert_allclose(sigma**2 / s**2, expected, rtol=1e-10)
    assert sigma[t == np.pi / 2] == pytest.approx(s / math.sqrt(2 + 1 / k**2), rel=1e-12)


def test_bits_do_not_depend_on_the_executor():
    tracker = scenarios.load("star-tracker", **QUICK)
    alone = tracker.run(60, SEED)
    with worker_pool(2) as pool:
        parallel = tracker.run(60, SEED, executor=pool)
    assert set(alone.arrays) == set(parallel.arrays)
    for name, values in alone.arrays.items():
        assert values.tobytes() == parallel.arrays[name].tobytes(), name


def test_resume_rebuilds_the_result(tmp_path):
    tracker = scenarios.load("star-tracker", **QUICK)
    first = tracker.run(4, SEED, out=tmp_path)
    again = tracker.run(4, SEED, out=tmp_path, resume=True)
    assert {k: v.tobytes() for k, v in first.arrays.items()} == {
        k: v.tobytes() for k, v in again.arrays.items()
    }
    other = scenarios.load("star-tracker", **{**QUICK, "stars": 9})
    with pytest.raises(InvalidInputError, match="stars"):
        other.run(4, SEED, out=tmp_path, resume=True)


# --- verdicts ---------------------------------------------------------------------------------------------


def test_all_claims_are_judged_as_established(claims):
    wrong = {number for number, claim in claims.items() if not claim.as_established}
    assert wrong <= UNDECIDED
    numbers = [int(n.rstrip("abcde")) for n in claims if n[0] != "P"]
    assert set(numbers) == set(range(1, 13))
    assert {n[:2] for n in claims if n[0] == "P"} == {"P1", "P2", "P3", "P4", "P5"}


@pytest.mark.parametrize(
    ("number", "value", "tolerance"),
    [
        ("3a", 90.0, 0.01),
        ("3b", 90.0, 0.01),
        ("6", 1.758, 5e-4),
        ("7c", 0.7215, 5e-4),
        ("9a", 90.0, 0.01),
        ("9b", 0.200, 5e-3),
        ("P1a", 3**-0.5, 1e-6),
        ("P2b", 24 / 3**0.5, 1e-6),
        ("P2c", 5.30, 5e-3),
        ("P3b", 120.0, 0.1),
        ("P3d", 90.0, 0.6),
        ("P3e", 6.95 / 7.19, 1e-3),
    ],
)
def test_numbers_of_the_specification(claims, number, value, tolerance):
    assert claims[number].value == pytest.approx(value, abs=tolerance)


def test_texts_carry_the_numbers_of_the_specification(claims):
    assert "29.65%" in claims["7a"].ours
    assert "89.96%" in claims["7b"].ours
    assert "(2.56, 2.40, 3.10)″" in claims["4"].ours
    assert "(2.56, 3.10, 2.40)″" in claims["4"].ours
    assert "0.7035 of a head's, 0.5774 at 0°" in claims["P3d"].ours
    assert "2.110″ instead of 1.758″" in claims["9b"].ours


def test_measured_values_lie_where_the_covariance_puts_them(claims):
    for number in ("7a", "7b"):
        low, high = claims[number].interval
        assert low < claims[number].value < high
    low, high = claims["12a"].interval
    assert low == pytest.approx(2.475, abs=0.01)
    assert high == pytest.approx(2.475, abs=0.01)
    assert claims["12b"].value == pytest.approx(0.05, abs=0.01)
    assert claims["10a"].interval[0] < 5.0 < claims["10a"].interval[1] + 0.5
    assert claims["11a"].value == pytest.approx(1.0, abs=1e-5)
    assert claims["11c"].interval[0] > 2


def test_verdicts_follow_the_measured_errors(result):
    """The same campaign with errors a fifth larger than predicted: the covariance claims fall."""
    growth = {"_error": 1.2, "_nees": 1.2**2, "_sigma": 1.0}
    arrays = {
        name: values * next(factor for end, factor in growth.items() if name.endswith(end))
        for name, values in result.arrays.items()
    }
    spoilt = StarTrackerResult(result.scenario, result.runs, result.seed, arrays)
    verdicts = {claim.number: claim.verdict for claim in spoilt.claims()}
    for number in ("1a", "1b", "2", "10a", "10b"):
        assert verdicts[number] == "does not", number


def test_verdicts_follow_the_parameters():
    """Heads of a field as wide as 120° have k near 1: other gains, and other claims hold."""
    wide = scenarios.load(
        "star-tracker", **QUICK, fov=math.radians(120), unequal_sigmas=((2e-5, 2e-5, 4e-5),) * 3
    )
    claims = {claim.number: claim for claim in wide.run(20, 1).claims()}
    assert claims["7a"].verdict == "does not"
    assert claims["8"].verdict == "does not"
    assert claims["4"].verdict == "does not"
    assert claims["P2e"].verdict == "holds"


def test_a_single_violation_decides():
    violated = np.zeros(100, dtype=bool)
    assert tried("1", "-", violated, "-", established="holds").verdict == "holds"
    violated[3] = True
    claim = tried("1", "-", violated, "-", established="holds")
    assert claim.verdict == "does not"
    assert claim.interval[0] < 0.01 < claim.interval[1]


def test_best_angle():
    assert best_angle(lambda a: (a - 1.234567) ** 2, 0.0, 2.0, 0.01) == pytest.approx(1.234567, abs=1e-6)
    assert best_angle(np.cos, 0.0, 2.0, 0.1) == pytest.approx(2.0)


def test_any_covariance_can_be_levelled(rng):
    for _ in range(50):
        root = rng.standard_normal((3, 3))
        covariance = root @ root.T
        level = _levelled(covariance)
        np.testing.assert_allclose(np.diag(level), np.trace(covariance) / 3, rtol=1e-10)
        np.testing.assert_allclose(np.linalg.eigvalsh(level), np.linalg.eigvalsh(covariance), rtol=1e-9)


# --- figures and commands ---------------------------------------------------------------------------------


def test_figures(result, tmp_path):
    pytest.importorskip("matplotlib")
    paths = result.plot(tmp_path)
    assert len(paths) == len({p.name for p in paths}) == 8
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 10_000


def test_commands(capsys, tmp_path):
    settings = [f"--set={key}={value}" for key, value in QUICK.items()]
    command = ["run", "star-tracker", "--runs", "5", "--set=mounting_error=10arcsec", *settings]
    assert main([*command, "--out", str(tmp_path), "--no-plot", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parameters"]["mounting_error"] == pytest.approx(10 * ARCSEC)
    assert len(report["tables"]) == 2
    assert main(["run", "star-tracker", "--set=fov=200deg"]) == 2
    assert "fov" in capsys.readouterr().err

"""The landing: its parameters, its world, its measurements, and verdicts that follow the runs."""

from __future__ import annotations

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from numpy.random import SeedSequence

from losnav import scenarios
from losnav.errors import InvalidInputError
from losnav.scenarios.small_body_landing.claims import judge_claims
from losnav.scenarios.small_body_landing.information_claims import model_error_information, ranks
from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult, convergence
from losnav.scenarios.small_body_landing.sensing import measure
from losnav.scenarios.small_body_landing.shape import built_in, read_shape
from losnav.scenarios.small_body_landing.truth import fly, nearby_errors, polyhedron, shape_harmonics

RUNS, SEED = 6, 2
# A short descent from lower down, so that a campaign takes seconds.
SHORT = {
    "start_position": (60.0, -40.0, 300.0),
    "start_velocity": (-0.5, 0.4, -3.0),
    "duration": 120.0,
    "settled": 40.0,
    "outage_start": 50.0,
    "outage_duration": 50.0,
    "outage_images": 10.0,
    "gravity_errors": (0.0, 1.0),
    "landmark_rings": 8.0,
}


@pytest.fixture(scope="module")
def short():
    return scenarios.load("small-body-landing", **SHORT)


@pytest.fixture(scope="module")
def result(short):
    return short.run(RUNS, SEED)


@pytest.fixture(scope="module")
def claims(result):
    return {claim.number: claim for claim in result.claims()}


# --- parameters -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "override",
    [
        {"duration": 0.0},
        {"duration": np.nan},
        {"duration": 600.5},
        {"sampling": 0.25},
        {"imu": "perfect"},
        {"shape": 3},
        {"start_position": (1, 2)},
        {"gravity_errors": ()},
        {"gravity_errors": (-0.1,)},
        {"latencies": (0.5,)},
        {"outage_start": 500.0},
        {"outage_images": 0.7},
        {"settled": 600.0},
        {"landmark_sigma": -1.0},
        {"landmark_rings": 0.5},
        {"attitude_sigma": 0.0},
        {"c20": "flat"},
        {"mu": -1.0},
    ],
)
def test_impossible_parameters(override):
    with pytest.raises(InvalidInputError, match=next(iter(override))):
        scenarios.load("small-body-landing", **override)


def test_parameters_are_documented():
    scenario = scenarios.load("small-body-landing")
    assert dataclasses.is_dataclass(scenario)
    for field in dataclasses.fields(scenario):
        assert field.name in type(scenario).__doc__
    assert scenario.focal_length_px == pytest.approx(500.0)
    assert [n.name for n in scenario.filters][:2] == ["EKF, tight", "predictive"]
    assert scenario.unit.accelerometer_bias == pytest.approx(50e-6 * 9.80665)


# --- the world --------------------------------------------------------------------------------------------


def test_gravity_at_the_site():
    """4.5 mm/s^2 at the site and 2.9 mm/s^2 two kilometres up, and a field without divergence."""
    flight = fly(scenarios.load("small-body-landing"))
    places = flight.site.to_fixed(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2000.0]]))
    size = np.linalg.norm(flight.gravity.acceleration(places), axis=-1)
    np.testing.assert_allclose(size, [4.5e-3, 2.93e-3], rtol=0.01)
    assert abs(np.trace(flight.gravity.gradient(places[0]))) < 1e-18


def test_the_built_in_shape_is_a_body():
    shape = built_in()
    edges = np.sort(shape.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges, axis=0, return_counts=True)
    assert (count == 2).all()
    assert shape.volume > 0
    # About its centre of mass in principal axes: no harmonics of degree 1, none of C21, S21, S22.
    c, s = shape.harmonics(4, 16e3)
    np.testing.assert_allclose([*c[1], *s[1], c[2, 1], s[2, 1], s[2, 2]], 0, atol=1e-12)
    assert c[0, 0] == pytest.approx(1.0)
    assert (shape.normals() * shape.corners.mean(axis=1)).sum(axis=-1).min() > 0


def test_harmonics_of_the_shape_are_its_field_far_away():
    scenario = scenarios.load("small-body-landing")
    directions = np.random.default_rng(0).normal(size=(20, 3))
    places = 80e3 * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    exact, series = (field(scenario).acceleration(places) for field in (polyhedron, shape_harmonics))
    # What is left is degree 6: (16/80)^6 of a few per cent.
    assert (np.linalg.norm(series - exact, axis=1) / np.linalg.norm(exact, axis=1)).max() < 1e-4
    assert nearby_errors(scenario).min() > 0.2


def test_shapes_from_files(tmp_path, data_folder):
    shape = built_in()
    np.savez(tmp_path / "body.npz", vertices=shape.vertices, faces=shape.faces)
    np.testing.assert_array_equal(read_shape(str(tmp_path / "body.npz")).vertices, shape.vertices)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in (shape.vertices / 1e3).tolist())
    text += "".join(f"f {i} {j}/1 {k}\n" for i, j, k in (shape.faces + 1).tolist())
    (tmp_path / "body.obj").write_text(text)
    np.testing.assert_allclose(read_shape(str(tmp_path / "body.obj")).vertices, shape.vertices, atol=1e-6)
    # The real one: its harmonics are the measured ones to two per cent.
    c, s = read_shape(str(data_folder / "eros.npz")).harmonics(4, 16e3)
    normal = np.sqrt(5.0)
    assert c[2, 0] / normal == pytest.approx(-5.24618e-2, rel=0.02)
    assert c[2, 2] / np.sqrt(2 * 5 / 24) == pytest.approx(8.23994e-2, rel=0.02)
    assert s[2, 2] / np.sqrt(2 * 5 / 24) == pytest.approx(-2.81096e-2, rel=0.02)
    np.savez(tmp_path / "inside_out.npz", vertices=shape.vertices, faces=shape.faces[:, ::-1])
    for name in ("inside_out.npz", "absent.npz"):
        with pytest.raises(InvalidInputError, match="shape"):
            read_shape(str(tmp_path / name))


def test_the_same_draws_in_every_study(short):
    flight, seeds = fly(short), SeedSequence(1).spawn(3)
    a, b = measure(flight, seeds), measure(flight, seeds[1:])
    np.testing.assert_array_equal(a.controls[1:], b.controls)
    np.testing.assert_array_equal(a.pixels[1:], b.pixels)
    other = measure(flight, seeds, map_sigma=0.0)
    np.testing.assert_array_equal(a.velocity, other.velocity)
    seen = ~np.isnan(a.pixels)
    np.testing.assert_array_equal(seen, ~np.isnan(other.pixels))
    assert (seen.sum(axis=-1) == 6).all()


def test_workers_do_not_matter(short, result):
    with ThreadPoolExecutor(2) as pool:
        again = short.run(RUNS, SEED, executor=pool)
    for name, array in result.arrays.items():
        np.testing.assert_array_equal(array, again.arrays[name])


# --- results ----------------------------------------------------------------------------------------------


def test_convergence_is_from_the_last_bad_epoch():
    times, limits = np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 1.0, 1.0])
    error = np.full((3, 4, 3), 0.5)
    error[0, 1, 2] = 2.0
    error[1, 3, 0] = 2.0
    np.testing.assert_array_equal(convergence(error, times, limits), [3.0, np.inf, 1.0])


def test_arrays_and_tables(short, result):
    runs, epochs, filters = RUNS, 120, len(short.filters)
    assert result.arrays["square"].shape == (runs, 2, filters, epochs, 3)
    assert result.arrays["error"].shape == (runs, filters, epochs, 9)
    np.testing.assert_allclose(
        np.square(result.arrays["error"][..., :3]).sum(axis=-1), result.arrays["square"][:, 1, ..., 0]
    )
    for table in result.tables():
        assert len(table.records()) == len(table.rows)
        assert all(len(row) == len(table.columns) for row in table.rows)
    assert len(result.table().rows) == 2 * filters


def test_claims_of_a_short_descent(claims):
    expected = {
        "1a": "holds",
        "1d": "does not",
        "3a": "holds",
        "3e": "does not",
        "5a": "holds",
        "5b": "does not",
        "6a": "does not",
        "6b": "does not",
        "7a": "holds",
        "8a": "does not",
        "8b": "does not",
    }
    assert {number: claims[number].verdict for number in expected} == expected
    assert len(claims) > 30


def test_what_the_sensors_see(result):
    degree, cylinder = ranks(result)
    assert degree.min() > 1e-6
    assert cylinder < 1e-12
    camera, velocimeter = model_error_information(result)
    assert velocimeter == pytest.approx(1e4)
    assert 0 < camera.max() < 10


def altered(result, **arrays):
    changed = {**result.arrays, **arrays}
    made = SmallBodyLandingResult(result.scenario, result.runs, result.seed, changed)
    return {claim.number: claim for claim in judge_claims(made)}


def test_verdicts_follow_the_runs(result):
    a, names = result.arrays, result.names
    swapped = np.array(a["square"])
    i, j = names.index("EKF, tight"), names.index("EKF, acceleration")
    swapped[:, :, [i, j]] = swapped[:, :, [j, i]]
    changed = altered(result, square=swapped)
    assert changed["1a"].verdict == "does not"
    assert changed["1d"].verdict == "holds"
    late = np.array(a["latency_square"])
    assert altered(result, latency_square=late[:, ::-1])["8b"].verdict == "holds"
    nees = np.full_like(a["map_nees"], 9.0)
    consistent = altered(result, map_nees=nees)
    assert [consistent[f"8{letter}"].verdict for letter in "def"] == ["holds"] * 3
    gone = altered(result, lost_distance=np.full_like(a["lost_distance"], 1e3))
    assert gone["8h"].verdict == "does not"
    blind = altered(result, disturbance=np.zeros_like(a["disturbance"]))
    assert blind["6c"].verdict == "does not"
    assert altered(result, perfect_square=np.ones((RUNS, 2)))["3e"].verdict == "holds"


def test_figures(result, tmp_path):
    pytest.importorskip("matplotlib")
    paths = result.plot(tmp_path)
    assert len(paths) == 8
    for path in paths:
        assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
        assert path.stat().st_size > 20_000
    assert sorted(paths) == sorted(tmp_path.iterdir())

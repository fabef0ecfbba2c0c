"""Every line of docs/conventions.md has a test: this table says which, and that it exists.

A line whose subject is not in the library yet names the reason instead; the line must then be absent from
the public names.
"""

import ast
import re

import pytest

import losnav
from tests.conftest import REPOSITORY

PAGE = REPOSITORY / "docs" / "conventions.md"

# Subject of the table's line -> tests that would fail if it were broken, as file::function.
TESTED = {
    "units": [
        "tests/api/test_fuzz.py::test_unit_of_length_does_not_matter",
        "tests/parity/test_sun_filter.py::test_the_filter_knows_no_units",
    ],
    "vectors, batches": [
        "tests/api/test_shapes.py::test_conversions",
        "tests/api/test_shapes.py::test_los_functions",
        "tests/api/test_shapes.py::test_solve_pose",
        "tests/api/test_objects.py::test_solving_releases_the_interpreter",
    ],
    "frames in names": [
        "tests/reference/test_attitude_scipy.py::test_from_mrp",
        "tests/parity/test_los_parity.py::test_predict_los",
    ],
    "mrp": [
        "tests/parity/test_attitude_parity.py::test_conversion",
        "tests/laws/test_attitude_laws.py::test_round_trips_from_a_dcm",
    ],
    "quaternion": [
        "tests/reference/test_attitude_scipy.py::test_from_quaternion",
        "tests/reference/test_attitude_scipy.py::test_from_dcm",
    ],
    "attitude error": [
        "tests/laws/test_attitude_laws.py::test_rotation_error_inverts_the_exponential",
        "tests/statistics/test_efficiency.py::test_nees_with_the_reported_covariance",
    ],
    "error sense": ["tests/reference/test_real_cameras.py::test_optimum_and_covariance"],
    "tangent order": ["tests/parity/test_los_parity.py::test_fisher_information"],
    "los": [
        "tests/parity/test_los_parity.py::test_predict_los",
        "tests/parity/test_pose_parity.py::test_mirror_pose_of_a_flipped_sign",
        "tests/parity/test_celestial_sensors.py::test_the_default_is_the_geometric_direction",
    ],
    "camera": [
        "tests/parity/test_lander_sensors.py::test_axes_of_the_camera",
        "tests/parity/test_lander_sensors.py::test_a_landmark_behind_the_camera_is_an_error_not_a_mirrored_pixel",
    ],
    "covariance": [
        "tests/api/test_bad_input.py::test_covariances_must_be_covariances",
        "tests/api/test_objects.py::test_covariance_is_symmetric_positive_definite",
    ],
    "landing site": [
        "tests/api/test_landing_site.py::test_site_on_body",
        "tests/parity/test_strapdown.py::test_inertial_frame_cross_check",
        "tests/parity/test_strapdown.py::test_centrifugal_acceleration_is_about_the_centre_of_mass",
    ],
    "navigation state": [
        "tests/api/test_navigation_state.py::test_which_parts_an_error_of_a_size_moves",
        "tests/parity/test_strapdown.py::test_transition_by_complex_step",
    ],
    "gravity": [
        "tests/parity/test_gravity.py::test_harmonics_against_the_oracle",
        "tests/parity/test_gravity.py::test_normalised_and_unnormalised_are_the_same_field",
    ],
    "lvlh": [
        "tests/parity/test_dynamics.py::test_transition_and_response",
        "tests/parity/test_dynamics.py::test_the_printed_sign_of_entry_1_6_is_wrong",
        "tests/parity/test_orbits.py::test_axes",
        "tests/parity/test_orbits.py::test_the_velocity_is_the_derivative_of_the_position",
    ],
    "constants": ["tests/parity/test_two_body.py::test_constants_are_those_of_the_conventions"],
    "innovation": [
        "tests/api/test_filter.py::test_an_angle_across_its_cut_is_a_small_innovation",
        "tests/api/test_filter.py::test_a_unit_vector_measures_two_numbers",
    ],
    "random numbers": ["tests/statistics/test_robust.py::test_the_seed_decides"],
}

# Subject -> public names that would bring it into the library.
NOT_YET: dict[str, set[str]] = {}


def subjects():
    """First column of the conventions table, in plain lower-case words."""
    rows = re.findall(r"^\|([^|]+)\|.*\|\s*$", PAGE.read_text(encoding="utf-8"), flags=re.M)
    names = [re.sub(r"[`*]|\(.*", "", row).strip().lower() for row in rows]
    return [name for name in names if name and name not in {"thing"} and not set(name) <= set("-: ")]


def matching(subject, table):
    """Key of ``table`` that a line's subject starts with."""
    return next((key for key in table if subject.startswith(key)), None)


@pytest.mark.skipif(not PAGE.exists(), reason="docs/conventions.md is not written yet")
def test_every_line_is_accounted_for():
    found = subjects()
    public = {*losnav.__all__, *losnav.dynamics.__all__, *losnav.sensors.__all__}
    assert len(found) >= 10
    for subject in found:
        if matching(subject, TESTED):
            continue
        later = matching(subject, NOT_YET)
        assert later, f"no test is named for the convention '{subject}'"
        assert not NOT_YET[later] & public, f"'{subject}' is in the library: name its test"


@pytest.mark.parametrize("node", sorted({node for nodes in TESTED.values() for node in nodes}))
def test_named_tests_exist(node):
    path, name = node.split("::")
    tree = ast.parse((REPOSITORY / path).read_text(encoding="utf-8"))
    assert name in {n.name for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)}

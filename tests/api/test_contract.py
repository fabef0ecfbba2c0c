"""Names, order and defaults of the public functions: what user code is written against."""

import inspect

import pytest

import losnav as ln
from tests.api.calls import LANDMARKS, LOS

POSITIONAL = {
    "attitude.dcm_from_mrp": ["mrp"],
    "attitude.mrp_from_dcm": ["dcm"],
    "attitude.dcm_from_quaternion": ["q"],
    "attitude.quaternion_from_dcm": ["dcm"],
    "attitude.mrp_from_quaternion": ["q"],
    "attitude.quaternion_from_mrp": ["mrp"],
    "attitude.mrp_shadow": ["mrp"],
    "attitude.rotation_error": ["dcm_true", "dcm_estimate"],
    "predict_los": ["landmarks", "position", "mrp"],
    "los_jacobian": ["landmarks", "position", "mrp"],
    "solve_pose": ["landmarks", "los"],
    "solve_pose_robust": ["landmarks", "los"],
    "solve_attitude": ["body", "reference"],
    "solve_attitude_robust": ["body", "reference"],
    "fisher_information": ["landmarks", "position", "mrp", "sigma"],
    "pose_observability": ["landmarks", "position"],
}
SOLVE_POSE_DEFAULTS = {
    "sigma": 1.0,
    "covariance": None,
    "guess": None,
    "method": "lm",
    "parametrization": "rotation",
    "loss": "squared",
    "loss_scale": None,
    "damping": 1e-3,
    "max_iterations": 50,
    "cost_tolerance": 1e-12,
    "step_tolerance": 1e-12,
    "on_error": "raise",
}
ROBUST_DEFAULTS = {"max_outlier_ratio": 0.6, "confidence": 0.9999, "seed": 0, "on_error": "raise"}
SOLVE_ATTITUDE_DEFAULTS = {
    "sigma": 1.0,
    "covariance": None,
    "method": "quest",
    "polish": True,
    "on_error": "raise",
}
ATTITUDE_FIELDS = [
    "dcm",
    "quaternion",
    "mrp",
    "covariance",
    "information",
    "loss",
    "chi2",
    "dof",
    "rank",
    "free_axis",
    "converged",
    "inliers",
]
SOLUTION_FIELDS = [
    "position",
    "mrp",
    "dcm",
    "quaternion",
    "covariance",
    "cost",
    "chi2",
    "dof",
    "iterations",
    "termination",
    "converged",
    "alternatives",
    "observability",
]


def parameters(name):
    thing = ln
    for part in name.split("."):
        thing = getattr(thing, part)
    return inspect.signature(thing).parameters


@pytest.mark.parametrize("name", POSITIONAL)
def test_positional_arguments(name):
    """In this order, usable by position and by name; whatever follows is optional."""
    found = parameters(name)
    expected = POSITIONAL[name]
    assert list(found)[: len(expected)] == expected
    for argument in expected:
        assert found[argument].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
    for argument in list(found)[len(expected) :]:
        assert found[argument].default is not inspect.Parameter.empty or argument == "sigma"


@pytest.mark.parametrize(
    ("name", "defaults"),
    [
        ("solve_pose", SOLVE_POSE_DEFAULTS),
        ("solve_pose_robust", ROBUST_DEFAULTS),
        ("solve_attitude", SOLVE_ATTITUDE_DEFAULTS),
        ("solve_attitude_robust", ROBUST_DEFAULTS),
    ],
)
def test_options_are_keywords_with_these_defaults(name, defaults):
    found = parameters(name)
    for option, default in defaults.items():
        assert found[option].kind is inspect.Parameter.KEYWORD_ONLY, option
        assert found[option].default == default, option


def test_robust_sigma_is_required():
    """What counts as wrong depends on it: no default can be right."""
    sigma = parameters("solve_pose_robust")["sigma"]
    assert sigma.kind is inspect.Parameter.KEYWORD_ONLY
    with pytest.raises((ln.InvalidInputError, TypeError), match="sigma"):
        ln.solve_pose_robust(LANDMARKS, LOS)


@pytest.mark.parametrize("field", SOLUTION_FIELDS)
def test_solution_fields(field):
    assert hasattr(ln.PoseSolution, field)


@pytest.mark.parametrize("field", ATTITUDE_FIELDS)
def test_attitude_fields(field):
    assert hasattr(ln.AttitudeSolution, field)


@pytest.mark.parametrize(
    "member", ["GRADIENT", "STEP", "COST", "MAX_ITERATIONS", "DAMPING_EXHAUSTED", "SINGULAR", "NON_FINITE"]
)
def test_terminations(member):
    assert member in ln.Termination.__members__


def test_everything_listed_exists():
    for name in ln.__all__:
        assert hasattr(ln, name), name
    assert isinstance(ln.__version__, str)

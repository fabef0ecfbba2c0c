"""Bad input is one InvalidInputError that names the argument, the place and the rule."""

import numpy as np
import pytest

import losnav as ln
from losnav import InvalidInputError
from tests.api.calls import (
    BODY,
    CALLS,
    COVARIANCE,
    DOORS,
    GUESS,
    LANDMARKS,
    LOS,
    MRP,
    POSITION,
    REFERENCE,
    SIGMA,
    same,
)

# A covariance with NaN in it breaks its own rule first.
NUMBER_RULE = {"covariance": "symmetric positive definite|finite"}


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_non_finite_values(name, argument, bad):
    """Wherever it stands: first, last, or in between with good numbers behind it."""
    call = CALLS[name]
    size = call.arrays[argument].size
    for place in {0, size // 2, size - 1}:
        value = call.arrays[argument].copy()
        value.flat[place] = bad
        rule = NUMBER_RULE.get(argument, "finite")
        with pytest.raises(InvalidInputError, match=rf"{argument}.*({rule})"):
            call(**{argument: value})


@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_the_index_is_named(name, argument):
    """The last entry of the argument is bad: its row or its column stands in the brackets."""
    call = CALLS[name]
    value = call.arrays[argument].copy()
    index = tuple(n - 1 for n in value.shape)
    value[index] = np.nan
    with pytest.raises(InvalidInputError, match=rf"{argument}\[(\d+, )*{index[0]}[],]"):
        call(**{argument: value})


@pytest.mark.parametrize(
    "bad",
    [
        "text",
        None,
        object(),
        {},
        [[1, 2], [3]],
        np.array(["a", "b", "c"]),
        1j * np.ones(3),
        np.datetime64(1, "s"),
    ],
    ids=["str", "None", "object", "dict", "ragged", "string array", "complex", "datetime"],
)
@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_things_that_are_no_numbers(name, argument, bad):
    may_be_absent = argument in {"guess", "covariance", "control", "target"}
    absent_here = {
        ("SunDirection.predict", "dcm"),
        ("BodyDirection.predict", "dcm"),
        ("LandmarkCamera.predict", "landmarks"),
    }
    if bad is None and (may_be_absent or (name, argument) in absent_here):
        return
    with pytest.raises(InvalidInputError, match=argument):
        CALLS[name](**{argument: bad})


@pytest.mark.parametrize(("name", "argument"), DOORS)
def test_wrong_core_shapes(name, argument):
    if name == "noise.isotropic" or argument in {"ra", "dec"}:
        return  # any number of directions will do
    call = CALLS[name]
    value = call.arrays[argument]
    wrong = [value[..., :-1], np.concatenate([value, value], axis=-1)]
    if argument in {"sigma", "sigma_focal", "ranges"}:
        wrong = [value[:-1], np.append(value, 1.0)]
    else:
        wrong.append(np.float64(1.0))
    for bad in wrong:
        with pytest.raises(InvalidInputError, match=argument):
            call(**{argument: bad})


@pytest.mark.parametrize("name", [n for n in CALLS if "landmarks" in CALLS[n].arrays])
def test_no_landmarks_at_all(name):
    call = CALLS[name]
    empty = {
        argument: value[:0]
        for argument, value in call.arrays.items()
        if len(value) == len(LANDMARKS) and argument not in {"guess", "state"}
    }
    with pytest.raises(InvalidInputError, match="landmarks"):
        call(**empty)


@pytest.mark.parametrize("count", [1, 2])
def test_too_few_landmarks(count):
    for function in (ln.solve_pose, ln.solve_pose_robust):
        with pytest.raises(InvalidInputError, match=r"landmarks.*(3|4)"):
            function(LANDMARKS[:count], LOS[:count], sigma=1e-4)


def test_counts_that_differ():
    with pytest.raises(InvalidInputError, match=r"los|landmarks"):
        ln.solve_pose(LANDMARKS, LOS[:-1], sigma=1e-4)


def test_duplicate_landmarks():
    landmarks = LANDMARKS.copy()
    landmarks[4] = landmarks[1]
    with pytest.raises(InvalidInputError, match=r"landmarks\[4\].*duplicate.*\[1\]"):
        ln.solve_pose(landmarks, LOS, sigma=1e-4)


def test_one_landmark_matched_twice_is_a_mismatch():
    """The robust solver may be told of two directions to one landmark: it keeps the right one."""
    landmarks, los = np.vstack([LANDMARKS, LANDMARKS[1]]), np.vstack([LOS, LOS[4]])
    solution = ln.solve_pose_robust(landmarks, los, sigma=1e-4)
    assert solution.converged
    assert solution.inliers.tolist() == [True] * 6 + [False]


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.1, 2.0, 1e300, -2.0])
def test_directions_that_are_not_unit(factor):
    los = LOS.copy()
    los[2] *= factor
    for function in (ln.solve_pose, ln.solve_pose_robust):
        with pytest.raises(InvalidInputError, match=r"los\[2\].*unit"):
            function(LANDMARKS, los, sigma=1e-4)


def test_directions_with_isotropic_noise_are_welcome(rng):
    """Model 1 of the noise leaves directions unnormalised by a few sigma."""
    noisy = LOS + 1e-3 * rng.standard_normal(LOS.shape)
    assert ln.solve_pose(LANDMARKS, noisy, sigma=1e-3).converged


@pytest.mark.parametrize("bad", [0.0, -1.0, -0.0])
def test_sigma_must_be_positive(bad):
    for function in (ln.solve_pose, ln.solve_pose_robust):
        with pytest.raises(InvalidInputError, match=r"sigma.*positive"):
            function(LANDMARKS, LOS, sigma=bad)
        sigma = SIGMA.copy()
        sigma[3] = bad
        with pytest.raises(InvalidInputError, match=r"sigma\[3.*positive"):
            function(LANDMARKS, LOS, sigma=sigma)
    with pytest.raises(InvalidInputError, match=r"sigma.*positive"):
        ln.fisher_information(LANDMARKS, POSITION, MRP, bad)


@pytest.mark.parametrize(
    "bad",
    [np.diag([1.0, 1, -1]), np.zeros((3, 3)), [[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], -np.eye(3)],
    ids=["indefinite", "zero", "asymmetric", "negative"],
)
def test_covariances_must_be_covariances(bad):
    covariance = COVARIANCE.copy()
    covariance[2] = np.array(bad) * 1e-8
    with pytest.raises(InvalidInputError, match=r"covariance\[2\].*symmetric positive"):
        ln.solve_pose(LANDMARKS, LOS, covariance=covariance, guess=GUESS)


@pytest.mark.parametrize(
    ("option", "bad"),
    [
        ("method", "newton"),
        ("parametrization", "euler"),
        ("loss", "l1"),
        ("loss_scale", -1.0),
        ("loss_scale", np.nan),
        ("damping", -1.0),
        ("damping", np.nan),
        ("max_iterations", -1),
        ("cost_tolerance", -1.0),
        ("step_tolerance", np.nan),
        ("on_error", "ignore"),
    ],
)
def test_options(option, bad):
    options = {option: bad}
    if option == "loss_scale":
        options["loss"] = "huber"
    with pytest.raises(InvalidInputError, match=option):
        ln.solve_pose(LANDMARKS, LOS, sigma=1e-4, guess=GUESS, **options)


@pytest.mark.parametrize(
    ("option", "bad"),
    [
        ("max_outlier_ratio", -0.1),
        ("max_outlier_ratio", 1.0),
        ("max_outlier_ratio", np.nan),
        ("confidence", 0.0),
        ("confidence", 1.0),
        ("confidence", np.nan),
        ("seed", -1),
    ],
)
def test_robust_options(option, bad):
    with pytest.raises(InvalidInputError, match=option):
        ln.solve_pose_robust(LANDMARKS, LOS, sigma=1e-4, **{option: bad})


@pytest.mark.parametrize("name", ["mrp_from_dcm", "quaternion_from_dcm"])
@pytest.mark.parametrize(
    "bad",
    [2 * np.eye(3), np.diag([1.0, 1, -1]), np.zeros((3, 3)), np.ones((3, 3)), np.eye(3) + 1e-3],
    ids=["scaled", "mirror", "zero", "ones", "sheared"],
)
def test_matrices_that_are_not_rotations(name, bad):
    with pytest.raises(InvalidInputError, match=r"dcm.*rotation"):
        CALLS[name](dcm=bad)
    with pytest.raises(InvalidInputError, match=r"dcm\[1\].*rotation"):
        CALLS[name](dcm=np.array([np.eye(3), bad]))


@pytest.mark.parametrize("name", ["dcm_from_quaternion", "mrp_from_quaternion"])
@pytest.mark.parametrize("bad", [[0, 0, 0, 0], [0, 0, 0, 2], [1, 1, 1, 1.0]])
def test_quaternions_that_are_not_unit(name, bad):
    with pytest.raises(InvalidInputError, match=r"q.*unit"):
        CALLS[name](q=np.array(bad))


def test_observer_on_a_landmark():
    for function in (ln.predict_los, ln.los_jacobian):
        with pytest.raises(InvalidInputError, match=r"landmark.*3|position"):
            function(LANDMARKS, LANDMARKS[3], MRP)
    with pytest.raises(InvalidInputError, match=r"landmark.*3|position"):
        ln.fisher_information(LANDMARKS, LANDMARKS[3], MRP, 1e-4)


def test_shadow_of_zero():
    """The identity has no finite shadow: an answer of NaN or infinity would be silent."""
    with pytest.raises(InvalidInputError, match="mrp"):
        ln.attitude.mrp_shadow(np.zeros(3))


def test_batches_that_do_not_broadcast():
    with pytest.raises(InvalidInputError, match=r"position|mrp"):
        ln.predict_los(LANDMARKS, np.ones((2, 3)), np.ones((3, 3)))
    with pytest.raises(InvalidInputError, match=r"guess|los"):
        ln.solve_pose(LANDMARKS, np.stack([LOS] * 2), sigma=1e-4, guess=np.stack([GUESS] * 3))


# --- attitude from vectors ----------------------------------------------------------------------------


def test_no_directions_at_all():
    with pytest.raises(InvalidInputError, match=r"body.*at least 1"):
        ln.solve_attitude(BODY[:0], REFERENCE[:0])


def test_directions_without_a_partner():
    with pytest.raises(InvalidInputError, match=r"reference.*each of the 6 of body, got 5"):
        ln.solve_attitude(BODY, REFERENCE[:-1])


@pytest.mark.parametrize("factor", [0.0, 0.5, 1.1, 2.0, 1e300, -2.0])
@pytest.mark.parametrize("argument", ["body", "reference"])
def test_attitude_directions_that_are_not_unit(argument, factor):
    arrays = {"body": BODY.copy(), "reference": REFERENCE.copy()}
    arrays[argument][2] *= factor
    with pytest.raises(InvalidInputError, match=rf"{argument}\[2\].*unit"):
        ln.solve_attitude(**arrays)


@pytest.mark.parametrize("bad", [-1.0, 1e-200, 1e200])
def test_attitude_sigma_must_be_a_noise(bad):
    with pytest.raises(InvalidInputError, match=r"sigma\[0\].*>= 0"):
        ln.solve_attitude(BODY, REFERENCE, sigma=bad)
    sigma = SIGMA.copy()
    sigma[3] = bad
    with pytest.raises(InvalidInputError, match=r"sigma\[3\].*>= 0"):
        ln.solve_attitude(BODY, REFERENCE, sigma=sigma)


def test_only_one_direction_can_be_exact():
    sigma = SIGMA.copy()
    sigma[[1, 4]] = 0.0
    for given in (sigma, np.stack([SIGMA, sigma])):
        with pytest.raises(InvalidInputError, match=r"sigma\[4\].*sigma\[1\] is 0 already"):
            ln.solve_attitude(BODY, REFERENCE, sigma=given)
    for given in (0.0, np.zeros(1)):
        with pytest.raises(InvalidInputError, match=r"sigma\[1\].*only one"):
            ln.solve_attitude(BODY, REFERENCE, sigma=given)
    assert ln.solve_attitude(BODY[:1], REFERENCE[:1], sigma=0.0).rank == 2


@pytest.mark.parametrize(("option", "bad"), [("method", "triad"), ("on_error", "ignore")])
def test_attitude_options(option, bad):
    with pytest.raises(InvalidInputError, match=option):
        ln.solve_attitude(BODY, REFERENCE, **{option: bad})


@pytest.mark.parametrize("method", ["quest", "svd"])
def test_one_bad_attitude_of_a_batch(method):
    body = np.stack([BODY] * 21)
    good = ln.solve_attitude(body, REFERENCE, sigma=SIGMA, method=method)
    body[11, 2, 1] = np.nan
    with pytest.raises(InvalidInputError, match=r"body\[2, 1\].*finite.*problem 11"):
        ln.solve_attitude(body, REFERENCE, sigma=SIGMA, method=method)
    found = ln.solve_attitude(body, REFERENCE, sigma=SIGMA, method=method, on_error="nan")
    rest = np.arange(21) != 11
    assert np.array_equal(found.converged, rest)
    for field in ("dcm", "quaternion", "mrp", "covariance", "information", "loss", "chi2", "free_axis"):
        values = np.asarray(getattr(found, field))
        assert np.isnan(values[11]).all(), field
        assert np.array_equal(values[rest], np.asarray(getattr(good, field))[rest], equal_nan=True), field


# --- one bad member of a batch ------------------------------------------------------------------------


def spoiled_batch(spoil):
    los = np.stack([LOS] * 9)
    spoil(los[4])
    return los


SPOILS = {
    "nan": lambda member: member.__setitem__((2, 1), np.nan),
    "not unit": lambda member: member.__setitem__(2, [0.1, 0.1, 0.1]),
    "infinite": lambda member: member.__setitem__((0, 0), np.inf),
}


@pytest.mark.parametrize("spoil", SPOILS)
@pytest.mark.parametrize("guess", [None, GUESS], ids=["guess-free", "guess"])
def test_raise_names_the_member(spoil, guess):
    with pytest.raises(InvalidInputError, match=r"los.*4"):
        ln.solve_pose(LANDMARKS, spoiled_batch(SPOILS[spoil]), sigma=1e-4, guess=guess)


@pytest.mark.parametrize("spoil", SPOILS)
@pytest.mark.parametrize("guess", [None, GUESS], ids=["guess-free", "guess"])
def test_nan_keeps_the_rest(spoil, guess):
    good = ln.solve_pose(LANDMARKS, np.stack([LOS] * 9), sigma=1e-4, guess=guess)
    found = ln.solve_pose(LANDMARKS, spoiled_batch(SPOILS[spoil]), sigma=1e-4, guess=guess, on_error="nan")
    rest = np.arange(9) != 4
    assert np.array_equal(found.converged, rest)
    for field in ("position", "mrp", "dcm", "quaternion", "covariance", "cost", "chi2"):
        values = np.asarray(getattr(found, field))
        assert np.isnan(values[4]).all(), field
        assert np.allclose(values[rest], np.asarray(getattr(good, field))[rest], rtol=1e-9, atol=1e-12), field


def test_nan_keeps_the_rest_robust():
    los = spoiled_batch(SPOILS["nan"])
    found = ln.solve_pose_robust(LANDMARKS, los, sigma=1e-4, on_error="nan")
    rest = np.arange(9) != 4
    assert np.array_equal(found.converged, rest)
    assert np.isnan(found.position[4]).all()
    assert not found.inliers[4].any()


def test_errors_leave_nothing_behind():
    """A call after a failed call gives what it gave before."""
    before = CALLS["solve_pose"]()
    with pytest.raises(InvalidInputError):
        CALLS["solve_pose"](los=LOS * 2)
    assert same(before, CALLS["solve_pose"]())

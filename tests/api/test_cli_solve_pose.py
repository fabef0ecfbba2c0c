"""``losnav solve-pose``: real cameras through CSV files, and every mistake a file can hold."""

from __future__ import annotations

import json

import numpy as np
import pytest

from losnav import predict_los
from losnav.attitude import rotation_error
from losnav.cli import main
from losnav.cli.measurements import Camera, Observations, read_observations
from tests.conftest import REAL_CAMERA_COVARIANCE, REAL_CAMERA_RAD

LANDMARKS = np.array([[32.5, 0, 0], [0, 30, 1], [-31.5, 0, 0], [0, -30.5, 2], [11, 7, -3], [-8, 20, 4]])
POSITION, MRP = np.array([3.0, -5.0, -120.0]), np.array([0.05, -0.04, 0.3])


def write(path, rows, header=None):
    lines = [] if header is None else [header]
    lines += [",".join([name, *(repr(float(v)) for v in values)]) for name, values in rows]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def numbered(array, prefix="L"):
    return [(f"{prefix}{k}", row) for k, row in enumerate(array)]


def pixels(los, focal, centre, k1, k2):
    plane = los[:, :2] / los[:, 2:]
    square = np.sum(plane**2, axis=1, keepdims=True)
    return plane * (1 + k1 * square + k2 * square**2) * np.array(focal) + np.array(centre)


@pytest.fixture
def landmarks_csv(tmp_path):
    return write(tmp_path / "landmarks.csv", numbered(LANDMARKS), "id,x,y,z")


@pytest.fixture
def los():
    return predict_los(LANDMARKS, POSITION, MRP)


def solved(capsys, arguments, code=0):
    assert main(["solve-pose", *arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def refused(capsys, arguments):
    assert main(["solve-pose", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


# --- right answers ----------------------------------------------------------------------------------------


def test_unit_vectors(capsys, tmp_path, landmarks_csv, los):
    observations = write(tmp_path / "observations.csv", numbered(los)[::-1])
    report = solved(capsys, [landmarks_csv, observations, "--sigma", "1e-4"])
    np.testing.assert_allclose(report["position_m"], POSITION, atol=1e-9)
    np.testing.assert_allclose(report["mrp"], MRP, atol=1e-12)
    assert report["converged"] is True
    assert report["dof"] == 6
    assert len(report["sigma_position_m"]) == len(report["sigma_attitude_deg"]) == 3


@pytest.mark.parametrize("distortion", [(0.0, 0.0), (-0.08, 0.01), (0.05, -0.02)])
def test_pixels_with_distortion(capsys, tmp_path, landmarks_csv, los, distortion):
    focal, centre = (800.0, 810.0), (320.0, 240.0)
    observations = write(tmp_path / "o.csv", numbered(pixels(los, focal, centre, *distortion)), "id,u,v")
    options = ["--focal", "800,810", "--principal-point", "320,240", "--sigma-px", "0.2"]
    options += ["--distortion", f"{distortion[0]},{distortion[1]}"]
    report = solved(capsys, [landmarks_csv, observations, *options])
    np.testing.assert_allclose(report["position_m"], POSITION, atol=1e-8)
    np.testing.assert_allclose(report["mrp"], MRP, atol=1e-10)


def test_bal_pixels_with_v_turned_round(capsys, tmp_path, landmarks_csv, los):
    """BAL: y up, looking along -z, its rotation diag(1, -1, -1) times ours."""
    turned = los * [1, -1, -1]
    bal = -1000.0 * turned[:, :2] / turned[:, 2:]
    observations = write(tmp_path / "o.csv", numbered(bal * [1, -1]))
    report = solved(capsys, [landmarks_csv, observations, "--focal", "1000"])
    np.testing.assert_allclose(report["position_m"], POSITION, atol=1e-8)


def test_columns_by_name_in_any_order_comments_and_blank_lines(capsys, tmp_path, landmarks_csv, los):
    lines = ["# from the tracker", "", "quality, uz ,ux,uy,ID"]
    lines += [f"0.9, {b[2]!r}, {b[0]!r}, {b[1]!r}, L{k}  # seen" for k, b in enumerate(los.tolist())]
    (tmp_path / "o.csv").write_text("\ufeff" + "\r\n".join(lines))
    report = solved(capsys, [landmarks_csv, str(tmp_path / "o.csv")])
    np.testing.assert_allclose(report["position_m"], POSITION, atol=1e-9)


@pytest.mark.parametrize("guess", ["0,0,-100,0,0,0.2", "0,0,-100,0,0,0.38,0.925", None])
def test_guess(capsys, tmp_path, landmarks_csv, los, guess):
    observations = write(tmp_path / "o.csv", numbered(los))
    options = [] if guess is None else [f"--guess={guess}"]
    report = solved(capsys, [landmarks_csv, observations, *options])
    np.testing.assert_allclose(report["position_m"], POSITION, atol=1e-9)


def test_sigma_from_the_residuals(capsys, tmp_path, landmarks_csv, los):
    rng = np.random.default_rng(3)
    noisy = los + 1e-3 * rng.standard_normal(los.shape)
    observations = write(tmp_path / "o.csv", numbered(noisy / np.linalg.norm(noisy, axis=1, keepdims=True)))
    free = solved(capsys, [landmarks_csv, observations])
    scale = free["sigma_los_rad"]
    assert 3e-4 < scale < 3e-3
    given = solved(capsys, [landmarks_csv, observations, "--sigma", repr(scale)])
    np.testing.assert_allclose(free["sigma_position_m"], given["sigma_position_m"], rtol=1e-6)
    assert given["chi2"] == pytest.approx(given["dof"])
    assert free["chi2"] is None


def test_fit_in_words(capsys, tmp_path, landmarks_csv, los):
    rng = np.random.default_rng(5)
    noisy = los + 1e-3 * rng.standard_normal(los.shape)
    observations = write(tmp_path / "o.csv", numbered(noisy / np.linalg.norm(noisy, axis=1, keepdims=True)))
    words = {}
    for sigma in ("1e-5", "1e-3", "1e-1"):
        report = solved(capsys, [landmarks_csv, observations, "--sigma", sigma])
        words[sigma] = report["fit"]
        assert 0 <= report["p_value"] <= 1
    assert "--robust" in words["1e-5"]
    assert "consistent" in words["1e-3"]
    assert "too large" in words["1e-1"]


def test_report_for_a_person(capsys, tmp_path, landmarks_csv, los):
    observations = write(tmp_path / "o.csv", numbered(los))
    assert main(["solve-pose", landmarks_csv, observations, "--sigma", "1e-4"]) == 0
    text = capsys.readouterr().out
    for word in ("1-sigma", "quaternion", "MRP", "deg about camera", "chi2", "weakest: position along"):
        assert word in text


def test_report_names_what_does_not_fit(capsys, tmp_path, landmarks_csv, los):
    turned = los.copy()
    turned[4] = (turned[4] + [0.02, -0.01, 0]) / np.linalg.norm(turned[4] + [0.02, -0.01, 0])
    observations = write(tmp_path / "o.csv", numbered(turned))
    assert main(["solve-pose", landmarks_csv, observations, "--sigma", "1e-4"]) == 0
    text = capsys.readouterr().out
    assert "suspicious" in text
    assert "do not trust the 1-sigma" in text
    assert main(["solve-pose", landmarks_csv, observations, "--sigma", "1e-4", "--robust"]) == 0
    text = capsys.readouterr().out
    assert "rejected as wrong matches (1): L4" in text
    assert "consistent with sigma" in text or "too large" in text


def test_three_landmarks_have_other_poses(capsys, tmp_path):
    triple = np.array([[0.0, 0, 0], [30, 0, 0], [8, 25, 0]])
    landmarks = write(tmp_path / "l.csv", numbered(triple))
    observations = write(tmp_path / "o.csv", numbered(predict_los(triple, [10.0, 6, -60], MRP)))
    assert main(["solve-pose", landmarks, observations]) == 0
    text = capsys.readouterr().out
    assert "another pose fits comparably" in text
    assert "unknown" in text


def test_three_landmarks_cannot_be_checked(capsys, tmp_path, landmarks_csv, los):
    observations = write(tmp_path / "o.csv", numbered(los[:3]))
    report = solved(capsys, [landmarks_csv, observations, "--sigma", "1e-4"])
    assert report["dof"] == 0
    assert "cannot be checked" in report["fit"]
    assert report["unobserved_landmarks"] == 3
    poses = [report["position_m"], *(other["position_m"] for other in report["alternatives"])]
    assert min(np.linalg.norm(np.subtract(pose, POSITION)) for pose in poses) < 1e-6


def test_not_converged_is_exit_code_one(capsys, tmp_path):
    line = np.array([[0.0, 0, 0], [10, 0, 0], [25, 0, 0], [40, 0, 0]])
    landmarks = write(tmp_path / "l.csv", numbered(line))
    observations = write(tmp_path / "o.csv", numbered(predict_los(line, [3.0, -5, -120], MRP)))
    for guess in ([], ["--guess=3,-5,-119,0.05,-0.04,0.3"]):
        report = solved(capsys, [landmarks, observations, "--sigma", "1e-4", *guess], code=1)
        assert report["converged"] is False
        assert report["geometry"]["diagnosis"] == "collinear landmarks"
    assert main(["solve-pose", landmarks, observations]) == 1
    assert "NOT CONVERGED" in capsys.readouterr().out


def test_absurd_guess_is_no_traceback(capsys, tmp_path, landmarks_csv, los):
    observations = write(tmp_path / "o.csv", numbered(los))
    report = solved(capsys, [landmarks_csv, observations, "--guess=1e300,0,0,0,0,0"], code=1)
    assert report["converged"] is False


def test_undistortion_refuses_pixels_beyond_the_fold():
    camera = Camera((1000.0, 1000.0), distortion=(-0.3, 0.0))
    inside = Observations(("a",), np.array([[500.0, 200.0]]), ("o.csv:1",))
    assert camera.los(inside).shape == (1, 3)
    beyond = Observations(("a",), np.array([[900.0, 0.0]]), ("o.csv:7",))
    with pytest.raises(ValueError, match=r"o\.csv:7"):
        camera.los(beyond)


# --- bad files --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["none"]),
        ("id,ux,uy,uz\n", ["none"]),
        ("L0,0,0,1\nL1,0,0\n", [":2", "columns"]),
        ("L0,0,0,1,2,3\n", [":1", "columns"]),
        ("L0,0,zero,1\n", [":1", "header"]),
        ("id,ux,uy,uz\nL0,0,zero,1\n", [":2", "L0", "zero"]),
        ("id,ux,uy,uz\nL0,0,nan,1\n", [":2", "nan"]),
        ("id,ux,uy\nL0,0,0\n", [":1", "columns"]),
        ("id,ux,uy,uz,ux\nL0,0,0,1,0\n", [":1", "columns"]),
        ("L0,0,0,1\nL0,0,0,1\n", [":2", "L0", ":1"]),
        (",0,0,1\n", [":1", "empty"]),
        ("L0,0,0,1\nL1,0,0,2\n", [":2", "L1", "unit"]),
        ("L0,0,0,1\nX7,0,0,1\nX8,0,0,1\n", [":2", "X7", "X8"]),
        ("L0,0,0,1\nL1,0,0,1\n", ["at least 3"]),
        ("\x00\xff", []),
    ],
)
def test_bad_observations(capsys, tmp_path, landmarks_csv, text, words):
    path = tmp_path / "obs.csv"
    path.write_bytes(text.encode("latin-1"))
    line = refused(capsys, [landmarks_csv, str(path)])
    assert "obs.csv" in line
    for word in words:
        assert word in line


def test_bad_landmarks(capsys, tmp_path, los):
    observations = write(tmp_path / "o.csv", numbered(los))
    landmarks = tmp_path / "marks.csv"
    landmarks.write_text("a,1,2,3\na,1,2,3\n")
    assert "marks.csv:2" in refused(capsys, [str(landmarks), observations])
    assert "absent.csv" in refused(capsys, [str(tmp_path / "absent.csv"), observations])
    assert "expected a readable" in refused(capsys, [str(tmp_path), observations])


def test_one_place_under_two_ids(capsys, tmp_path, los):
    landmarks = write(tmp_path / "l.csv", [*numbered(LANDMARKS), ("again", LANDMARKS[2])])
    write(tmp_path / "o.csv", numbered(los))
    assert solved(capsys, [landmarks, str(tmp_path / "o.csv")])["unobserved_landmarks"] == 1
    line = refused(capsys, [landmarks, write(tmp_path / "o.csv", [*numbered(los), ("again", los[2])])])
    assert "'L2'" in line
    assert "'again'" in line


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ([], "--focal"),
        (["--focal", "0"], "--focal"),
        (["--focal", "1,2,3"], "--focal"),
        (["--focal", "nan"], "--focal"),
        (["--focal", "800", "--sigma", "-1"], "--sigma"),
        (["--focal", "800", "--sigma", "1", "--sigma-px", "1"], "--sigma"),
        (["--focal", "800", "--robust"], "--robust"),
        (["--focal", "800", "--guess", "1,2,3"], "--guess"),
        (["--focal", "800", "--guess", "1,2,3,4,5,6,7"], "--guess"),
        (["--focal", "800", "--principal-point", "1"], "--principal-point"),
    ],
)
def test_bad_options(capsys, tmp_path, landmarks_csv, options, word):
    observations = write(tmp_path / "o.csv", [("L0", (1, 2)), ("L1", (3, 4)), ("L2", (5, 6))])
    assert word in refused(capsys, [landmarks_csv, observations, *options])


def test_camera_options_need_pixels(capsys, tmp_path, landmarks_csv, los):
    observations = write(tmp_path / "o.csv", numbered(los))
    assert "--focal" in refused(capsys, [landmarks_csv, observations, "--focal", "800"])
    assert "--sigma-px" in refused(capsys, [landmarks_csv, observations, "--sigma-px", "1"])


def test_header_without_id_is_refused(tmp_path):
    (tmp_path / "o.csv").write_text("name,u,v\nL0,1,2\n")
    with pytest.raises(ValueError, match="id, u, v"):
        read_observations(tmp_path / "o.csv")


# --- real cameras -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real(data_folder):
    with np.load(data_folder / "bal_pose.npz") as file:
        arrays = dict(file)
    facts = json.loads((data_folder / "bal_pose.json").read_text(encoding="utf-8"))
    return arrays, {entry["camera"]: entry for entry in facts}


def export(tmp_path, arrays, camera, *, wrong, focal=None):
    """Write a camera's landmarks and observations, with its real mismatches on request."""
    points, los = arrays[f"c{camera}_X"], arrays[f"c{camera}_b"]
    extra, extra_los = arrays[f"c{camera}_Xout"], arrays[f"c{camera}_bout"]
    rows, seen = numbered(points), numbered(los)
    if wrong:
        rows, seen = rows + numbered(extra, "wrong"), seen + numbered(extra_los, "wrong")
    if focal is not None:
        seen = [(name, focal * b[:2] / b[2]) for name, b in seen]
    marks = write(tmp_path / "landmarks.csv", rows, "id,x,y,z")
    return marks, write(tmp_path / "observations.csv", seen), {f"wrong{k}" for k in range(len(extra))}


@pytest.mark.parametrize("camera", [0, 1, 2])
def test_real_camera_meets_the_reference_optimum(capsys, tmp_path, real, camera):
    arrays, facts = real
    marks, seen, _ = export(tmp_path, arrays, camera, wrong=False)
    report = solved(capsys, [marks, seen, "--sigma", repr(facts[camera]["sigma_rad"])])
    angle = np.linalg.norm(rotation_error(arrays[f"c{camera}_R"], np.array(report["dcm"])))
    assert angle < REAL_CAMERA_RAD
    scale = np.linalg.norm(arrays[f"c{camera}_X"] - arrays[f"c{camera}_p"], axis=1).mean()
    assert np.linalg.norm(report["position_m"] - arrays[f"c{camera}_p"]) / scale < REAL_CAMERA_RAD
    # The reference orders its covariance [δθ, δp], with δθ of the opposite sense: the diagonal blocks do not
    # mind.
    reference = np.sqrt(np.diag(arrays[f"c{camera}_cov"]))
    np.testing.assert_allclose(report["sigma_position_m"], reference[3:], rtol=REAL_CAMERA_COVARIANCE)
    np.testing.assert_allclose(
        np.radians(report["sigma_attitude_deg"]), reference[:3], rtol=REAL_CAMERA_COVARIANCE
    )
    assert report["p_value"] > 1e-3


@pytest.mark.parametrize("camera", [1, 2, 4])
def test_real_mismatches_are_noticed(capsys, tmp_path, real, camera):
    """Of the five cameras, these have no landmark matched twice, which only --robust accepts."""
    arrays, facts = real
    marks, seen, wrong = export(tmp_path, arrays, camera, wrong=True)
    report = solved(capsys, [marks, seen, "--sigma", repr(facts[camera]["sigma_rad"])])
    assert "--robust" in report["fit"]
    assert {entry["id"] for entry in report["suspicious"]} & wrong


@pytest.mark.parametrize("camera", [0, 3])
def test_a_landmark_matched_twice_needs_robust(capsys, tmp_path, real, camera):
    arrays, facts = real
    marks, seen, _ = export(tmp_path, arrays, camera, wrong=True)
    assert "--robust" in refused(capsys, [marks, seen, "--sigma", repr(facts[camera]["sigma_rad"])])


@pytest.mark.parametrize("camera", range(5))
@pytest.mark.parametrize("as_pixels", [False, True])
def test_real_mismatches_are_rejected_by_name(capsys, tmp_path, real, camera, as_pixels):
    arrays, facts = real
    focal, sigma_px = facts[camera]["f_px"], facts[camera]["sigma_px"]
    marks, seen, wrong = export(tmp_path, arrays, camera, wrong=True, focal=focal if as_pixels else None)
    options = ["--sigma", repr(facts[camera]["sigma_rad"])]
    if as_pixels:
        options = ["--focal", repr(float(focal)), "--sigma-px", repr(sigma_px)]
    robust = solved(capsys, [marks, seen, *options, "--robust"])
    assert wrong <= set(robust["rejected"])
    # A few of the 200 good matches have residuals beyond four sigma; no more than those may go with the wrong
    # ones.
    assert len(set(robust["rejected"]) - wrong) <= 10
    if f"c{camera}_p" in arrays:
        sigma = np.array(robust["sigma_position_m"])
        reference = arrays[f"c{camera}_p_px" if as_pixels else f"c{camera}_p"]
        assert np.all(abs(robust["position_m"] - reference) < 3 * sigma)

"""``losnav solve-attitude``: real photographs through CSV files, and every mistake a star list can hold."""

from __future__ import annotations

import json

import numpy as np
import pytest

from losnav.attitude import dcm_from_mrp, rotation_error
from losnav.cli import main
from losnav.cli.measurements import Camera, Observations
from tests.conftest import REAL_STARS_ARCSEC, REAL_STARS_COVARIANCE

ARCSEC = float(np.radians(1 / 3600))
DCM = dcm_from_mrp([0.2, -0.1, 0.35])
STARS = 12
SIGMA = 20 * ARCSEC
UNIT_COLUMNS = "bx,by,bz,rx,ry,rz"


def sky(seed=1, count=STARS, noise=SIGMA, half_field=0.15):
    """Measured directions and catalogue directions of a camera with attitude ``DCM``."""
    rng = np.random.default_rng(seed)
    plane = rng.uniform(-half_field, half_field, (count, 2))
    true = np.column_stack([plane, np.ones(count)])
    true /= np.linalg.norm(true, axis=1, keepdims=True)
    body = true + noise * rng.standard_normal(true.shape)
    return body / np.linalg.norm(body, axis=1, keepdims=True), true @ DCM


def write(path, columns, *blocks):
    """A CSV file of these columns, side by side."""
    rows = zip(*(list(block) for block in blocks), strict=True)
    lines = [",".join(str(cell) for part in row for cell in np.atleast_1d(part).tolist()) for row in rows]
    path.write_text("\n".join([columns, *lines] if columns else lines) + "\n")
    return str(path)


def radec(vectors):
    return np.degrees(
        np.column_stack([np.arctan2(vectors[:, 1], vectors[:, 0]) % (2 * np.pi), np.arcsin(vectors[:, 2])])
    )


def pixels(body, focal, centre):
    return focal * body[:, :2] / body[:, 2:] + np.array(centre)


@pytest.fixture
def stars_csv(tmp_path):
    return write(tmp_path / "stars.csv", UNIT_COLUMNS, *sky())


def solved(capsys, arguments, code=0):
    assert main(["solve-attitude", *arguments, "--json"]) == code
    return json.loads(capsys.readouterr().out)


def refused(capsys, arguments):
    assert main(["solve-attitude", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


def off(report, dcm=DCM):
    """Angle between an attitude and the true one, arcsec."""
    return np.linalg.norm(rotation_error(dcm, np.array(report["dcm"]))) / ARCSEC


# --- right answers ----------------------------------------------------------------------------------------


def test_unit_vectors(capsys, stars_csv):
    report = solved(capsys, [stars_csv, "--sigma", repr(SIGMA)])
    error = rotation_error(DCM, np.array(report["dcm"]))
    assert error @ np.linalg.solve(np.array(report["covariance"]), error) < 16.3  # chi2(3), 0.999
    np.testing.assert_allclose(report["sigma_arcsec"], np.sqrt(np.diag(report["covariance"])) / ARCSEC)
    assert report["converged"] is True
    assert (report["dof"], report["stars"], report["rank"]) == (2 * STARS - 3, STARS, 3)
    assert report["rejected"] == report["suspicious"] == []
    assert 0.001 < report["p_value"] < 0.999
    assert report["chi2"] == pytest.approx(2 * report["loss"])
    assert "z (boresight)" in report["weakest"]


@pytest.mark.parametrize("method", ["quest", "q-method", "svd", "foam", "esoq2"])
def test_methods_agree(capsys, stars_csv, method):
    first = solved(capsys, [stars_csv, "--sigma", "20arcsec"])
    other = solved(capsys, [stars_csv, "--sigma", "20arcsec", "--method", method])
    np.testing.assert_allclose(other["quaternion_xyzw"], first["quaternion_xyzw"], atol=1e-12)
    assert other["method"] == method


def test_exact_directions_give_the_exact_attitude(capsys, tmp_path):
    body, reference = sky(noise=0.0)
    columns = "ID,Mag,RA,dec,bz,by,bx,remark"
    flipped = body[:, ::-1]
    names = [f"HIP{k}" for k in range(STARS)]
    file = write(tmp_path / "s.csv", columns, names, [4.5] * STARS, radec(reference), flipped, ["ok"] * STARS)
    report = solved(capsys, [file])
    assert off(report) < 1e-6
    sky_axes = DCM[2]
    boresight = report["boresight"]
    np.testing.assert_allclose(
        [boresight["ra_deg"], boresight["dec_deg"]], radec(sky_axes[None])[0], rtol=1e-10
    )


@pytest.mark.parametrize(
    ("direction", "expected"),
    [([0, -1, 0], 0.0), ([1, 0, 0], 90.0), ([0, 1, 0], 180.0), ([-1, 0, 0], 270.0)],
)
def test_roll_is_the_position_angle_of_image_up(capsys, tmp_path, direction, expected):
    """Boresight towards RA 30°, Dec 20°; celestial north lies along ``direction`` in camera axes.

    On the sky east is a quarter turn to the left of north: with north to the right, east is up.
    """
    ra, dec = np.radians([30.0, 20.0])
    z = np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])
    north = np.array([-np.sin(dec) * np.cos(ra), -np.sin(dec) * np.sin(ra), np.cos(dec)])
    in_camera = np.array([direction, np.cross([0, 0, 1.0], direction), [0, 0, 1.0]]).T
    dcm = in_camera @ np.array([north, np.cross(z, north), z])
    body, _ = sky(noise=0.0)
    report = solved(capsys, [write(tmp_path / "s.csv", UNIT_COLUMNS, body, body @ dcm)])
    boresight = report["boresight"]
    assert boresight["ra_deg"] == pytest.approx(30.0)
    assert boresight["dec_deg"] == pytest.approx(20.0)
    assert (boresight["roll_deg"] - expected + 180) % 360 - 180 == pytest.approx(0.0, abs=1e-6)


def test_without_a_header(capsys, tmp_path, stars_csv):
    body, reference = sky()
    expected = solved(capsys, [stars_csv, "--sigma", "1e-4"])
    bare = write(tmp_path / "bare.csv", "", body, reference)
    named = write(tmp_path / "named.csv", "", [f"S{k}" for k in range(STARS)], body, reference)
    for file in (bare, named):
        assert solved(capsys, [file, "--sigma", "1e-4"])["dcm"] == expected["dcm"]


@pytest.mark.parametrize("model", ["--distortion", "--undistortion"])
def test_pixels(capsys, tmp_path, model):
    body, reference = sky(noise=0.0)
    plane = body[:, :2] / body[:, 2:]
    k1, k2, focal, centre = -0.3, 0.05, 1200.0, (500.0, 400.0)
    if model == "--distortion":
        square = np.sum(plane**2, axis=1, keepdims=True)
        bent = plane * (1 + k1 * square + k2 * square**2)
    else:
        bent = plane.copy()
        for _ in range(100):
            square = np.sum(bent**2, axis=1, keepdims=True)
            bent = plane / (1 + k1 * square + k2 * square**2)
    file = write(tmp_path / "s.csv", "u,v,ra,dec", focal * bent + np.array(centre), radec(reference))
    options = ["--focal-length-px", "1200", "--center", "500,400", f"{model}={k1},{k2}"]
    assert off(solved(capsys, [file, *options])) < 1e-6
    assert off(solved(capsys, [file, *options[:4]])) > 10


def test_sigma_in_pixels_is_that_of_the_angle(capsys, tmp_path):
    body, reference = sky(noise=0.0, half_field=0.01)
    file = write(tmp_path / "s.csv", "u,v,rx,ry,rz", pixels(body, 2000.0, (0, 0)), reference)
    wide = solved(capsys, [file, "--focal", "2000", "--sigma-px", "0.2"])
    angle = solved(capsys, [file, "--focal", "2000", "--sigma", "1e-4"])
    np.testing.assert_allclose(wide["sigma_arcsec"], angle["sigma_arcsec"], rtol=1e-3)
    column = write(
        tmp_path / "c.csv", "u,v,rx,ry,rz,sigma_px", pixels(body, 2000.0, (0, 0)), reference, [0.2] * STARS
    )
    assert solved(capsys, [column, "--focal", "2000"])["sigma_arcsec"] == wide["sigma_arcsec"]


@pytest.mark.parametrize(
    ("column", "factor"), [("sigma", 1.0), ("sigma_arcsec", 1 / ARCSEC)], ids=["rad", "arcsec"]
)
def test_sigma_of_each_star(capsys, tmp_path, column, factor):
    body, reference = sky()
    sigma = SIGMA * np.linspace(0.5, 2.0, STARS)
    report = solved(
        capsys, [write(tmp_path / "s.csv", f"{UNIT_COLUMNS},{column}", body, reference, sigma * factor)]
    )
    information = sum((np.eye(3) - np.outer(b, b)) / s**2 for b, s in zip(body, sigma, strict=True))
    np.testing.assert_allclose(report["covariance"], np.linalg.inv(information), rtol=1e-3, atol=1e-14)


def test_sigma_from_the_residuals(capsys, stars_csv):
    free = solved(capsys, [stars_csv])
    assert 10 < free["sigma_star_arcsec"] < 40
    assert free["chi2"] is None
    given = solved(capsys, [stars_csv, "--sigma", f"{free['sigma_star_arcsec']!r}arcsec"])
    np.testing.assert_allclose(free["sigma_arcsec"], given["sigma_arcsec"], rtol=1e-9)
    assert given["chi2"] == pytest.approx(given["dof"])


def test_a_magnitude_may_be_missing(capsys, tmp_path):
    body, reference = sky()
    file = write(tmp_path / "s.csv", f"mag,{UNIT_COLUMNS}", ["", *([4.0] * (STARS - 1))], body, reference)
    report = solved(capsys, [file, "--sigma", "20arcsec"])
    assert [star["magnitude"] for star in report["residuals"][:2]] == [None, 4.0]


def test_units_of_sigma(capsys, stars_csv):
    reports = [
        solved(capsys, [stars_csv, "--sigma", text])
        for text in (repr(SIGMA), "20arcsec", f"{SIGMA * 1e6!r}urad", f"{float(np.degrees(SIGMA))!r}deg")
    ]
    for report in reports[1:]:
        np.testing.assert_allclose(report["sigma_arcsec"], reports[0]["sigma_arcsec"], rtol=1e-12)


def test_aberration(capsys, tmp_path):
    """A camera at 30 km/s across its boresight sees all stars 20.6 arcsec off, towards the velocity."""
    body, reference = sky(noise=0.0, half_field=0.01)
    file = write(tmp_path / "s.csv", UNIT_COLUMNS, body, reference)
    velocity = 30_000.0 * DCM[0]
    moved = solved(capsys, [file, "--velocity=" + ",".join(map(repr, velocity.tolist()))])
    turn = rotation_error(DCM, np.array(moved["dcm"])) / ARCSEC
    assert np.linalg.norm(turn) == pytest.approx(20.64, abs=0.01)
    assert abs(turn[1]) == pytest.approx(20.64, abs=0.01)


# --- wrong stars ------------------------------------------------------------------------------------------


def test_a_wrong_star_is_suspicious_then_rejected(capsys, tmp_path):
    body, reference = sky(count=20)
    reference[7] = dcm_from_mrp([0.0, 0.01, 0.002]) @ reference[7]
    names = [f"HIP{k}" for k in range(20)]
    file = write(tmp_path / "s.csv", f"id,mag,{UNIT_COLUMNS}", names, np.arange(20) / 2, body, reference)
    plain = solved(capsys, [file, "--sigma", "20arcsec"])
    assert plain["suspicious"][0]["id"] == "HIP7"
    assert "try --robust" in plain["fit"]
    for method in ("quest", "svd"):
        robust = solved(capsys, [file, "--sigma", "20arcsec", "--robust", "--method", method])
        assert robust["rejected"] == ["HIP7"]
        assert [star["id"] for star in robust["residuals"] if not star["used"]] == ["HIP7"]
        assert robust["residuals"][7]["magnitude"] == 3.5
        assert robust["residuals"][7]["off_arcsec"] > 1000
        assert "consistent" in robust["fit"]
        assert robust["dof"] == 2 * 19 - 3
        assert off(robust) < 4 * max(robust["sigma_arcsec"])
    assert main(["solve-attitude", file, "--sigma", "20arcsec", "--robust"]) == 0
    assert "rejected as wrong stars (1): HIP7 (" in capsys.readouterr().out


def test_stars_without_an_id_are_called_by_their_line(capsys, tmp_path):
    body, reference = sky()
    reference[4] = reference[5]
    report = solved(
        capsys, [write(tmp_path / "s.csv", UNIT_COLUMNS, body, reference), "--sigma", "20arcsec", "--robust"]
    )
    assert report["rejected"] == ["line 6"]


def test_one_star_identified_twice(capsys, tmp_path):
    body, reference = sky()
    names = [f"HIP{k}" for k in range(STARS)]
    names[4], reference[4] = names[5], reference[5]
    file = write(tmp_path / "s.csv", f"id,{UNIT_COLUMNS}", names, body, reference)
    message = refused(capsys, [file, "--sigma", "20arcsec"])
    assert "s.csv:7: id: expected each id once, got 'HIP5' again" in message
    report = solved(capsys, [file, "--sigma", "20arcsec", "--robust"])
    assert report["rejected"] == ["HIP5 (line 6)"]


def test_stars_of_another_sky(capsys, tmp_path):
    """No attitude fits more than two of them: said, and not hidden behind the best of all bad ones."""
    body, _ = sky()
    elsewhere = np.random.default_rng(9).standard_normal((STARS, 3))
    elsewhere /= np.linalg.norm(elsewhere, axis=1, keepdims=True)
    file = write(tmp_path / "s.csv", UNIT_COLUMNS, body, elsewhere)
    report = solved(capsys, [file, "--sigma", "20arcsec", "--robust"], code=1)
    assert report["converged"] is False
    assert main(["solve-attitude", file, "--sigma", "20arcsec", "--robust"]) == 1
    assert "NOT DETERMINED (no attitude agrees with enough of the stars)" in capsys.readouterr().out


# --- nothing to be known ----------------------------------------------------------------------------------


def test_one_star_leaves_a_rotation_free(capsys, tmp_path):
    file = write(tmp_path / "s.csv", UNIT_COLUMNS, [[0.0, 0.6, 0.8]], [[1.0, 0.0, 0.0]])
    report = solved(capsys, [file, "--sigma", "1e-4"], code=1)
    assert report["converged"] is False
    assert report["rank"] == 2
    np.testing.assert_allclose(np.abs(report["free_axis"]), [0.0, 0.6, 0.8], atol=1e-12)
    assert main(["solve-attitude", file, "--sigma", "1e-4"]) == 1
    text = capsys.readouterr().out
    assert "NOT DETERMINED" in text
    assert "is free" in text


def test_parallel_stars(capsys, tmp_path):
    file = write(tmp_path / "s.csv", UNIT_COLUMNS, [[0.0, 0.0, 1.0]] * 3, [[1.0, 0.0, 0.0]] * 3)
    assert solved(capsys, [file, "--sigma", "1e-4"], code=1)["converged"] is False


def test_two_stars_without_sigma_still_have_one_check(capsys, tmp_path):
    body, reference = sky(count=2)
    report = solved(capsys, [write(tmp_path / "s.csv", UNIT_COLUMNS, body, reference)])
    assert report["dof"] == 1
    assert report["sigma_star_arcsec"] > 0


# --- mistakes ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected lines bx,by,bz or u,v"),
        ("bx,by,bz,rx,ry,rz\n", "expected stars after the header"),
        ("bx,by,rx,ry,rz\n0,0,1,0,0\n", "s.csv:1: expected columns bx,by,bz or u,v"),
        ("bx,by,bz,ra\n0,0,1,0\n", "s.csv:1: expected columns rx,ry,rz or ra,dec"),
        ("bx,by,bz,rx,ry,rz,rz\n0,0,1,0,0,1,1\n", "s.csv:1: expected each column once, got 'rz'"),
        ("bx,by,bz,rx,ry,rz,sigma,sigma_px\n0,0,1,0,0,1,1,1\n", "one column of sigmas"),
        ("0,0,1,0,0\n", "s.csv:1: expected a header, or bx,by,bz,rx,ry,rz"),
        ("bx,by,bz,rx,ry,rz\n0,0,1,0,0\n", "s.csv:2: expected at least 6 columns, got 5"),
        ("bx,by,bz,rx,ry,rz\n0,0,x,0,0,1\n", "s.csv:2: bz: expected a finite number, got 'x'"),
        ("bx,by,bz,rx,ry,rz\n0,0,1,0,0,\n", "s.csv:2: rz: expected a finite number, got ''"),
        ("bx,by,bz,rx,ry,rz\n0,0,1,0,0,nan\n", "s.csv:2: rz: expected a finite number, got 'nan'"),
        (
            "bx,by,bz,rx,ry,rz\n0,0,1,0,0,1\n\n0,0,2,0,0,1 # far\n",
            "s.csv:4: bx,by,bz: expected a unit vector",
        ),
        ("bx,by,bz,rx,ry,rz\n0,0,1e308,0,0,1\n", "s.csv:2: bx,by,bz: expected a unit vector"),
        ("bx,by,bz,rx,ry,rz\n0,0,1,0,0,0\n", "s.csv:2: rx,ry,rz: expected a unit vector"),
        ("bx,by,bz,ra,dec\n0,0,1,10,91\n", "s.csv:2: dec: expected degrees from -90 to 90, got 91"),
        ("bx,by,bz,ra,dec\n0,0,1,361,0\n", "s.csv:2: ra: expected degrees from -180 to 360, got 361"),
        ("id,bx,by,bz,ra,dec\n,0,0,1,10,1\n", "s.csv:2: id: expected a name"),
        ("bx,by,bz,ra,dec,sigma\n0,0,1,10,1,-1\n", "s.csv:2: sigma: expected a positive number"),
        ("bx,by,bz,ra,dec,sigma\n0,0,1,10,1,7\n0,1,0,10,90,7\n", "name the column sigma_arcsec"),
        ("bx,by,bz,ra,dec,mag\n0,0,1,10,1,bright\n", "s.csv:2: mag: expected a finite number"),
        ("bx,by,bz,ra,dec\n0,0,1,05:55:10,1\n", "s.csv:2: ra: expected a finite number of degrees"),
        ("u,v,ra,dec\n0,0,1,10\n", "--focal: expected the focal length"),
        ("bx,by,bz,ra,dec,sigma_px\n0,0,1,10,1,1\n", "sigma_px: expected pixels (u,v), got unit vectors"),
    ],
)
def test_every_mistake_is_one_line_with_its_place(capsys, tmp_path, text, message):
    (tmp_path / "s.csv").write_text(text)
    assert message in refused(capsys, [str(tmp_path / "s.csv")])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--robust"], "--robust: expected a sigma"),
        (["--focal", "1000"], "--focal: expected pixels (u,v), got unit vectors"),
        (["--sigma-px", "0.1"], "--sigma-px: expected pixels"),
        (["--sigma", "7"], "write 7arcsec"),
        (["--sigma", "7parsec"], "expected a positive angle in rad, or with a unit"),
        (["--sigma", "-1e-4"], "--sigma"),
        (["--sigma", "0"], "expected a positive angle"),
        (["--sigma", "1e-4", "--sigma-px", "1"], "not allowed with"),
        (["--distortion", "1,2", "--undistortion", "1"], "not allowed with"),
        (["--method", "triad"], "--method"),
    ],
)
def test_options_that_do_not_fit(capsys, stars_csv, options, message):
    assert message in refused(capsys, [stars_csv, *options])


def test_noise_given_twice_and_files_that_are_none(capsys, tmp_path):
    body, reference = sky()
    file = write(tmp_path / "s.csv", f"{UNIT_COLUMNS},sigma", body, reference, [1e-4] * STARS)
    assert "--sigma: expected the noise once" in refused(capsys, [file, "--sigma", "1e-4"])
    assert "expected a readable CSV file" in refused(capsys, [str(tmp_path / "none.csv")])
    pixel_file = write(tmp_path / "p.csv", "u,v,rx,ry,rz", pixels(body, 1000.0, (0, 0)), reference)
    assert "--focal: expected positive" in refused(capsys, [pixel_file, "--focal=-5"])


def test_undistortion_that_folds_back_is_refused():
    camera = Camera((1000.0, 1000.0), undistortion=(-3.0, 0.0))
    inside = Observations(("a",), np.array([[100.0, 50.0]]), ("s.csv:2",))
    assert camera.los(inside).shape == (1, 3)
    with pytest.raises(ValueError, match=r"s\.csv:5: expected a pixel inside the range"):
        camera.los(Observations(("a",), np.array([[500.0, 0.0]]), ("s.csv:5",)))


def test_report_for_a_person(capsys, stars_csv):
    assert main(["solve-attitude", stars_csv, "--sigma", "20arcsec"]) == 0
    text = capsys.readouterr().out
    for word in (
        "attitude from 12 of 12 stars",
        "quaternion",
        "dcm",
        "RA",
        "roll",
        "arcsec about camera x, y, z",
    ):
        assert word in text
    assert "consistent with sigma" in text


# --- real photographs -------------------------------------------------------------------------------------

PHOTOGRAPHS = ("i08", "i09", "i10", "i11", "i12", "i13", "i14", "i15")


@pytest.fixture(scope="module")
def photographs(data_folder):
    with np.load(data_folder / "stars.npz") as file:
        arrays = dict(file)
    described = json.loads((data_folder / "stars.json").read_text())
    return {
        entry["key"]: (
            entry,
            {
                name: arrays[f"{entry['key']}_{name}"]
                for name in ("yx", "icrs", "body", "R", "cov", "mag", "hip", "keep")
            },
        )
        for entry in described
    }


def as_csv(path, entry, data, order=None):
    """Centroids in pixels beside catalogue directions; ``order`` shuffles the catalogue's rows."""
    reference = data["icrs"] if order is None else data["icrs"][order]
    sky_angles = radec(reference)
    names = [f"HIP{n}" for n in data["hip"]]
    return write(path, "id,u,v,ra,dec,mag", names, data["yx"][:, ::-1], sky_angles, data["mag"])


def camera_options(entry):
    return [
        *("--focal", repr(entry["f_px"])),
        *("--principal-point", f"{entry['width'] / 2},{entry['height'] / 2}"),
        *("--undistortion", repr(entry["k1"])),
        *("--sigma", f"{entry['sigma_arcsec']!r}arcsec"),
    ]


@pytest.mark.parametrize("key", PHOTOGRAPHS)
def test_real_photographs(capsys, tmp_path, photographs, key):
    """Centroids of a photograph, as a user has them: the plate solver's attitude and covariance."""
    entry, data = photographs[key]
    report = solved(capsys, [as_csv(tmp_path / "s.csv", entry, data), *camera_options(entry)])
    assert off(report, data["R"]) < REAL_STARS_ARCSEC
    np.testing.assert_allclose(
        np.diag(report["covariance"]), np.diag(data["cov"]), rtol=REAL_STARS_COVARIANCE
    )
    assert report["p_value"] > 1e-3
    assert report["stars"] == entry["n_matched"] == len(data["keep"])


@pytest.mark.parametrize("key", PHOTOGRAPHS)
def test_calibrated_vectors_give_the_same(capsys, tmp_path, photographs, key):
    entry, data = photographs[key]
    file = write(tmp_path / "s.csv", UNIT_COLUMNS, data["body"], data["icrs"])
    report = solved(capsys, [file, "--sigma", f"{entry['sigma_arcsec']!r}arcsec"])
    assert off(report, data["R"]) < REAL_STARS_ARCSEC
    assert report["rejected"] == []


@pytest.mark.parametrize("key", PHOTOGRAPHS)
@pytest.mark.parametrize("share", [0.2, 0.3, 0.4, 0.5])
@pytest.mark.parametrize("trial", range(10))
def test_shuffled_catalogue_rows_are_named(capsys, tmp_path, photographs, key, share, trial):  # noqa: PLR0917
    """A share of the catalogue rows goes round among the stars: all of them are wrong, and named."""
    entry, data = photographs[key]
    rng = np.random.default_rng([int(key[1:]), trial, int(100 * share)])
    count = len(data["icrs"])
    wrong = np.sort(rng.choice(count, max(2, round(share * count)), replace=False))
    order = np.arange(count)
    order[wrong] = np.roll(wrong, 1)
    file = as_csv(tmp_path / "s.csv", entry, data, order)
    report = solved(capsys, [file, *camera_options(entry), "--robust"])
    named = set(report["rejected"])
    shuffled = {f"HIP{data['hip'][k]}" for k in wrong}
    assert shuffled <= named
    # Two of the photographs have a star 4 sigma off, which a gate at 99.9 % leaves out as well.
    assert len(named - shuffled) <= 1
    used = [k for k in range(count) if f"HIP{data['hip'][k]}" not in named]
    body, icrs = data["body"][used], data["icrs"][used]
    u, _, v = np.linalg.svd(body.T @ icrs)
    expected = u @ np.diag([1, 1, np.linalg.det(u) * np.linalg.det(v)]) @ v
    assert off(report, expected) < REAL_STARS_ARCSEC
    difference = rotation_error(data["R"], np.array(report["dcm"]))
    assert difference @ np.linalg.solve(np.array(report["covariance"]), difference) < 16.3

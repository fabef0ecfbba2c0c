"""Fields of gravity at the door: shapes, bad input, warnings, copies; and the published numbers of Eros."""

import copy
import pickle
import warnings

import numpy as np
import pytest

import losnav as ln
from losnav.gravity import eros
from tests.conftest import SAME_FORMULA

CUBE = 1e3 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
SQUARES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
FACES = np.array([half for a, b, c, d in SQUARES for half in ([a, b, c], [a, c, d])])
FIELDS = {
    "point mass": lambda: ln.gravity.PointMass(4.5e5),
    "uniform": lambda: ln.gravity.Uniform([0.0, 0.1, -9.8]),
    "harmonics": lambda: eros.near15a(4),
    "unnormalised": eros.five_terms,
    "polyhedron": lambda: ln.gravity.Polyhedron(CUBE, FACES, 2000.0),
}
FAR = np.array([20e3, -10e3, 15e3])


@pytest.mark.parametrize("name", FIELDS)
def test_shapes(name):
    field = FIELDS[name]()
    for lead in ((), (1,), (4,), (2, 0), (3, 2)):
        r = np.broadcast_to(FAR, (*lead, 3))
        assert field.potential(r).shape == lead
        assert field.acceleration(r).shape == (*lead, 3)
        assert field.gradient(r).shape == (*lead, 3, 3)
    assert field.acceleration(FAR.tolist()).dtype == np.float64
    np.testing.assert_array_equal(
        field.acceleration(np.asfortranarray(np.tile(FAR, (4, 1))))[2],
        field.acceleration(np.tile(FAR, (4, 1)))[2],
    )


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_and_pickles(name, duplicate):
    field = FIELDS[name]()
    twin = duplicate(field)
    assert repr(twin) == repr(field)
    np.testing.assert_array_equal(twin.gradient(FAR), field.gradient(FAR))


@pytest.mark.parametrize("name", FIELDS)
def test_fields_are_frozen_and_read_well(name):
    field = FIELDS[name]()
    with pytest.raises(AttributeError):
        field.mu = 1.0
    assert "object at 0x" not in repr(field)
    assert len(repr(field)) < 200


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_times_a_number(name):
    field = FIELDS[name]()
    for scaled in (0.8 * field, field * 0.8, field.scaled(0.8)):
        assert type(scaled) is type(field)
        np.testing.assert_allclose(scaled.gradient(FAR), 0.8 * field.gradient(FAR), rtol=SAME_FORMULA)
    for factor in (-0.1, np.nan, [1.0]):
        with pytest.raises(ln.InvalidInputError, match="factor"):
            field.scaled(factor)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize(
    ("r", "message"),
    [
        ([1.0, 2.0], r"r: expected shape \(\.\.\., 3\), got \(2,\)"),
        (1.0, r"r: expected shape \(\.\.\., 3\)"),
        ([[FAR, FAR], [FAR, [np.nan, 0, 0]]], r"r\[1, 1, 0\]: expected a finite number"),
        ("somewhere", "r: expected"),
    ],
)
def test_bad_places_are_named(name, r, message):
    field = FIELDS[name]()
    if name == "uniform" and "finite" in message:
        with pytest.raises(ln.InvalidInputError, match=message):
            field.potential(r)
        return
    for ask in (field.potential, field.acceleration, field.gradient):
        with pytest.raises(ln.InvalidInputError, match=message):
            ask(r)


def test_the_centre_has_no_field():
    with pytest.raises(
        ln.InvalidInputError, match=r"r: expected a place where the field is finite, got \[0, 0, 0\]"
    ):
        ln.gravity.PointMass(1.0).acceleration([0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        ln.gravity.Polyhedron(CUBE, FACES, 2000.0).acceleration([0.0, 0.0, 0.0]), 0.0, atol=1e-17
    )


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ln.gravity.PointMass(-1.0), "mu: expected a number >= 0"),
        (lambda: ln.gravity.Uniform([1.0, 2.0]), r"acceleration: expected shape \(\.\.\., 3\)"),
        (lambda: ln.gravity.Uniform(np.zeros((2, 3))), r"acceleration: expected shape \(3,\), got \(2, 3\)"),
        (lambda: ln.gravity.Harmonics(1.0, 0.0, [[1]], [[0]]), "radius: expected a number > 0"),
        (lambda: ln.gravity.Harmonics(1.0, 1.0, [[1, 0]], [[0, 0]]), r"c: expected shape \(N \+ 1, N \+ 1\)"),
        (lambda: ln.gravity.Harmonics(1.0, 1.0, np.eye(3), np.zeros((2, 2))), "s: expected the shape of c"),
        (lambda: ln.gravity.Harmonics(1.0, 1.0, [[2.0]], [[0.0]]), r"c\[0, 0\]: expected 1"),
        (lambda: ln.gravity.Harmonics(1.0, 1.0, np.ones((2, 2)), np.zeros((2, 2))), r"c\[0, 1\]: expected 0"),
        (lambda: ln.gravity.Harmonics(1.0, 1.0, np.eye(2), np.eye(2)), "s: expected zeros in the first"),
        (lambda: eros.near15a(11), "degree: expected 0 to 10, got 11"),
        (lambda: eros.near15a(4).rotated([1.0]), "longitude: expected a number"),
        (lambda: ln.gravity.Polyhedron(CUBE[:3], FACES, 1.0), "vertices: expected at least 4 rows"),
        (
            lambda: ln.gravity.Polyhedron(CUBE, FACES + 1, 1.0),
            r"faces\[\d+, \d\]: expected an index from 0 to 7",
        ),
        (lambda: ln.gravity.Polyhedron(CUBE, FACES.astype(float), 1.0), "faces: expected whole numbers"),
        (
            lambda: ln.gravity.Polyhedron(CUBE, FACES[:-1], 1.0),
            r"faces\[\d+\]: expected a closed surface, got no",
        ),
        (lambda: ln.gravity.Polyhedron(CUBE, FACES[[*range(12), 0]], 1.0), r"faces\[\d+\]: .*closed.*twice"),
        (lambda: ln.gravity.Polyhedron(CUBE, FACES[:, ::-1], 1.0), "faces: expected counterclockwise.*-8e"),
        (lambda: ln.gravity.Polyhedron(CUBE, FACES, -1.0), "density: expected a number >= 0"),
        (
            lambda: ln.gravity.Polyhedron(0 * CUBE, FACES, 1.0),
            r"faces\[0\]: expected a triangle with an area",
        ),
        (lambda: ln.gravity.Polyhedron(CUBE, FACES, 1.0).harmonics(-1), "degree: expected 0 or more"),
        (
            lambda: ln.gravity.Polyhedron(CUBE, FACES, 1.0).rotated(np.ones((3, 3))),
            "dcm: expected a rotation",
        ),
    ],
)
def test_bad_parameters_are_named(call, message):
    with pytest.raises(ln.InvalidInputError, match=message):
        call()


# --- shape files ----------------------------------------------------------------------------------


@pytest.mark.parametrize("base", [0, 1])
def test_shape_files(tmp_path, base):
    """OBJ counts from one, plate models of the PDS from zero; squares are cut in two."""
    path = tmp_path / "cube.tab"
    lines = ["# a cube", *(f"v   {x:.5E}  {y:.5E} {z:.5E}" for x, y, z in CUBE / 1e3), "vn 0 0 1", ""]
    lines += [
        "f " + " ".join(f"{k + base}/7/{k + base}" if base else str(k) for k in square) for square in SQUARES
    ]
    path.write_text("\n".join(lines))
    vertices, faces = ln.gravity.read_shape(path, unit=1000.0)
    np.testing.assert_array_equal(vertices, CUBE)
    np.testing.assert_array_equal(faces, FACES)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 1 2\n", r"shape.obj, line 1: cannot be read: 'v 1 2'"),
        ("v 1 2 3\nf 1 x 2\n", "line 2: cannot be read"),
        ("v 1 2 nan\nf 1 1 1\n", r"vertices\[0, 2\]: expected a finite number"),
        ("nothing here\n", "found no shape"),
    ],
)
def test_bad_shape_files_are_named(tmp_path, text, message):
    path = tmp_path / "shape.obj"
    path.write_text(text)
    with pytest.raises(ln.InvalidInputError, match=message):
        ln.gravity.read_shape(path)
    with pytest.raises(ln.InvalidInputError, match="unit: expected a number > 0"):
        ln.gravity.read_shape(path, unit=0.0)


# --- where harmonics may be used ------------------------------------------------------------------


def test_harmonics_inside_the_sphere_warn_once():
    field = eros.near15a(4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field.acceleration([18e3, 0.0, 0.0])
    with pytest.warns(
        ln.gravity.BrillouinWarning, match=r"15116 m from the centre.*17700 m.*2\.6 times"
    ) as caught:
        field.acceleration([[18e3, 0.0, 0.0], [15116.0, 0.0, 0.0]])
    assert len(caught) == 1
    assert caught[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field.gradient([15e3, 0.0, 0.0])


def test_the_sphere_is_the_reference_one_unless_told():
    c, s = np.eye(1), np.zeros((1, 1))
    with pytest.warns(ln.gravity.BrillouinWarning):
        ln.gravity.Harmonics(1.0, 100.0, c, s).potential([99.0, 0.0, 0.0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ln.gravity.Harmonics(1.0, 100.0, c, s, brillouin_radius=50.0).potential([99.0, 0.0, 0.0])
        eros.five_terms(brillouin_radius=0.0).potential([1.0, 0.0, 0.0])


# --- Eros -----------------------------------------------------------------------------------------


def test_eros_in_principal_axes():
    """The unnormalised five of the landing literature, and what a rotation by -9.418 degrees leaves of S."""
    field = eros.principal(4)
    assert np.degrees(0.5 * np.arctan2(eros.near15a(2).s[2, 2], eros.near15a(2).c[2, 2])) == pytest.approx(
        -9.418, abs=5e-4
    )
    for n, m, normalised in [
        (2, 0, -5.246184e-2),
        (2, 2, 8.706208e-2),
        (4, 0, 1.293148e-2),
        (4, 2, -1.802783e-2),
        (4, 4, 1.938071e-2),
    ]:
        assert field.c[n, m] == pytest.approx(normalised, abs=5e-9)
    assert field.s[4, 2] == pytest.approx(-1.3e-3, abs=5e-5)
    assert field.s[4, 4] == pytest.approx(3.5e-3, abs=5e-5)
    assert abs(field.s[2, 2]) < 1e-17
    five = eros.five_terms()
    assert not five.normalized
    for n, m, unnormalised in [
        (2, 0, -1.173082e-1),
        (2, 2, 5.619833e-2),
        (4, 0, 3.879445e-2),
        (4, 2, -4.031146e-3),
        (4, 4, 4.094922e-4),
    ]:
        assert five.c[n, m] == pytest.approx(unnormalised, rel=5e-7)
    assert np.count_nonzero(five.c) == 6
    # 5.27026 hours.
    assert abs(2 * np.pi / eros.ROTATION_RATE / 3600 - 5.27026) < 5e-6


def test_eros_at_the_landing_site():
    """Of the five terms: 4.48e-3 m/s^2 at 30 m, the end of a descent to the tip, 2.93e-3 at its start."""
    field = eros.five_terms(brillouin_radius=0.0)
    site = ln.dynamics.Site.on_body(np.radians(2.0), 0.0, 15116.0, eros.ROTATION_RATE)
    for r, size in (([0.0, 0.0, 30.0], 4.48e-3), ([400.0, -300.0, 2000.0], 2.93e-3)):
        g = field.acceleration(site.to_fixed(r))
        assert np.linalg.norm(g) == pytest.approx(size, abs=5e-6)

"""Fields of gravity against the oracle, against each other and against quadrature."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from tests.conftest import SAME_FORMULA
from tests.oracle import gravity as oracle

MU, RADIUS = 4.46275472004e5, 16e3
SEEDS = st.integers(0, 2**32)


def tables(rng, degree):
    """Unnormalised coefficients whose normalised ones are like those of Eros."""
    c, s = np.zeros((2, degree + 1, degree + 1))
    for n in range(1, degree + 1):
        for m in range(n + 1):
            c[n, m] = 0.1 / n**2 * rng.normal() * oracle.factor(n, m)
            s[n, m] = 0.1 / n**2 * rng.normal() * oracle.factor(n, m) * (m > 0)
    c[0, 0] = 1.0
    return c, s


def place(rng, nearest=1.05, farthest=30.0):
    direction = rng.normal(size=3)
    return RADIUS * rng.uniform(nearest, farthest) * direction / np.linalg.norm(direction)


def close(found, expected, tolerance=SAME_FORMULA):
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * np.abs(expected).max())


def body(rng, divisions=1):
    """Corners and faces of a lumpy body around the origin, seen from outside."""
    vertices = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    vertices = [np.array(v, dtype=float) for v in vertices]
    faces = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(divisions):
        middle, finer = {}, []
        for face in faces:
            between = []
            for k in range(3):
                key = tuple(sorted((face[k], face[(k + 1) % 3])))
                if key not in middle:
                    middle[key] = len(vertices)
                    vertices.append(vertices[key[0]] + vertices[key[1]])
                between.append(middle[key])
            a, b, c = face
            ab, bc, ca = between
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = finer
    vertices = np.array([v / np.linalg.norm(v) for v in vertices])
    return 5e3 * vertices * rng.uniform(0.6, 1.4, size=(len(vertices), 1)) * [2.0, 1.0, 0.8], np.array(faces)


# --- harmonics ------------------------------------------------------------------------------------


@given(seed=SEEDS, degree=st.integers(0, 12))
def test_harmonics_against_the_oracle(seed, degree):
    rng = np.random.default_rng(seed)
    (c, s), r = tables(rng, degree), place(rng)
    field = ln.gravity.Harmonics(MU, RADIUS, c, s)
    u, g, gradient = oracle.harmonics(MU, RADIUS, c, s, r)
    close(field.potential(r), u)
    close(field.acceleration(r), g)
    close(field.gradient(r), gradient)


@given(seed=SEEDS)
def test_the_five_terms_are_the_polynomials(seed):
    rng = np.random.default_rng(seed)
    field = ln.gravity.eros.five_terms()
    coefficients = [field.c[n, m] for n, m in ((2, 0), (2, 2), (4, 0), (4, 2), (4, 4))]
    r = place(rng, 1.2)
    u, g, gradient = oracle.five_terms(MU, RADIUS, coefficients, r)
    close(field.potential(r), u)
    close(field.acceleration(r), g)
    close(field.gradient(r), gradient)


@given(seed=SEEDS, degree=st.integers(1, 8))
def test_normalised_and_unnormalised_are_the_same_field(seed, degree):
    rng = np.random.default_rng(seed)
    c, s = tables(rng, degree)
    field = ln.gravity.Harmonics(MU, RADIUS, c, s)
    table = np.array(
        [[oracle.factor(n, m) if m <= n else 1.0 for m in range(degree + 1)] for n in range(degree + 1)]
    )
    twin = ln.gravity.Harmonics.from_normalized(MU, RADIUS, c / table, s / table)
    r = place(rng)
    close(twin.acceleration(r), field.acceleration(r))
    for found, expected in zip(twin.coefficients(normalized=False), (c, s), strict=True):
        np.testing.assert_allclose(found, expected, rtol=SAME_FORMULA, atol=1e-300)
    for found, expected in zip(field.coefficients(normalized=True), (c / table, s / table), strict=True):
        np.testing.assert_allclose(found, expected, rtol=SAME_FORMULA, atol=1e-300)


@given(seed=SEEDS, longitude=st.floats(-7.0, 7.0))
def test_turned_axes(seed, longitude):
    rng = np.random.default_rng(seed)
    field = ln.gravity.Harmonics(MU, RADIUS, *tables(rng, 6))
    cos, sin = np.cos(longitude), np.sin(longitude)
    turn, r = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]]), place(rng)
    close(field.rotated(longitude).acceleration(turn @ r), turn @ field.acceleration(r))


def test_truncated_and_scaled(rng):
    c, s = tables(rng, 6)
    field, r = ln.gravity.Harmonics(MU, RADIUS, c, s), place(rng)
    close(field.truncated(3).acceleration(r), oracle.harmonics(MU, RADIUS, c[:4, :4], s[:4, :4], r)[1])
    close(field.truncated(0).acceleration(r), ln.gravity.PointMass(MU).acceleration(r))
    for factor in (0.0, 0.2, 1.5):
        np.testing.assert_allclose(
            (factor * field).acceleration(r), factor * field.acceleration(r), rtol=SAME_FORMULA
        )


def test_high_degrees_neither_overflow_nor_lose_digits(rng):
    """Degree 200 outside the sphere: Laplace's equation, and the gradient of the potential by differences."""
    degree = 200
    c, s = np.tril(rng.normal(size=(2, degree + 1, degree + 1))) / (1.0 + np.arange(degree + 1)[:, None]) ** 2
    c[0], s[:, 0] = 0.0, 0.0
    field = ln.gravity.Harmonics.from_normalized(MU, RADIUS, c, s)
    r = 1.02 * RADIUS * np.array([0.48, -0.6, 0.64])
    h, g = 20.0, np.zeros(3)
    for axis in range(3):
        e = h * np.eye(3)[axis]
        g[axis] = (8 * (field.potential(r + e) - field.potential(r - e)) - field.potential(r + 2 * e)) / (
            12 * h
        )
        g[axis] += field.potential(r - 2 * e) / (12 * h)
    # Differences of order four, 20 m apart, of waves of 250 m.
    np.testing.assert_allclose(field.acceleration(r), g, rtol=3e-4)
    gradient = field.gradient(r)
    assert abs(np.trace(gradient)) < SAME_FORMULA * np.abs(gradient).max()


# --- polyhedra ------------------------------------------------------------------------------------


@settings(max_examples=30)
@given(seed=SEEDS)
def test_polyhedron_against_the_oracle(seed):
    rng = np.random.default_rng(seed)
    vertices, faces = body(rng)
    field = ln.gravity.Polyhedron(vertices, faces, 2500.0)
    density = ln.constants.GRAVITATIONAL_CONSTANT * 2500.0
    # Inside, at the surface and outside; beyond a few radii the oracle's own cancellation would be judged.
    for r in (0.3 * vertices[0], 1.001 * vertices[1], place(rng, 0.8, 2.0)):
        u, g, gradient, filled = oracle.polyhedron(vertices, faces, density, r)
        close(field.potential(r), u, 1e-11)
        close(field.acceleration(r), g, 1e-11)
        close(field.gradient(r), gradient, 1e-10)
        assert abs(field.laplacian(r) - filled) < 1e-10 * density
        assert field.contains(r) == (filled < -2 * np.pi * density)


def test_cube_against_quadrature():
    """Potential and acceleration of a cube as the sum over what it is made of."""
    vertices = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [half for a, b, c, d in squares for half in ([a, b, c], [a, c, d])]
    cube = ln.gravity.Polyhedron(vertices, faces, 1.0 / ln.constants.GRAVITATIONAL_CONSTANT)
    assert cube.volume == pytest.approx(8.0, rel=1e-15)
    assert cube.mu == pytest.approx(8.0, rel=1e-15)
    np.testing.assert_allclose(cube.center_of_mass, 0.0, atol=1e-15)
    nodes, weights = np.polynomial.legendre.leggauss(30)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes), axis=-1).reshape(-1, 3)
    mass = np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    for r in ([1.7, 0.3, -0.4], [0.0, 2.5, 1.0], [1.4, 1.4, 1.4]):
        apart = grid - r
        distance = np.linalg.norm(apart, axis=1)
        np.testing.assert_allclose(cube.potential(r), np.sum(mass / distance), rtol=1e-10)
        np.testing.assert_allclose(cube.acceleration(r), (mass / distance**3) @ apart, rtol=1e-9, atol=1e-12)


def test_polyhedron_and_its_own_harmonics(rng):
    """Outside the sphere the series of the body is the body; the Laplacian is zero there and not inside."""
    vertices, faces = body(rng, 2)
    field = ln.gravity.Polyhedron.of_mass(vertices, faces, MU)
    assert field.mu == pytest.approx(MU, rel=SAME_FORMULA)
    series = field.harmonics(16)
    outside = rng.normal(size=(40, 3))
    outside *= 2.0 * field.brillouin_radius / np.linalg.norm(outside, axis=1, keepdims=True)
    exact = field.acceleration(outside)
    off = np.linalg.norm(series.acceleration(outside) - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert off.max() < 1e-5
    # Degree by degree it gets better, by about a half each.
    coarse = field.harmonics(8).acceleration(outside) - exact
    assert np.linalg.norm(coarse, axis=1).max() > 20 * off.max() * np.linalg.norm(exact, axis=1).max()
    # The first degree is where the centre of mass is.
    c, s = series.coefficients(normalized=False)
    center = series.radius * np.array([c[1, 1], s[1, 1], c[1, 0]])
    np.testing.assert_allclose(center, field.center_of_mass, rtol=1e-9)


@pytest.mark.parametrize(("radii", "tolerance"), [(10, 1e-11), (500, 1e-8), (50_000, 1e-3)])
def test_polyhedron_far_away(rng, radii, tolerance):
    """Large terms cancel there, two digits for each factor of ten."""
    field = ln.gravity.Polyhedron(*body(rng), 2500.0)
    series = field.harmonics(12)
    r = rng.normal(size=(20, 3))
    r *= radii * field.brillouin_radius / np.linalg.norm(r, axis=1, keepdims=True)
    exact = series.acceleration(r)
    off = np.linalg.norm(field.acceleration(r) - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert off.max() < tolerance


def test_polyhedron_in_other_axes(rng):
    vertices, faces = body(rng)
    field = ln.gravity.Polyhedron(vertices, faces, 2500.0)
    turn = ln.attitude.dcm_from_mrp([0.2, -0.3, 0.4])
    r = place(rng, 0.9, 2.0)
    close(field.rotated(turn).acceleration(turn @ r), turn @ field.acceleration(r), 1e-11)


# --- all of them ----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 7, 1000])
def test_batches_are_single_places(rng, count):
    """One by one, in lanes, and shared out over threads."""
    vertices, faces = body(rng)
    fields = [
        ln.gravity.PointMass(MU),
        ln.gravity.Uniform([0.1, 0.2, -9.8]),
        ln.gravity.Harmonics(MU, RADIUS, *tables(rng, 5)),
        ln.gravity.Polyhedron(vertices, faces, 2500.0),
    ]
    r = np.stack([place(rng, 1.1, 2.0) for _ in range(count)])
    for field in fields:
        for ask in (field.potential, field.acceleration, field.gradient):
            single = np.stack([ask(each) for each in r])
            np.testing.assert_allclose(ask(r), single, rtol=1e-10, atol=1e-10 * np.abs(single).max())

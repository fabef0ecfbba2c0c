"""Gravity in plain NumPy, one place at a time: harmonics by complex solid ones, polyhedra face by face."""

import math

import numpy as np


def five_terms(mu, a, c, x):
    """``(U, g, gradient)`` of C20, C22, C40, C42, C44 (unnormalised) as polynomials, complex places too."""
    x, y, z = np.asarray(x)
    s, d = x * x + y * y, x * x - y * y
    place, one = np.array([x, y, z]), np.eye(3)
    solid = [
        (2, (2 * z * z - s) / 2, [-x, -y, 2 * z], np.diag([-1.0, -1, 2])),
        (2, 3 * d, [6 * x, -6 * y, 0], np.diag([6.0, -6, 0])),
        (
            4,
            (8 * z**4 - 24 * z * z * s + 3 * s * s) / 8,
            [
                (-48 * z * z * x + 12 * s * x) / 8,
                (-48 * z * z * y + 12 * s * y) / 8,
                (32 * z**3 - 48 * z * s) / 8,
            ],
            np.array(
                [
                    [-48 * z * z + 12 * s + 24 * x * x, 24 * x * y, -96 * z * x],
                    [24 * x * y, -48 * z * z + 12 * s + 24 * y * y, -96 * z * y],
                    [-96 * z * x, -96 * z * y, 96 * z * z - 48 * s],
                ]
            )
            / 8,
        ),
        (
            4,
            7.5 * (6 * z * z - s) * d,
            [
                7.5 * (-2 * x * d + (6 * z * z - s) * 2 * x),
                7.5 * (-2 * y * d - (6 * z * z - s) * 2 * y),
                7.5 * 12 * z * d,
            ],
            7.5
            * np.array(
                [
                    [12 * z * z - 2 * s - 2 * d - 8 * x * x, 0, 24 * z * x],
                    [0, -12 * z * z + 2 * s - 2 * d + 8 * y * y, -24 * z * y],
                    [24 * z * x, -24 * z * y, 12 * d],
                ]
            ),
        ),
        (
            4,
            105 * (x**4 - 6 * x * x * y * y + y**4),
            [105 * (4 * x**3 - 12 * x * y * y), 105 * (4 * y**3 - 12 * x * x * y), 0],
            105
            * np.array(
                [
                    [12 * x * x - 12 * y * y, -24 * x * y, 0],
                    [-24 * x * y, 12 * y * y - 12 * x * x, 0],
                    [0, 0, 0],
                ]
            ),
        ),
    ]
    r = np.sqrt(place @ place)
    u, g = mu / r, -mu * place / r**3
    gradient = mu * (3 * np.outer(place, place) / r**5 - one / r**3)
    for coefficient, (n, value, gradient_of, bend) in zip(c, solid, strict=True):
        k, slope = 2 * n + 1, np.array(gradient_of)
        f = mu * coefficient * a**n * r**-k
        u += f * value
        g = g + f * (slope - k * value * place / r**2)
        cross = np.outer(slope, place)
        gradient = gradient + f * (
            bend
            - k / r**2 * (cross + cross.T + value * one)
            + k * (k + 2) * value * np.outer(place, place) / r**4
        )
    return u, g, gradient


def derived(c):
    """Coefficients of ``a d/dx``, ``a d/dy``, ``a d/dz`` of ``Re sum c Z``: unnormalised, a degree more."""
    size = len(c)
    out = np.zeros((3, size + 1, size + 1), dtype=complex)
    for n in range(size):
        for m in range(n + 1):
            v = c[n, m]
            out[2, n + 1, m] -= (n - m + 1) * v
            if m == 0:
                out[0, n + 1, 1] -= v.real
                out[1, n + 1, 1] += 1j * v.real
                continue
            back = 0.5 * (n - m + 2) * (n - m + 1)
            out[0, n + 1, m + 1] -= 0.5 * v
            out[0, n + 1, m - 1] += back * v
            out[1, n + 1, m + 1] += 0.5j * v
            out[1, n + 1, m - 1] += back * 1j * v
    return out


def solid(degree, a, x):
    """``Z_nm = (a/r)^(n + 1) P_nm exp(i m lon)``."""
    x, y, z = np.asarray(x, dtype=float)
    r2 = x * x + y * y + z * z
    out = np.zeros((degree + 1, degree + 1), dtype=complex)
    out[0, 0] = a / math.sqrt(r2)
    for m in range(1, degree + 1):
        out[m, m] = (2 * m - 1) * (x + 1j * y) * a / r2 * out[m - 1, m - 1]
    for m in range(degree + 1):
        for n in range(m + 1, degree + 1):
            below = out[n - 2, m] if n > m + 1 else 0.0
            out[n, m] = ((2 * n - 1) * z * a / r2 * out[n - 1, m] - (n + m - 1) * a * a / r2 * below) / (
                n - m
            )
    return out


def harmonics(mu, a, c, s, x):
    """``(U, g, gradient)`` of unnormalised coefficients of any degree."""

    def total(coefficients):
        return float(np.sum(coefficients * solid(len(coefficients) - 1, a, x)).real)

    u = c - 1j * np.asarray(s)
    g = derived(u)
    return (
        mu / a * total(u),
        mu / a**2 * np.array([total(each) for each in g]),
        mu / a**3 * np.array([[total(each) for each in derived(row)] for row in g]),
    )


def factor(n, m):
    """``C = factor * C_normalized``."""
    return math.sqrt((2 - (m == 0)) * (2 * n + 1) * math.factorial(n - m) / math.factorial(n + m))


def polyhedron(vertices, faces, density, x):
    """``(U, g, gradient, laplacian)`` as Werner and Scheeres print them; ``density`` is ``G sigma``."""
    corners, normals = [], {}
    for face in faces:
        v = vertices[list(face)]
        n = np.cross(v[1] - v[0], v[2] - v[0])
        n = n / np.linalg.norm(n)
        corners.append((v - x, n))
        for k in range(3):
            normals[face[k], face[(k + 1) % 3]] = n
    u, g, gradient, filled = 0.0, np.zeros(3), np.zeros((3, 3)), 0.0
    for (i, j), n in normals.items():
        if i > j:
            continue
        along = (vertices[j] - vertices[i]) / np.linalg.norm(vertices[j] - vertices[i])
        other = normals[j, i]
        dyad = np.outer(n, np.cross(along, n)) + np.outer(other, np.cross(-along, other))
        a, b = vertices[i] - x, vertices[j] - x
        ways, e = np.linalg.norm(a) + np.linalg.norm(b), np.linalg.norm(b - a)
        weight = math.log((ways + e) / (ways - e))
        u += a @ dyad @ a * weight
        g -= dyad @ a * weight
        gradient += dyad * weight
    for r, n in corners:
        size = np.linalg.norm(r, axis=1)
        triple = r[0] @ np.cross(r[1], r[2])
        below = size.prod() + size[0] * (r[1] @ r[2]) + size[1] * (r[2] @ r[0]) + size[2] * (r[0] @ r[1])
        angle = 2 * math.atan2(triple, below)
        u -= (n @ r[0]) ** 2 * angle
        g += n * (n @ r[0]) * angle
        gradient -= np.outer(n, n) * angle
        filled -= angle
    return density * u / 2, density * g, density * gradient, density * filled

"""Hypothesis strategies: attitudes, scenes, noise, and the many layouts of one array."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st

from tests.oracle import attitude, los

SEEDS = st.integers(0, 2**32 - 1)


# --- attitudes --------------------------------------------------------------------------------------


@st.composite
def axes(draw):
    """Unit vectors, coordinate axes and planes included."""
    kind = draw(st.sampled_from(["any", "coordinate", "plane"]))
    if kind == "coordinate":
        return np.eye(3)[draw(st.integers(0, 2))] * draw(st.sampled_from([1.0, -1.0]))
    v = np.random.default_rng(draw(SEEDS)).standard_normal(3)
    if kind == "plane":
        v[draw(st.integers(0, 2))] = 0.0
    return v / np.linalg.norm(v)


@st.composite
def rotation_angles(draw):
    """Angles in [0, 2 pi): nothing, tiny, around the series switches, generic, near and at pi, near 2 pi."""
    exponent = draw(st.floats(-12, -1))
    return draw(
        st.sampled_from(
            [
                0.0,
                10**exponent,
                np.pi - 10**exponent,
                np.pi,
                np.pi + 10**exponent,
                2 * np.pi - 10**exponent,
                np.pi / 2,
                2 * np.pi / 3,
            ]
        )
        | st.floats(0, 2 * np.pi - 1e-3)
    )


@st.composite
def rotation_vectors(draw):
    """Axis times angle, the angle in [0, 2 pi)."""
    return draw(axes()) * draw(rotation_angles())


@st.composite
def mrps(draw):
    """MRPs of every size: e tan(angle / 4) with the angle in [0, 2 pi), so shadows are among them."""
    return draw(axes()) * np.tan(draw(rotation_angles()) / 4)


@st.composite
def short_mrps(draw):
    """MRPs inside or on the unit ball."""
    return attitude.mrp_inside(draw(mrps()))


@st.composite
def quaternions(draw):
    """Unit quaternions, scalar last, of either sign."""
    phi = draw(rotation_vectors())
    angle = np.linalg.norm(phi)
    axis = phi / angle if angle > 0 else np.array([1.0, 0, 0])
    q = np.append(axis * np.sin(angle / 2), np.cos(angle / 2))
    return q / np.linalg.norm(q) * draw(st.sampled_from([1.0, -1.0]))


@st.composite
def dcms(draw):
    """Proper orthogonal matrices."""
    return attitude.dcm_from_quaternion(draw(quaternions()))


# --- scenes -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Scene:
    """Landmarks, the true pose, and the 1-sigma noise of each LOS."""

    landmarks: np.ndarray
    position: np.ndarray
    mrp: np.ndarray
    sigma: float
    seed: int

    @property
    def count(self) -> int:
        return len(self.landmarks)

    @property
    def dcm(self) -> np.ndarray:
        return attitude.dcm_from_mrp(self.mrp)

    @property
    def weights(self) -> np.ndarray:
        return los.isotropic_weights(self.sigma, self.count)

    @property
    def los(self) -> np.ndarray:
        return los.predict_los(self.landmarks, self.position, self.mrp)

    def measured(self) -> np.ndarray:
        """Unit LOS with tangent noise."""
        return los.measure_tangent(self.los, self.sigma, np.random.default_rng(self.seed))


@st.composite
def landmark_sets(draw, minimum=4, maximum=12):
    """Landmarks in a volume, in a plane of any tilt, or on a ring; any offset and size."""
    count = draw(st.integers(minimum, maximum))
    kind = draw(st.sampled_from(["volume", "plane", "ring"]))
    rng = np.random.default_rng(draw(SEEDS))
    if kind == "ring":
        # Even spacing with a random turn and jitter keeps neighbours apart.
        angle = (np.arange(count) + rng.uniform(0.0, 0.5, count)) * 2 * np.pi / count
        points = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    else:
        points = rng.uniform(-1, 1, (count, 3))
        # Keep the first four apart so that a random draw is not a degenerate case by accident.
        points[:4, :2] += [[1.5, 1.5], [-1.5, 1.5], [-1.5, -1.5], [1.5, -1.5]][: min(count, 4)]
        if kind == "plane":
            points[:, 2] = 0
    tilt = attitude.dcm_from_mrp(rng.standard_normal(3) * 0.5)
    size = 10 ** draw(st.floats(-2, 4))
    offset = draw(st.sampled_from([0.0, 1.0, 30.0])) * rng.standard_normal(3)
    return size * (points @ tilt + offset)


@st.composite
def scenes(draw, minimum=4, maximum=12, max_depth=10.0, sigmas=(1e-6, 1e-4)):
    """A well-posed scene: the camera 2 to ``max_depth`` set sizes away, any direction and attitude."""
    landmarks = draw(landmark_sets(minimum, maximum))
    seed = draw(SEEDS)
    rng = np.random.default_rng(seed)
    centre = landmarks.mean(axis=0)
    # A single landmark has no extent; its scene is one metre in size.
    size = np.linalg.norm(landmarks - centre, axis=1).max() or 1.0
    normal = np.linalg.svd(landmarks - centre)[2][2] * rng.choice([-1.0, 1.0])
    away = normal + rng.uniform(-0.5, 0.5, 3)
    depth = draw(st.floats(2.0, max_depth))
    position = centre + depth * size * away / np.linalg.norm(away)
    sigma = 10 ** draw(st.floats(np.log10(sigmas[0]), np.log10(sigmas[1])))
    return Scene(landmarks, position, draw(short_mrps()), sigma, seed)


# --- layouts of one array ---------------------------------------------------------------------------


def strided(a):
    """Every second element along every axis of a larger array."""
    big = np.full(tuple(2 * n for n in a.shape), np.nan)
    view = big[tuple(slice(None, None, 2) for _ in a.shape)]
    view[...] = a
    return view


def reversed_strides(a):
    """Negative strides along every axis."""
    flip = tuple(slice(None, None, -1) for _ in a.shape)
    return np.ascontiguousarray(a[flip])[flip]


def read_only(a):
    """Write-protected copy."""
    b = a.copy()
    b.flags.writeable = False
    return b


def unaligned(a):
    """Data starting at an odd address."""
    buffer = bytearray(a.nbytes + 1)
    view = np.frombuffer(buffer, dtype=a.dtype, count=a.size, offset=1).reshape(a.shape)
    view[...] = a
    return view


class ArrayLike:
    """An object that is no array but offers ``__array__``."""

    def __init__(self, values):
        self.values = values

    def __array__(self, dtype=None, copy=None):
        del copy
        return np.array(self.values, dtype=dtype)


# Each maps a float64 array to something that means exactly the same numbers.
LAYOUTS = {
    "contiguous": np.ascontiguousarray,
    "fortran": np.asfortranarray,
    "strided": strided,
    "reversed": reversed_strides,
    "read-only": read_only,
    "unaligned": unaligned,
    "big-endian": lambda a: a.astype(">f8"),
    "little-endian": lambda a: a.astype("<f8"),
    "longdouble": lambda a: a.astype(np.longdouble),
    "list": lambda a: a.tolist(),
    "tuple": lambda a: tuple(a.tolist()) if a.ndim == 1 else tuple(map(tuple, a.tolist())),
    "list of arrays": list,
    "array-like": ArrayLike,
}

layouts = st.sampled_from(sorted(LAYOUTS))

"""Navigation of a lander by IMU, landmark camera and velocimeter, straight from the equations.

Attitude is ``C``, site from body (the transpose of the library's ``dcm``); its error ``C = C^ (I + [t x])``.
Errors are true minus estimate in the order ``[r v t (b_a b_g) (d)]``, then six ``[r t]`` for every clone,
then three for every landmark of the map. All arrays may have leading dimensions, one filter for each; gains
come from ``inv``, derivatives are written out in full, and nothing is clever.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np


def cross(v):
    """[v x]."""
    x, y, z = np.moveaxis(np.asarray(v, dtype=float), -1, 0)
    o = np.zeros_like(x)
    return np.stack([np.stack(r, -1) for r in ((o, -z, y), (z, o, -x), (-y, x, o))], -2)


def rotation(v):
    """exp([v x])."""
    a = np.linalg.norm(v, axis=-1)[..., None, None]
    k = cross(v)
    return np.eye(3) + np.sinc(a / np.pi) * k + 0.5 * np.sinc(a / (2 * np.pi)) ** 2 * (k @ k)


def rotation_vector(c):
    """The inverse of ``rotation`` for less than half a turn."""
    axis = 0.5 * np.stack(
        [c[..., 2, 1] - c[..., 1, 2], c[..., 0, 2] - c[..., 2, 0], c[..., 1, 0] - c[..., 0, 1]], axis=-1
    )
    sine = np.linalg.norm(axis, axis=-1)
    angle = np.arctan2(sine, 0.5 * (np.trace(c, axis1=-2, axis2=-1) - 1))
    return axis / np.sinc(angle / np.pi)[..., None]


def turned(c, v):
    """C v."""
    return np.einsum("...ij,...j->...i", c, v)


def transposed(m):
    return np.swapaxes(m, -1, -2)


@dataclass(frozen=True)
class World:
    """Site frame: its rotation rate, centre of mass to site, and ``gravity(r) -> (g, dg/dr)`` in its axes."""

    rate: np.ndarray
    center: np.ndarray
    gravity: Callable

    def acceleration(self, r, v, c, f, d):
        """v' of a lander with specific force f."""
        w = cross(self.rate)
        free = self.gravity(r)[0] - 2 * turned(w, v) - turned(w @ w, r + self.center)
        return turned(c, f) + free + d


@dataclass(frozen=True)
class Grade:
    """Process noise: densities of the IMU, walks of its biases, the inflation q of the acceleration, m^2/s^3,
    and the acceleration state (1-sigma, time constant) if there is one."""

    vrw: float
    arw: float
    accelerometer_walk: float = 0.0
    gyroscope_walk: float = 0.0
    psd: float = 0.0
    acceleration: tuple | None = None


@dataclass(frozen=True)
class State:
    """The estimate: clones are pairs (r, C), the map is (..., N, 3)."""

    r: np.ndarray
    v: np.ndarray
    c: np.ndarray
    ba: np.ndarray = field(default_factory=lambda: np.zeros(3))
    bg: np.ndarray = field(default_factory=lambda: np.zeros(3))
    d: np.ndarray = field(default_factory=lambda: np.zeros(3))
    clones: tuple = ()
    map: np.ndarray | None = None


@dataclass(frozen=True)
class Slots:
    """Which errors there are, and where."""

    biases: bool = False
    acceleration: bool = False

    @property
    def ba(self):
        return slice(9, 12)

    @property
    def bg(self):
        return slice(12, 15)

    @property
    def d(self):
        return slice(15, 18) if self.biases else slice(9, 12)

    @property
    def size(self):
        return 9 + 6 * self.biases + 3 * self.acceleration


@dataclass(frozen=True)
class Model:
    """Frame and field, noise, and which errors are estimated."""

    world: World
    grade: Grade
    slots: Slots = Slots()


R, V, T = slice(0, 3), slice(3, 6), slice(6, 9)


def total(x, slots):
    """Size of the covariance, clones and map included."""
    return slots.size + 6 * len(x.clones) + (0 if x.map is None else 3 * x.map.shape[-2])


def errors(truth, estimate, slots):
    """True minus estimate, without clones and map."""
    parts = [truth.r - estimate.r, truth.v - estimate.v, rotation_vector(transposed(estimate.c) @ truth.c)]
    if slots.biases:
        parts += [truth.ba - estimate.ba, truth.bg - estimate.bg]
    if slots.acceleration:
        parts.append(truth.d - estimate.d)
    return np.concatenate(np.broadcast_arrays(*parts), axis=-1)


def corrected(x, delta, slots):
    """The estimate after a correction of everything."""
    part = lambda s: delta[..., s]  # noqa: E731
    new = {"r": x.r + part(R), "v": x.v + part(V), "c": x.c @ rotation(part(T))}
    if slots.biases:
        new |= {"ba": x.ba + part(slots.ba), "bg": x.bg + part(slots.bg)}
    if slots.acceleration:
        new["d"] = x.d + part(slots.d)
    at, clones = slots.size, []
    for r, c in x.clones:
        clones.append((r + part(slice(at, at + 3)), c @ rotation(part(slice(at + 3, at + 6)))))
        at += 6
    if x.map is not None:
        new["map"] = x.map + part(slice(at, None)).reshape(*delta.shape[:-1], -1, 3)
    return replace(x, clones=tuple(clones), **new)


def mechanised(x, f, w, dt, model):
    """The estimate one IMU sample later, by Runge and Kutta's rule of order 4 with the attitude exact; and
    position, attitude, specific force and rate at mid-step."""
    f, w, world, grade = f - x.ba, w - x.bg, model.world, model.grade
    fade = (lambda t: np.exp(-t / grade.acceleration[1])) if grade.acceleration else (lambda t: 1.0)
    turn = lambda t: rotation(-t * world.rate) @ x.c @ rotation(t * w)  # noqa: E731

    def rates(t, r, v):
        return v, world.acceleration(r, v, turn(t), f, fade(t) * x.d)

    r1, v1 = rates(0.0, x.r, x.v)
    r2, v2 = rates(dt / 2, x.r + dt / 2 * r1, x.v + dt / 2 * v1)
    r3, v3 = rates(dt / 2, x.r + dt / 2 * r2, x.v + dt / 2 * v2)
    r4, v4 = rates(dt, x.r + dt * r3, x.v + dt * v3)
    moved = replace(
        x,
        r=x.r + dt / 6 * (r1 + 2 * r2 + 2 * r3 + r4),
        v=x.v + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4),
        c=turn(dt),
        d=fade(dt) * x.d,
    )
    return moved, (x.r + dt / 2 * r1, turn(dt / 2), f, w)


def transition(point, dt, model):
    """Phi: three terms of the exponential of F dt at mid-step; turn and decay in closed form."""
    (r, c, f, w), world, grade, slots = point, model.world, model.grade, model.slots
    n, spin = slots.size, cross(world.rate)
    matrix = np.zeros((*r.shape[:-1], n, n))
    matrix[..., R, V] = np.eye(3)
    matrix[..., V, R] = world.gravity(r)[1] - spin @ spin
    matrix[..., V, V] = -2 * spin
    matrix[..., V, T] = -c @ cross(f)
    matrix[..., T, T] = -cross(w)
    if slots.biases:
        matrix[..., V, slots.ba] = -c
        matrix[..., T, slots.bg] = -np.eye(3)
    if slots.acceleration:
        matrix[..., V, slots.d] = np.eye(3)
        matrix[..., slots.d, slots.d] = -np.eye(3) / grade.acceleration[1]
    a = matrix * dt
    phi = np.eye(n) + a + a @ a / 2 + a @ a @ a / 6
    phi[..., T, T] = rotation(-dt * w)
    if slots.acceleration:
        phi[..., slots.d, slots.d] = np.exp(-dt / grade.acceleration[1]) * np.eye(3)
    return phi


def process_noise(point, dt, model):
    """Q: every white noise through the integrals it drives, ``int G(s) G(s)' ds`` by Gauss's rule."""
    (r, c, f, _), grade, slots = point, model.grade, model.slots
    n, one = slots.size, np.eye(3)
    push = -c @ cross(f)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    q = np.zeros((*r.shape[:-1], n, n))
    for s, weight in zip(dt / 2 * (nodes + 1), dt / 2 * weights, strict=True):
        sources = [
            (grade.vrw**2 + grade.psd, ((R, s * one), (V, one))),
            (grade.arw**2, ((R, s**2 / 2 * push), (V, s * push), (T, one))),
        ]
        if slots.biases:
            accelerometer = ((R, -(s**2) / 2 * c), (V, -s * c), (slots.ba, one))
            gyroscope = ((R, -(s**3) / 6 * push), (V, -(s**2) / 2 * push), (T, -s * one), (slots.bg, one))
            sources += [(grade.accelerometer_walk**2, accelerometer), (grade.gyroscope_walk**2, gyroscope)]
        if slots.acceleration:
            sigma, tau = grade.acceleration
            sources.append((2 * sigma**2 / tau, ((R, s**2 / 2 * one), (V, s * one), (slots.d, one))))
        for density, parts in sources:
            g = np.zeros((*r.shape[:-1], n, 3))
            for place, part in parts:
                g[..., place, :] = part
            q += weight * density * g @ transposed(g)
    return q


def predict(x, p, sample, dt, model):
    """Estimate and covariance one IMU sample later; clones and map stand still."""
    moved, point = mechanised(x, *sample, dt, model)
    phi, n = transition(point, dt, model), model.slots.size
    after = np.array(p)
    after[..., :n, :] = phi @ after[..., :n, :]
    after[..., :, :n] = after[..., :, :n] @ transposed(phi)
    after[..., :n, :n] += process_noise(point, dt, model)
    return moved, 0.5 * (after + transposed(after))


def cloned(x, p, slots):
    """A copy of position and attitude as they are now, fully correlated, after the clones there are."""
    n, at = p.shape[-1], slots.size + 6 * len(x.clones)
    grow = np.zeros((n + 6, n))
    grow[:at, :at] = np.eye(at)
    grow[at : at + 3, R] = np.eye(3)
    grow[at + 3 : at + 6, T] = np.eye(3)
    grow[at + 6 :, at:] = np.eye(n - at)
    return replace(x, clones=(*x.clones, (x.r, x.c))), grow @ p @ grow.T


def dropped(x, p, slots, k):
    """Without clone k."""
    at = slots.size + 6 * k
    keep = np.r_[0:at, at + 6 : p.shape[-1]]
    clones = x.clones[:k] + x.clones[k + 1 :]
    return replace(x, clones=clones), p[..., keep[:, None], keep]


@dataclass(frozen=True)
class Camera:
    """Pinhole camera; ``map_errors`` is what becomes of the landmarks' own errors."""

    landmarks: np.ndarray
    focal: float
    sigma: float
    landmark_sigma: float = 0.0
    map_errors: str = "white"
    principal: tuple = (0.0, 0.0)
    mounting: np.ndarray = field(default_factory=lambda: np.eye(3))
    lever: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Rows:
    """Innovation, H over everything, R, and the parts (H_r, H_v) the predictive stage wants."""

    y: np.ndarray
    h: np.ndarray
    noise: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


def camera_rows(camera, x, z, slots, clone=None):
    """Rows of the landmarks that have pixels; at the pose of a clone, if one is given."""
    r, c = (x.r, x.c) if clone is None else x.clones[clone]
    size = total(x, slots)
    at = 0 if clone is None else slots.size + 6 * clone
    turn = T.start if clone is None else at + 3
    seen = np.flatnonzero(np.isfinite(z.reshape(-1, z.shape[-1])[0]).reshape(-1, 2).all(axis=1))
    marks = camera.landmarks if x.map is None else x.map
    ys, hs, positions, noises = [], [], [], []
    for i in seen:
        relative = turned(transposed(c), marks[..., i, :] - r)
        p = turned(camera.mounting, relative - camera.lever)
        depth = p[..., 2]
        shape = p.shape[:-1]
        pixel = camera.focal * p[..., :2] / depth[..., None] + camera.principal
        slope = np.zeros((*shape, 2, 3))
        slope[..., 0, 0] = slope[..., 1, 1] = camera.focal / depth
        slope[..., :, 2] = -camera.focal * p[..., :2] / depth[..., None] ** 2
        h = np.zeros((*shape, 2, size))
        position = -slope @ camera.mounting @ transposed(c)
        h[..., at : at + 3] = position
        h[..., turn : turn + 3] = slope @ camera.mounting @ cross(relative)
        noise = np.broadcast_to(camera.sigma**2 * np.eye(2), (*shape, 2, 2))
        if x.map is not None:
            first = slots.size + 6 * len(x.clones) + 3 * i
            h[..., first : first + 3] = -position
        elif camera.map_errors == "white":
            noise = noise + camera.landmark_sigma**2 * position @ transposed(position)
        ys.append(z[..., 2 * i : 2 * i + 2] - pixel)
        hs.append(h)
        positions.append(position)
        noises.append(noise)
    rows = 2 * len(seen)
    whole = np.zeros((*ys[0].shape[:-1], rows, rows))
    for k, noise in enumerate(noises):
        whole[..., 2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = noise
    position = np.concatenate(positions, axis=-2)
    return Rows(
        np.concatenate(ys, axis=-1), np.concatenate(hs, axis=-2), whole, position, np.zeros_like(position)
    )


def velocimeter_rows(sigma, x, z, slots):
    """Velocity in body axes."""
    down = transposed(x.c)
    seen = turned(down, x.v)
    h = np.zeros((*seen.shape[:-1], 3, total(x, slots)))
    h[..., V], h[..., T] = down, cross(seen)
    noise = np.broadcast_to(sigma**2 * np.eye(3), (*seen.shape[:-1], 3, 3))
    return Rows(z - seen, h, noise, np.zeros_like(h[..., R]), h[..., V])


def together(*parts):
    """Several sensors of one epoch as one measurement."""
    sizes = [part.y.shape[-1] for part in parts]
    noise = np.zeros((*parts[0].y.shape[:-1], sum(sizes), sum(sizes)))
    at = 0
    for part, n in zip(parts, sizes, strict=True):
        noise[..., at : at + n, at : at + n] = part.noise
        at += n
    join = lambda name, axis: np.concatenate([getattr(part, name) for part in parts], axis)  # noqa: E731
    return Rows(join("y", -1), join("h", -2), noise, join("position", -2), join("velocity", -2))


def update(x, p, rows, slots, considered=0):
    """Kalman's gain, Joseph's form; the last ``considered`` components are held. Returns the NIS too."""
    s = rows.h @ p @ transposed(rows.h) + rows.noise
    inverse = np.linalg.inv(s)
    gain = p @ transposed(rows.h) @ inverse
    if considered:
        gain[..., -considered:, :] = 0.0
    rest = np.eye(p.shape[-1]) - gain @ rows.h
    after = rest @ p @ transposed(rest) + gain @ rows.noise @ transposed(gain)
    nis = np.einsum("...i,...ij,...j->...", rows.y, inverse, rows.y)
    return corrected(x, turned(gain, rows.y), slots), 0.5 * (after + transposed(after)), nis


def model_error(rows, interval, weight):
    """d of the predictive stage: least squares of the innovation, d held back by ``weight``."""
    sensitivity = rows.position * interval**2 / 2 + rows.velocity * interval
    weighted = transposed(sensitivity) @ np.linalg.inv(rows.noise)
    return np.linalg.solve(weighted @ sensitivity + weight * np.eye(3), turned(weighted, rows.y)[..., None])[
        ..., 0
    ]


def pushed(x, d, interval):
    """The prediction with the model error over the interval."""
    return replace(x, r=x.r + d * interval**2 / 2, v=x.v + d * interval)

"""The error-state filter of inertial navigation beside twins of it: one step of the unit, one image.

Fifteen errors (position, velocity, attitude, two biases), a frame that does not turn, constant gravity, ten
landmarks a kilometre away in one image; Joseph's form everywhere.

============  =================================  ========================================================
contender     its model                          in losnav's terms
============  =================================  ========================================================
losnav        ``Strapdown``, ``LandmarkCamera``  general field and frame; arguments checked; NIS, gate for
                                                 every landmark, results reported
numba twin    arrays, a matrix for the attitude  the same algorithm for this field and frame alone, the
                                                 zeros of Phi used; small couplings of Q left out; no
                                                 checks, no reports, no gate
NumPy twin    arrays, a matrix for the attitude  the textbook: dense matrices, one solve for the image
============  =================================  ========================================================
"""

from __future__ import annotations

import numpy as np

import losnav as ln
from benches import numba_inertial
from benches.clock import Contender
from benches.filters import Row, interleaved

DT, COUNT = 0.01, 100
FOCAL, GRAVITY = 500.0, np.array([0.0, 0.0, -4e-3])
DENSITIES = np.array([1e-4, 1e-5, 1e-7, 1e-8]) ** 2
SIGMA = np.repeat([10.0, 0.1, 0.01, 1e-3, 1e-5], 3)
DOWN = np.diag([1.0, -1.0, -1.0])
PLACE, SPEED = np.array([4.0, -3.0, 1000.0]), np.array([0.1, -0.2, -1.0])
_angles = np.arange(10) * 2.4
MARKS = 40.0 * np.column_stack(
    [np.sqrt(1.0 + np.arange(10)) * f(_angles) for f in (np.cos, np.sin, np.zeros_like)]
)
CAMERA = ln.sensors.LandmarkCamera(MARKS, FOCAL, 1.0)
START = ln.NavState.from_dcm(PLACE, SPEED, DOWN)


def samples(count=COUNT, seed=3):
    """Hovering, and turning to and fro: ``(count, 6)``."""
    draws = np.random.default_rng(seed).standard_normal((count, 6)) * [1e-3] * 6
    draws[1::2, 3:] = -draws[::2, 3:]
    draws[:, :3] -= DOWN @ GRAVITY
    return draws


def images(count=COUNT, seed=5):
    """``(count, 20)`` pixels from one place."""
    noise = np.random.default_rng(seed).standard_normal((count, 2 * len(MARKS)))
    return CAMERA.predict(START) + noise


def engine(form="joseph", **options):
    """The filter."""
    root = np.sqrt(DENSITIES)
    unit = ln.dynamics.Imu(*(float(value) for value in root))
    model = ln.dynamics.Strapdown(ln.dynamics.Site.inertial(), ln.gravity.Uniform(GRAVITY), unit)
    return ln.ExtendedKalmanFilter(model, START, np.diag(SIGMA**2), form=form, **options)


def _answer(ekf):
    def read():
        x = ekf.state
        return np.concatenate([x.position, x.velocity]), ekf.covariance

    return read


# --- a step of the unit -------------------------------------------------------------------------------


def losnav_propagate(u, form="joseph"):
    """One call a sample."""
    ekf = engine(form)
    space = {"u": list(u), "predict": ekf.predict, "DT": DT}
    name = "losnav predict" + (f", form {form}" if form != "joseph" else "")
    return Contender(name, "for sample in u: predict(DT, sample)", space, len(u)), _answer(ekf)


def losnav_propagate_ud(u):
    """The factorised form."""
    return losnav_propagate(u, "ud")


def _arrays():
    return PLACE.copy(), SPEED.copy(), DOWN.T.copy(), np.zeros(6), np.diag(SIGMA**2)


def numba_propagate(u):
    """The twin."""
    r, v, c, biases, p = _arrays()
    work, phi, half, _, _ = numba_inertial.memory()
    body = "for f, w in u: propagate(r, v, c, biases, p, f, w, G, DT, densities, work, phi, half)"
    pairs = [(s[:3].copy(), s[3:].copy()) for s in u]
    space = {
        "u": pairs,
        "propagate": numba_inertial.propagate,
        "G": GRAVITY,
        "DT": DT,
        "densities": DENSITIES,
    }
    space |= {"r": r, "v": v, "c": c, "biases": biases, "p": p, "work": work, "phi": phi, "half": half}
    note = "this field and frame alone, no checks"
    return Contender("numba twin", body, space, len(u), note=note), lambda: (np.concatenate([r, v]), p)


def numpy_propagate(u):
    """The textbook."""
    x = _Textbook()
    contender = Contender("NumPy twin", "for s in u: propagate(s[:3], s[3:])", {"u": list(u)}, len(u))
    contender.namespace["propagate"] = x.propagate
    return contender, lambda: (np.concatenate([x.r, x.v]), x.p)


# --- an image -----------------------------------------------------------------------------------------


def losnav_update(z, form="joseph", gate=None):
    """One call an image."""
    ekf = engine(form, gate=gate)
    space = {"z": list(z), "update": ekf.update, "camera": CAMERA}
    name = "losnav update" + (f", form {form}" if form != "joseph" else "") + (", gate" if gate else "")
    return Contender(name, "for row in z: update(camera, row)", space, len(z)), _answer(ekf)


def losnav_update_gated(z):
    """Every landmark judged; wide enough to pass them all."""
    return losnav_update(z, gate=1e3)


def losnav_update_ud(z):
    """The factorised form."""
    return losnav_update(z, "ud")


def numba_update(z):
    """The twin."""
    r, v, c, biases, p = _arrays()
    _, _, _, work, small = numba_inertial.memory()
    body = "for row in z: update(r, v, c, biases, p, row, marks, focal, 1.0, work, small)"
    space = {"z": list(z), "update": numba_inertial.update, "marks": MARKS, "focal": FOCAL}
    space |= {"r": r, "v": v, "c": c, "biases": biases, "p": p, "work": work, "small": small}
    note = "no checks, no gate, no NIS"
    return Contender("numba twin", body, space, len(z), note=note), lambda: (np.concatenate([r, v]), p)


def numpy_update(z):
    """The textbook."""
    x = _Textbook()
    contender = Contender(
        "NumPy twin", "for row in z: update(row)", {"z": list(z), "update": x.update}, len(z)
    )
    return contender, lambda: (np.concatenate([x.r, x.v]), x.p)


# --- a whole arc --------------------------------------------------------------------------------------

EVERY = 10


def losnav_run(z, form="joseph"):
    """Ten samples from image to image, in one call."""
    u, times = samples(EVERY * len(z)), EVERY * DT * np.arange(1, len(z) + 1)
    space = {"fresh": engine(form), "times": times, "pairs": [(CAMERA, z)], "u": u, "n": EVERY, "kept": []}
    body = "log = fresh.copy().run(times, pairs, controls=u, substeps=n); kept[:] = [log]"
    name = "losnav run" + (f", form {form}" if form != "joseph" else "")

    def answer():
        log = space["kept"][0]
        last = log.state[-1]
        return np.concatenate([last.position, last.velocity]), log.covariance[-1]

    return Contender(name, body, space, len(z)), answer


def losnav_run_ud(z):
    """The factorised form."""
    return losnav_run(z, "ud")


def numba_run(z):
    """The twin, memory for the results given."""
    u = samples(EVERY * len(z))
    states, covariances = np.empty((len(z), 6)), np.empty((len(z), 15, 15))
    body = "run(*arrays(), f, w, z, G, DT, densities, marks, focal, 1.0, memory, states, covariances)"
    space = {"run": numba_inertial.run, "arrays": _arrays, "f": u[:, :3].copy(), "w": u[:, 3:].copy(), "z": z}
    space |= {"G": GRAVITY, "DT": DT, "densities": DENSITIES, "marks": MARKS, "focal": FOCAL}
    space |= {"memory": numba_inertial.memory(), "states": states, "covariances": covariances}
    note = "this field and frame alone, no checks, no NIS, memory given"
    return Contender("numba twin", body, space, len(z), note=note), lambda: (states[-1], covariances[-1])


def _skew(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def _exp(a):
    angle = np.sqrt(a @ a)
    k = _skew(a)
    return np.eye(3) + np.sinc(angle / np.pi) * k + 0.5 * np.sinc(angle / (2 * np.pi)) ** 2 * (k @ k)


class _Textbook:
    """Dense matrices, as one writes it down."""

    def __init__(self):
        self.r, self.v, self.c, self.biases, self.p = _arrays()
        self.noise = np.diag(np.concatenate([np.zeros(3), np.repeat(DENSITIES, 3)]))
        self.one = np.eye(15)

    def propagate(self, f, w):
        f, w = f - self.biases[:3], w - self.biases[3:]
        middle, end = self.c @ _exp(w * DT / 2), self.c @ _exp(w * DT)
        a, b, d = (c @ f + GRAVITY for c in (self.c, middle, end))
        self.r = self.r + DT * self.v + DT**2 / 6 * (a + 2 * b)
        self.v = self.v + DT / 6 * (a + 4 * b + d)
        self.c = end
        a = np.zeros((15, 15))
        a[:3, 3:6] = np.eye(3)
        a[3:6, 6:9], a[3:6, 9:12] = -middle @ _skew(f), -middle
        a[6:9, 6:9], a[6:9, 12:] = -_skew(w), -np.eye(3)
        a *= DT
        a2 = a @ a
        phi = self.one + a + a2 / 2 + a2 @ a / 6
        self.p = phi @ self.p @ phi.T + DT / 2 * (phi @ self.noise @ phi.T + self.noise)

    def update(self, z):
        body = (MARKS - self.r) @ self.c
        over = 1.0 / body[:, 2]
        n = len(MARKS)
        gradient = np.zeros((n, 2, 3))
        gradient[:, 0, 0] = gradient[:, 1, 1] = FOCAL * over
        gradient[:, :, 2] = -FOCAL * body[:, :2] * (over**2)[:, np.newaxis]
        h = np.zeros((n, 2, 15))
        h[:, :, :3] = -gradient @ self.c.T
        h[:, :, 6:9] = np.cross(gradient, body[:, np.newaxis])
        h = h.reshape(2 * n, 15)
        y = z - (FOCAL * body[:, :2] * over[:, np.newaxis]).ravel()
        hp = h @ self.p
        s = hp @ h.T + np.eye(2 * n)
        k = np.linalg.solve(s, hp).T
        delta = k @ y
        left = self.one - k @ h
        self.p = left @ self.p @ left.T + k @ k.T
        self.r, self.v, self.c = self.r + delta[:3], self.v + delta[3:6], self.c @ _exp(delta[6:9])
        self.biases = self.biases + delta[9:]


PROPAGATE = [losnav_propagate, losnav_propagate_ud, numba_propagate, numpy_propagate]
RUN = [losnav_run, losnav_run_ud, numba_run]
UPDATE = [losnav_update, losnav_update_gated, losnav_update_ud, numba_update, numpy_update]


def _difference(answer, reference):
    """Largest difference of position, velocity and covariance, in standard deviations."""
    deviation = np.sqrt(np.diagonal(reference[1]))
    states = np.abs((answer[0] - reference[0]) / deviation[:6]).max()
    return float(max(states, np.abs((answer[1] - reference[1]) / np.outer(deviation, deviation)).max()))


def measure(makers, rows, rounds):
    """Rows of all contenders on the same samples or images; ratios are against the first."""
    contenders, answers = [], []
    for make in makers:
        contender, answer = make(rows)
        exec(contender.statement, contender.namespace)
        answers.append([np.array(part) for part in answer()])
        contenders.append(contender)
    times = interleaved(contenders, rounds)
    return [
        Row(
            contender.name,
            1e9 * time.median,
            1e9 * time.minimum,
            time.median / times[0].median,
            _difference(answer, answers[0]),
            contender.note,
        )
        for contender, answer, time in zip(contenders, answers, times, strict=True)
    ]


def tables(*, rounds):
    """``{title: rows}`` of the three tables."""
    return {
        "One sample of the unit: predict": measure(PROPAGATE, samples(), rounds),
        "One image of ten landmarks: update": measure(UPDATE, images(), rounds),
        "An arc of 100 images, ten samples each: one of them": measure(RUN, images(), rounds),
    }

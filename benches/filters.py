"""The extended Kalman filter beside its peers: single steps, whole arcs, batches of arcs.

Relative motion in six states, range and two angles every 60 s, a target 520 m ahead; Joseph's form
everywhere.

============  =============================  ============================================================
peer          its model                      in losnav's terms
============  =============================  ============================================================
losnav        ``ClohessyWiltshire``,         transition and process noise computed from the time step
              ``RangeBearing``               when it changes; arguments checked; NIS, gate, results reported
numba twin    arrays                         as losnav; Phi, Q given; no checks, no reports
filterpy      ``F``, ``Q``; ``hx`` and       Phi, Q given; the measurement in plain ``math``, faster than
              ``HJacobian`` are ours         NumPy on three numbers
Stone Soup    linear transition model,       Phi, Q given; state with the opposite sign (the target seen
              elevation-bearing-range        from the chaser), ``[elevation, bearing, range]``
============  =============================  ============================================================
"""

from __future__ import annotations

import copy
import datetime
import math
from dataclasses import dataclass

import numpy as np

import losnav as ln
from benches import numba_filter
from benches.clock import Contender, interleaved

MEAN_MOTION, PSD, DT = 1.04248275e-3, 1e-9, 60.0
SIGMA_RANGE, SIGMA_ANGLE = 0.2, 6e-4
# On the orbit of the target, ahead of it: stays there, so an arc may be repeated without end.
PLACE = np.array([-520.0, 0, 0, 0, 0, 0])
START = PLACE + np.array([3.0, -2.0, 4.0, 0.01, -0.01, 0.01])
PRIOR = np.diag([100.0] * 3 + [0.0025] * 3)
DCM = np.eye(3)
VARIANCES = np.square([SIGMA_RANGE, SIGMA_ANGLE, SIGMA_ANGLE])
EPOCHS = 100
ORBIT = ln.dynamics.ClohessyWiltshire(MEAN_MOTION, PSD)
CAMERA = ln.sensors.RangeBearing(SIGMA_RANGE, SIGMA_ANGLE)
PHI, Q = ORBIT.transition(PLACE, DT), ORBIT.process_noise(PLACE, DT)


@dataclass
class Row:
    """One contender of one table."""

    name: str
    nanoseconds: float
    minimum: float
    ratio: float
    difference: float
    note: str


def measurements(runs=None, epochs=EPOCHS, seed=11):
    """Noisy looks from one place."""
    shape = (epochs, 3) if runs is None else (runs, epochs, 3)
    noise = np.random.default_rng(seed).standard_normal(shape)
    return CAMERA.predict(PLACE, dcm=DCM) + noise * np.sqrt(VARIANCES)


# --- one step after another ---------------------------------------------------------------------------


def losnav_step(z):
    """Predict and update in one call."""
    ekf = ln.ExtendedKalmanFilter(ORBIT, START, PRIOR)
    body = "for row in z: step(DT, camera, row, dcm=DCM)"
    space = {"z": list(z), "step": ekf.step, "DT": DT, "camera": CAMERA, "DCM": DCM}
    return Contender("losnav step", body, space, len(z)), lambda: (ekf.state, ekf.covariance)


def losnav_predict_update(z):
    """Two calls."""
    ekf = ln.ExtendedKalmanFilter(ORBIT, START, PRIOR)
    body = "for row in z: predict(DT); update(camera, row, dcm=DCM)"
    space = {"z": list(z), "predict": ekf.predict, "update": ekf.update}
    space |= {"DT": DT, "camera": CAMERA, "DCM": DCM}
    return Contender("losnav predict + update", body, space, len(z)), lambda: (ekf.state, ekf.covariance)


def losnav_step_ud(z):
    """The factorised form."""
    ekf = ln.ExtendedKalmanFilter(ORBIT, START, PRIOR, form="ud")
    body = "for row in z: step(DT, camera, row, dcm=DCM)"
    space = {"z": list(z), "step": ekf.step, "DT": DT, "camera": CAMERA, "DCM": DCM}
    contender = Contender("losnav step, form ud", body, space, len(z))
    return contender, lambda: (ekf.state, ekf.covariance)


def numba_step(z):
    """The twin, a call a step."""
    x, p, work = START.copy(), PRIOR.copy(), np.empty((7, 6))
    body = "for row in z: step(x, p, PHI, Q, row, DCM, V, work)"
    space = {"z": list(z), "step": numba_filter.step, "x": x, "p": p, "work": work}
    space |= {"PHI": PHI, "Q": Q, "DCM": DCM, "V": VARIANCES}
    contender = Contender("numba twin", body, space, len(z), note="no checks, no reports, Phi and Q given")
    return contender, lambda: (x, p)


def _hx(x):
    a, b, c = -x[0], -x[1], -x[2]
    return np.array([math.sqrt(a * a + b * b + c * c), math.atan2(b, a), math.atan2(c, math.hypot(a, b))])


def _jacobian(x):
    a, b, c = -x[0], -x[1], -x[2]
    flat2 = a * a + b * b
    rho2 = flat2 + c * c
    rho, k = math.sqrt(rho2), rho2 * math.sqrt(flat2)
    return np.array(
        [
            [-a / rho, -b / rho, -c / rho, 0, 0, 0],
            [b / flat2, -a / flat2, 0, 0, 0, 0],
            [a * c / k, b * c / k, -flat2 / k, 0, 0, 0],
        ]
    )


def _residual(z, h):
    y = z - h
    y[1:] = (y[1:] + math.pi) % (2 * math.pi) - math.pi
    return y


def filterpy_step(z):
    """filterpy."""
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(6, 3)
    ekf.x, ekf.P, ekf.F, ekf.Q, ekf.R = START.copy(), PRIOR.copy(), PHI, Q, np.diag(VARIANCES)
    body = "for row in z: ekf.predict(); ekf.update(row, jacobian, hx, residual=residual)"
    space = {"z": list(z), "ekf": ekf, "hx": _hx, "jacobian": _jacobian, "residual": _residual}
    contender = Contender("filterpy", body, space, len(z), note="Phi and Q given")
    return contender, lambda: (ekf.x, ekf.P)


def stonesoup_step(z):
    """Stone Soup; the estimate has the opposite sign."""
    from stonesoup.models.measurement.nonlinear import CartesianToElevationBearingRange
    from stonesoup.models.transition.linear import LinearGaussianTimeInvariantTransitionModel
    from stonesoup.predictor.kalman import ExtendedKalmanPredictor
    from stonesoup.types.angle import Bearing, Elevation
    from stonesoup.types.array import StateVector
    from stonesoup.types.detection import Detection
    from stonesoup.types.hypothesis import SingleHypothesis
    from stonesoup.types.state import GaussianState
    from stonesoup.updater.kalman import ExtendedKalmanUpdater

    motion = LinearGaussianTimeInvariantTransitionModel(transition_matrix=PHI, covariance_matrix=Q)
    seen = CartesianToElevationBearingRange(6, (0, 1, 2), np.diag(VARIANCES[[2, 1, 0]]))
    tools = ExtendedKalmanPredictor(motion), ExtendedKalmanUpdater(seen, use_joseph_cov=True)
    state = [GaussianState(-START[:, np.newaxis], PRIOR, timestamp=datetime.datetime(2000, 1, 1))]
    rows = [StateVector([Elevation(row[2]), Bearing(row[1]), row[0]]) for row in z]

    def step(row):
        time = state[0].timestamp + datetime.timedelta(seconds=DT)
        prediction = tools[0].predict(state[0], timestamp=time)
        detection = Detection(row, timestamp=time, measurement_model=seen)
        state[0] = tools[1].update(SingleHypothesis(prediction, detection))

    contender = Contender("Stone Soup", "for row in z: step(row)", {"z": rows, "step": step}, len(z))
    contender.note = "Phi and Q given; Jacobian by differences, hence the difference"
    return contender, lambda: (-np.ravel(state[0].mean).astype(float), np.asarray(state[0].covar, float))


# --- whole arcs ---------------------------------------------------------------------------------------


def losnav_run(z, form="joseph", arrays=False):
    """One arc or many in one call: everything is computed, arrays are put in order when first asked for."""
    ekf = ln.ExtendedKalmanFilter(ORBIT, START, PRIOR, form=form)
    times = DT * np.arange(1, z.shape[-2] + 1)
    space = {"fresh": ekf, "copy": copy.copy, "times": times, "pairs": [(CAMERA, z)], "DCM": DCM, "kept": []}
    body = "log = copy(fresh).run(times, pairs, dcm=DCM); kept[:] = [log]"
    if arrays:
        body += "; log.state; log.covariance"
    name = "losnav run" + (f", form {form}" if form != "joseph" else "")
    contender = Contender(name, body, space, math.prod(z.shape[:-1]))
    if arrays:
        contender.name = "losnav run, .state and .covariance read"
    return contender, lambda: (space["kept"][0].state, space["kept"][0].covariance)


def losnav_run_read(z):
    """The same, and the arrays put in order."""
    return losnav_run(z, arrays=True)


def losnav_run_ud(z):
    """The factorised form."""
    return losnav_run(z, "ud")


def numba_run(z):
    """The twin, memory for the results given."""
    states, covariances = np.empty((*z.shape[:-1], 6)), np.empty((*z.shape[:-1], 6, 6))
    space = {"z": z, "START": START, "PRIOR": PRIOR, "work": np.empty((7, 6))}
    space |= {"PHI": PHI, "Q": Q, "DCM": DCM, "V": VARIANCES, "states": states, "covariances": covariances}
    if z.ndim == 2:
        space["run"] = numba_filter.run
        body = "run(START.copy(), PRIOR.copy(), PHI, Q, z, DCM, V, work, states, covariances)"
    else:
        space["run"] = numba_filter.run_batch
        body = "run(START, PRIOR, PHI, Q, z, DCM, V, states, covariances)"
    name = "numba twin" if z.ndim == 2 else "numba prange"
    note = "no checks, no NIS, Phi, Q and memory given"
    contender = Contender(name, body, space, math.prod(z.shape[:-1]), note=note)
    return contender, lambda: (states, covariances)


# --- tables -------------------------------------------------------------------------------------------

STEPS = [losnav_step, losnav_predict_update, losnav_step_ud, numba_step, filterpy_step, stonesoup_step]
RUNS = [losnav_run, losnav_run_read, losnav_run_ud, numba_run]


def measure(makers, z, rounds):
    """Rows of all contenders on the same measurements; ratios are against the first."""
    contenders, answers = [], []
    for make in makers:
        contender, answer = make(z)
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


def _difference(answer, reference):
    """Largest difference of states and covariances after the same measurements, in standard deviations."""
    deviation = np.sqrt(np.diagonal(reference[1], axis1=-2, axis2=-1))
    scale = deviation[..., :, np.newaxis] * deviation[..., np.newaxis, :]
    states = np.abs((answer[0] - reference[0]) / deviation).max()
    return float(max(states, np.abs((answer[1] - reference[1]) / scale).max()))


def tables(*, quick, rounds):
    """``{title: rows}`` of the three tables."""
    arcs, epochs = (200, 20) if quick else (10_000, 20)
    batch = measurements(arcs, epochs)
    return {
        "One step: predict and update": measure(STEPS, measurements(), rounds),
        "A whole arc of 1000 steps, one step": measure(RUNS, measurements(epochs=1000), rounds),
        f"{arcs} arcs of {epochs} steps in one call, all cores, one step": measure(RUNS, batch, rounds),
    }

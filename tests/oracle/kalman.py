"""The extended Kalman filter and the Rauch-Tung-Striebel smoother, straight from their definitions.

A model has ``propagate(x, dt, u)``, ``transition(x, dt, u)`` and ``process_noise(x, dt)``; a sensor has
``predict(x)``, ``jacobian(x)``, ``noise()``, ``residual(z, h)`` and ``blocks``, the sizes of its groups of
rows. A group marked ``unit`` is a unit direction: it is expressed in two axes across the predicted one, so
its innovation has as many rows as it has degrees of freedom. States are vectors.

One update of one sensor, in this order:

1. linearise at the prior: ``y = z [-] h(x-)``, ``H``, ``R``; a row of NaN is no measurement;
2. ``S = H P- H' + R``, ``NIS = y' S^-1 y``, compare with the gate (unless the filter may be locked out);
3. gain of the underweighted problem, ``R' = R + beta H P- H'`` within each group of rows, the rows of
   considered components zero;
4. correct the state; repeat 1 and 3 at the corrected state while iterating (Gauss-Newton about the prior);
5. covariance by Joseph's form with the last ``H`` and gain: it holds for any gain.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2


@dataclass(frozen=True)
class Options:
    """How the filter updates."""

    gate: float | None = None
    relock_after: int | None = 3
    iterations: int = 1
    underweighting: float = 0.0
    consider: tuple[int, ...] = ()


@dataclass(frozen=True)
class Rows:
    """A measurement linearised at a state, in as many rows as it has degrees of freedom."""

    innovation: np.ndarray
    jacobian: np.ndarray
    noise: np.ndarray
    blocks: tuple[int, ...]


@dataclass(frozen=True)
class Update:
    """What an update did; ``gain`` and ``jacobian`` are those of the last iteration."""

    state: np.ndarray
    covariance: np.ndarray
    innovation: np.ndarray
    innovation_covariance: np.ndarray
    nis: float
    dof: int
    accepted: bool
    jacobian: np.ndarray
    gain: np.ndarray


def symmetrised(p):
    """(P + P') / 2."""
    return 0.5 * (p + p.T)


def across(direction):
    """(2, 3) orthonormal rows perpendicular to a unit vector."""
    return np.linalg.svd(direction[np.newaxis])[2][1:]


def linearise(sensor, x, z):
    """Rows of ``z [-] h(x)``; unit directions reduced to the plane across the predicted one."""
    h, jacobian, noise = sensor.predict(x), sensor.jacobian(x), sensor.noise()
    y = sensor.residual(z, h)
    if not getattr(sensor, "unit", False):
        return Rows(y, jacobian, noise, tuple(sensor.blocks))
    plane = block_diag(*[across(b) for b in h.reshape(-1, 3)])
    return Rows(plane @ y, plane @ jacobian, plane @ noise @ plane.T, (2,) * (len(h) // 3))


def gate_bound(gate, dof):
    """Bound on NIS: a number itself, or the quantile of the probability to keep a good measurement."""
    if gate is None:
        return np.inf
    return chi2.ppf(gate, dof) if gate < 1.0 else gate


def predict(model, x, p, dt, control=None):
    """(x-, P-, Phi)."""
    phi = model.transition(x, dt, control)
    moved = model.propagate(x, dt, control)
    return moved, symmetrised(phi @ p @ phi.T + model.process_noise(x, dt)), phi


def joseph(p, h, k, r):
    """Covariance after a correction with any gain."""
    rest = np.eye(len(p)) - k @ h
    return symmetrised(rest @ p @ rest.T + k @ r @ k.T)


def gain(rows, p, options):
    """(K, R') of a linearised measurement, considered components held."""
    spread = rows.jacobian @ p @ rows.jacobian.T
    ends = np.cumsum(rows.blocks)
    pieces = [spread[e - n : e, e - n : e] for n, e in zip(rows.blocks, ends, strict=True)]
    noise = rows.noise + options.underweighting * block_diag(*pieces)
    k = np.linalg.solve((spread + noise).T, rows.jacobian @ p.T).T
    k[list(options.consider)] = 0.0
    return k, noise


def update(sensor, x, p, z, options=Options(), *, locked_out=False):
    """One sensor's measurement; ``locked_out`` accepts it whatever its NIS."""
    if np.isnan(z).any():
        nothing = np.full(len(z), np.nan)
        empty = np.full((len(z), len(z)), np.nan)
        return Update(x, p, nothing, empty, np.nan, 0, False, np.zeros((0, len(x))), np.zeros((len(x), 0)))
    rows = linearise(sensor, x, z)
    s = symmetrised(rows.jacobian @ p @ rows.jacobian.T + rows.noise)
    nis = float(rows.innovation @ np.linalg.solve(s, rows.innovation))
    dof = len(rows.innovation)
    first = (rows.innovation, s, nis, dof)
    if nis > gate_bound(options.gate, dof) and not locked_out:
        return Update(x, p, *first, False, rows.jacobian, np.zeros((len(x), dof)))
    point, k = x, None
    for i in range(options.iterations):
        if i:
            rows = linearise(sensor, point, z)
        k, noise = gain(rows, p, options)
        point = x + k @ (rows.innovation - rows.jacobian @ (x - point))
    return Update(point, joseph(p, rows.jacobian, k, noise), *first, True, rows.jacobian, k)


@dataclass
class Log:
    """Everything of an arc; lists over the epochs, updates one list for each epoch."""

    time: list = field(default_factory=list)
    predicted: list = field(default_factory=list)
    predicted_covariance: list = field(default_factory=list)
    transition: list = field(default_factory=list)
    state: list = field(default_factory=list)
    covariance: list = field(default_factory=list)
    updates: list = field(default_factory=list)


@dataclass
class ExtendedKalmanFilter:
    """A filter that remembers: state, covariance, time, rejections in a row of each sensor by its place."""

    model: object
    state: np.ndarray
    covariance: np.ndarray
    options: Options = Options()
    time: float = 0.0
    rejections: dict = field(default_factory=dict)

    def predict(self, dt, control=None):
        """Moves the filter by ``dt``; returns Phi."""
        self.state, self.covariance, phi = predict(self.model, self.state, self.covariance, dt, control)
        self.time += dt
        return phi

    def update(self, sensor, z, place=0):
        """One measurement; ``place`` tells sensors apart when counting rejections."""
        count = self.rejections.get(place, 0)
        limit = self.options.relock_after
        locked_out = limit is not None and count >= limit
        done = update(sensor, self.state, self.covariance, np.asarray(z, float), self.options,
                      locked_out=locked_out)  # fmt: skip
        if np.isfinite(done.nis):
            self.rejections[place] = 0 if done.accepted else count + 1
        self.state, self.covariance = done.state, done.covariance
        return done

    def run(self, times, measurements, controls=None):
        """``measurements``: list of (sensor or list of one sensor for each epoch, z (T, M))."""
        log = Log()
        for k, t in enumerate(times):
            control = None if controls is None else controls[k]
            phi = self.predict(t - self.time, control)
            self.time = t
            log.time.append(t)
            log.transition.append(phi)
            log.predicted.append(self.state)
            log.predicted_covariance.append(self.covariance)
            log.updates.append(
                [
                    self.update(sensor[k] if isinstance(sensor, list) else sensor, z[k], place)
                    for place, (sensor, z) in enumerate(measurements)
                ]
            )
            log.state.append(self.state)
            log.covariance.append(self.covariance)
        return log


def smooth(log):
    """Rauch-Tung-Striebel: (T, N) states and (T, N, N) covariances given the whole arc."""
    x, p = list(log.state), list(log.covariance)
    for k in reversed(range(len(x) - 1)):
        phi, ahead = log.transition[k + 1], log.predicted_covariance[k + 1]
        c = np.linalg.solve(ahead.T, phi @ log.covariance[k].T).T
        x[k] = log.state[k] + c @ (x[k + 1] - log.predicted[k + 1])
        p[k] = symmetrised(log.covariance[k] + c @ (p[k + 1] - ahead) @ c.T)
    return np.array(x), np.array(p)

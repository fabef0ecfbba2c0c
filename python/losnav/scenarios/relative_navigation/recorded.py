"""The filter on recorded orbits: where the linear model breaks, whether the filter says so, what repairs it.

Two satellites' inertial states are given at equal steps. A range and two angles of each epoch are simulated,
the attitude in the target's frame being known, and filtered with one of three models:

``"cw"``
    Clohessy-Wiltshire in the target's orbital frame. Left out: the curvature of the orbit, x²/2R, 1.8 km at
    160 km, an acceleration of 6 mm/s² there.
``"curvilinear"``
    The same equations along the arc of the orbit; a sensor of the user's own turns the state back. Left out:
    what J2 and the eccentricity do differently to the two, 0.6 mm/s² at 160 km.
``"j2"``
    The difference of two J2 orbits about the chaser's GPS fixes. Left out: drag and the other harmonics,
    1 µm/s².
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from losnav.errors import InvalidInputError
from losnav.orbits import curvilinear_from_lvlh, lvlh_from_curvilinear, relative_state

__all__ = ["MODELS", "CurvilinearCamera", "Followed", "Recorded", "follow"]

Array = NDArray[np.float64]

#: What a filter can predict with.
MODELS = ("cw", "curvilinear", "j2")

_SIGMA_RANGE, _SIGMA_ANGLE = 0.2, np.radians(0.1) / 3
_PRIOR = np.repeat([100.0, 0.1], 3)  # 1-sigma of the first guess, m and m/s
_STEP = 1e-6  # of a central difference, relative to the distance from the planet


@dataclass(frozen=True)
class Recorded:
    """Two recorded orbits.

    Attributes
    ----------
    times : (T,) array
        Epochs, s.
    target, chaser : (T, 6) arrays
        Inertial position and velocity (pole along z), m and m/s.
    """

    times: Array
    target: Array
    chaser: Array

    def every(self, stride: int) -> Recorded:
        """Every ``stride``-th epoch."""
        return Recorded(self.times[::stride], self.target[::stride], self.chaser[::stride])

    @cached_property
    def relative(self) -> Array:
        """Chaser minus target in the target's orbital frame, m and m/s, (T, 6)."""
        earth = ln.dynamics.TwoBody(EARTH_MU, j2=EARTH_J2, radius=EARTH_RADIUS)
        ahead, behind = (earth.propagate(self.target, dt)[:, 3:] for dt in (1.0, -1.0))
        return np.asarray(relative_state(self.chaser, self.target, 0.5 * (ahead - behind)))

    @property
    def range(self) -> Array:
        """Distance, m, (T,)."""
        return np.asarray(np.linalg.norm(self.relative[:, :3], axis=-1))

    @property
    def radius(self) -> float:
        """Mean distance of the target from the planet's centre, m."""
        return float(np.linalg.norm(self.target[:, :3], axis=-1).mean())

    @property
    def dcm(self) -> Array:
        """Body from the target's frame: boresight (+x) on the target, z as near to nadir as it can be."""
        x = -self.relative[:, :3] / self.range[:, None]
        y = np.cross([0.0, 0.0, 1.0], x)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=-2)


@dataclass(frozen=True)
class CurvilinearCamera:
    """Range and two angles of a state in curvilinear coordinates: a user's sensor around a built-in one.

    Attributes
    ----------
    camera : RangeBearing
    radius : float
        Of the target's orbit, m.
    """

    camera: ln.sensors.RangeBearing
    radius: float

    def predict(self, state: Any, **context: Any) -> Array:
        """Measurement expected at a state."""
        return np.asarray(self.camera.predict(lvlh_from_curvilinear(state, self.radius), **context))

    def jacobian(self, state: Any, **context: Any) -> Array:
        """Derivative, (3, 6): the camera's times that of the coordinates, by central differences."""
        straight = lvlh_from_curvilinear(state, self.radius)
        width = _STEP * self.radius
        steps = np.concatenate([np.eye(3), -np.eye(3)]) * width
        moved = lvlh_from_curvilinear(np.asarray(state) + np.pad(steps, ((0, 0), (0, 3))), self.radius)
        turn = (moved[:3, :3] - moved[3:, :3]).T / (2 * width)
        out = np.zeros((3, 6))
        out[:, :3] = self.camera.jacobian(straight, **context)[..., :3] @ turn
        return out

    def noise(self, state: Any = None, **context: Any) -> Array:
        """Covariance of the measurement."""
        return np.asarray(self.camera.noise())

    def residual(self, z: Any, predicted: Any) -> Array:
        """Difference with wrapped angles."""
        return np.asarray(self.camera.residual(z, predicted))


@dataclass(frozen=True)
class Followed:
    """What a filter made of a recorded arc.

    Attributes
    ----------
    model : str
    acceleration_psd : float
        m²/s³.
    error : (runs, T, 6) array
        True minus estimate in the model's own coordinates, m and m/s.
    nees, nis : NormalisedErrors
        See :mod:`losnav.consistency`.
    """

    model: str
    acceleration_psd: float
    error: Array
    nees: ln.consistency.NormalisedErrors
    nis: ln.consistency.NormalisedErrors


def follow(
    recorded: Recorded, model: str, acceleration_psd: float, *, runs: int = 5, seed: int = 0
) -> Followed:
    """Simulate range and angles along recorded orbits and filter them.

    Parameters
    ----------
    recorded : Recorded
        True motion; its first epoch is that of the first guess, the others are measured.
    model : {"cw", "curvilinear", "j2"}
        What the filter predicts with.
    acceleration_psd : float
        Its process noise, m²/s³.
    runs, seed : int
        Repetitions with fresh noise and first guesses; the same for every model.

    Returns
    -------
    Followed

    Raises
    ------
    InvalidInputError
        If the model is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
    >>> from losnav.scenarios.relative_navigation.recorded import Recorded, follow
    >>> earth = ln.dynamics.TwoBody(EARTH_MU, j2=EARTH_J2, radius=EARTH_RADIUS)
    >>> target = np.array([7.0e6, 0.0, 0.0, 0.0, 1000.0, 7480.0])
    >>> times = np.arange(0.0, 3001.0, 60.0)
    >>> chaser = earth.propagate(target, -10.0)                       # 75 km behind
    >>> orbits = [earth.trajectory(start, times) for start in (target, chaser)]
    >>> follow(Recorded(times, *orbits), "cw", 1e-9).nis.verdict
    'optimistic'
    """
    if model not in MODELS:
        raise InvalidInputError(f"model: expected one of {', '.join(MODELS)}, got {model!r}")
    rng = np.random.default_rng(seed)
    truth, times, dcm = recorded.relative, recorded.times, recorded.dcm
    camera = ln.sensors.RangeBearing(_SIGMA_RANGE, _SIGMA_ANGLE)
    guess = truth[0] + _PRIOR * rng.standard_normal((runs, 6))
    z = camera.simulate(np.broadcast_to(truth[1:], (runs, len(times) - 1, 6)), rng, dcm=dcm[1:])
    sensor: Any = camera
    dynamics: Any = ln.dynamics.ClohessyWiltshire(_mean_motion(recorded), acceleration_psd)
    if model == "curvilinear":
        sensor = CurvilinearCamera(camera, recorded.radius)
        truth, guess = (curvilinear_from_lvlh(x, recorded.radius) for x in (truth, guess))
    elif model == "j2":
        dynamics = ln.dynamics.RelativeTwoBody(
            EARTH_MU, recorded.chaser, times, acceleration_psd, j2=EARTH_J2, radius=EARTH_RADIUS
        )
    ekf = ln.ExtendedKalmanFilter(dynamics, guess, np.diag(_PRIOR**2), iterations=2, time=times[0])
    log = ekf.run(times[1:], [(sensor, z)], dcm=dcm[1:])
    nees = ln.consistency.nees(log, truth[1:])
    return Followed(model, acceleration_psd, truth[1:] - log.state, nees, ln.consistency.nis(log))


def _mean_motion(recorded: Recorded) -> float:
    """Of the recorded target: from its turns about the planet."""
    position = recorded.target[:, :3] / np.linalg.norm(recorded.target[:, :3], axis=1, keepdims=True)
    turn = np.arctan2(
        np.linalg.norm(np.cross(position[:-1], position[1:]), axis=1),
        np.sum(position[:-1] * position[1:], axis=1),
    )
    return float(turn.sum() / (recorded.times[-1] - recorded.times[0]))

"""True motion: two satellites on orbits of their own about an oblate Earth.

The target starts on an osculating circular orbit; the chaser from a relative state in the target's orbital
frame T (x along track, y negative orbit normal, z nadir). Their relative state is

    r = C_TI (R_C − R_T),    v = C_TI (V_C − V_T) − w × r,    w the angular rate of T.

A burn is held in the axes of T, over steps short enough that its direction in space is right to 1e-5.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.orbits import chaser_state, lvlh_from_inertial, relative_state

if TYPE_CHECKING:
    from losnav.scenarios.relative_navigation import RelativeNavigation

__all__ = ["Arc", "Burn", "fly", "frame_angles", "linear"]

Array = NDArray[np.float64]

_BURN_STEP = 10.0  # s; the orbital frame turns by 0.6 degrees meanwhile


@dataclass(frozen=True)
class Burn:
    """A constant acceleration along +x of the target's frame.

    Attributes
    ----------
    acceleration : float
        m/s².
    start, duration : float
        s.
    """

    acceleration: float
    start: float
    duration: float

    def over(self, begin: Array, end: Array) -> Array:
        """Mean acceleration over the steps from ``begin`` to ``end`` (s), in T axes, m/s², (..., 3)."""
        on = np.minimum(end, self.start + self.duration) - np.maximum(begin, self.start)
        share = np.clip(on, 0.0, None) / (end - begin)
        return np.asarray(self.acceleration * share[..., None] * np.array([1.0, 0.0, 0.0]))


@dataclass(frozen=True)
class Arc:
    """True motion at the measurement epochs.

    Attributes
    ----------
    times : (T,) array
        Epochs, s; the start at 0 is not among them.
    start : (6,) array
        Relative state at t = 0, m and m/s.
    relative : (T, 6) array
        Relative state in the target's orbital frame, m and m/s.
    target, chaser : (T, 6) arrays
        Inertial position and velocity, m and m/s.
    control : (T, 3) array
        Acceleration of the chaser over the step that ends at each epoch, axes of T, m/s².
    """

    times: Array
    start: Array
    relative: Array
    target: Array
    chaser: Array
    control: Array

    @property
    def target_frame(self) -> Array:
        """Target's orbital frame from inertial, C_TI, (T, 3, 3)."""
        return lvlh_from_inertial(self.target[:, :3], self.target[:, 3:])

    @property
    def chaser_frame(self) -> Array:
        """Chaser's orbital frame from inertial, C_OI, (T, 3, 3)."""
        return lvlh_from_inertial(self.chaser[:, :3], self.chaser[:, 3:])

    @property
    def pointing(self) -> Array:
        """Body from inertial with the boresight (+x) on the target and z as near to nadir as it can be."""
        los = self.target[:, :3] - self.chaser[:, :3]
        x = los / np.linalg.norm(los, axis=-1, keepdims=True)
        y = np.cross(-self.chaser[:, :3], x)
        y /= np.linalg.norm(y, axis=-1, keepdims=True)
        return np.stack([x, y, np.cross(x, y)], axis=-2)

    @property
    def range(self) -> Array:
        """Distance of the two, m, (T,)."""
        return np.asarray(np.linalg.norm(self.relative[:, :3], axis=-1))


def epochs(scenario: RelativeNavigation, duration: float) -> Array:
    """Measurement epochs up to ``duration``, s."""
    count = math.floor(duration / scenario.sampling + 1e-9)
    return np.asarray(scenario.sampling * np.arange(1.0, count + 1.0), dtype=np.float64)


def gravity(scenario: RelativeNavigation) -> ln.dynamics.TwoBody:
    """Gravity of the truth."""
    return ln.dynamics.TwoBody(scenario.mu, j2=scenario.j2, radius=scenario.earth_radius)


def target_at_start(scenario: RelativeNavigation) -> Array:
    """Inertial state of the target at t = 0, m and m/s, (6,)."""
    s = scenario
    node, latitude = s.node, s.argument_of_latitude
    turn = np.array([[math.cos(node), -math.sin(node), 0], [math.sin(node), math.cos(node), 0], [0, 0, 1]])
    tilt = np.array([1.0, math.cos(s.inclination), math.sin(s.inclination)])
    radius = s.earth_radius + s.altitude
    out = radius * turn @ (tilt * [math.cos(latitude), math.sin(latitude), math.sin(latitude)])
    along = turn @ (tilt * [-math.sin(latitude), math.cos(latitude), math.cos(latitude)])
    return np.concatenate([out, math.sqrt(s.mu / radius) * along])


def fly(
    scenario: RelativeNavigation,
    position: object,
    velocity: object,
    duration: float,
    burn: Burn | None = None,
) -> Arc:
    """Fly target and chaser from a relative state at t = 0 (m, m/s)."""
    times, model = epochs(scenario, duration), gravity(scenario)
    start = np.concatenate([position, velocity]).astype(np.float64)
    target = target_at_start(scenario)
    chaser = _absolute(model, target, start)
    grid = np.concatenate([[0.0], times])
    if burn is None:
        states = model.trajectory(np.stack([target, chaser]), grid)[:, 1:]
    else:
        states = _burning(model, np.stack([target, chaser]), grid, burn)[:, 1:]
    control = np.zeros((len(times), 3)) if burn is None else burn.over(grid[:-1], times)
    relative = relative_state(states[1], states[0], _acceleration(model, states[0]))
    return Arc(times, start, np.asarray(relative), states[0], states[1], control)


def linear(scenario: RelativeNavigation, position: object, velocity: object, duration: float) -> Arc:
    """The same with a chaser that follows the Clohessy-Wiltshire equations exactly about the true target."""
    times, model = epochs(scenario, duration), gravity(scenario)
    start = np.concatenate([position, velocity]).astype(np.float64)
    grid = np.concatenate([[0.0], times])
    relative = ln.dynamics.ClohessyWiltshire(scenario.mean_motion).trajectory(start, grid)[1:]
    target = model.trajectory(target_at_start(scenario), grid)[1:]
    return Arc(times, start, relative, target, _absolute(model, target, relative), np.zeros((len(times), 3)))


def _burning(model: ln.dynamics.TwoBody, start: Array, grid: Array, burn: Burn) -> Array:
    """Trajectories of target and chaser, the latter with the burn, at the epochs of ``grid``."""
    end = burn.start + burn.duration
    fine = np.unique(np.concatenate([grid, np.arange(burn.start, end, _BURN_STEP), [burn.start, end]]))
    middle = 0.5 * (fine[:-1] + fine[1:])
    target = model.trajectory(start[0], fine)
    halfway = model.trajectory(start[0], np.concatenate([[0.0], middle]))[1:]
    frame = lvlh_from_inertial(halfway[:, :3], halfway[:, 3:])
    control = np.einsum("kji,kj->ki", frame, burn.over(fine[:-1], fine[1:]))
    chaser = model.trajectory(start[1], fine, control)
    picks = np.searchsorted(fine, grid)
    return np.stack([target[picks], chaser[picks]])


def _acceleration(model: ln.dynamics.TwoBody, state: Array) -> Array:
    """Acceleration along an orbit, m/s², by central differences over 2 s: good to 1e-6."""
    ahead, behind = (model.propagate(state, dt)[..., 3:] for dt in (1.0, -1.0))
    return np.asarray(0.5 * (ahead - behind))


def _absolute(model: ln.dynamics.TwoBody, target: Array, relative: Array) -> Array:
    return np.asarray(chaser_state(relative, target, _acceleration(model, target)))


def frame_angles(scenario: RelativeNavigation, distance: float, count: int = 500) -> Array:
    """Angles between the orbital frames of the target and of chasers at ``distance`` (m), rad, (count + 1,).

    At rest in the target's frame in evenly spread directions, and one that crosses the target's plane at the
    speed of an oscillation of this amplitude.
    """
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + math.sqrt(5)) * k
    side = np.sqrt(1 - z * z)
    position = distance * np.stack([side * np.cos(turn), side * np.sin(turn), z], axis=-1)
    # A chaser of this amplitude across the plane moves fastest where it crosses it.
    resting = np.concatenate([position, 0 * position], axis=-1)
    crossing = np.zeros((1, 6))
    crossing[0, 4] = scenario.mean_motion * distance
    relative = np.concatenate([resting, crossing])
    target = np.broadcast_to(target_at_start(scenario), relative.shape)
    chaser = _absolute(gravity(scenario), target, relative)
    frames = [lvlh_from_inertial(state[:, :3], state[:, 3:]) for state in (target, chaser)]
    turned = frames[1] @ np.swapaxes(frames[0], -1, -2)
    return np.asarray(np.linalg.norm(ln.attitude.rotation_error(np.eye(3), turned), axis=-1))

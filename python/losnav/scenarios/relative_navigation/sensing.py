"""What the chaser measures and what it believes of its own attitude and orbit.

    z   = h(r, C_BT) + noise,   C_BT = C_BI C_TI',       C_BI = dC(pointing error) C_pointing
    C̃   = C̃_BI C̃_FI',          C̃_BI = dC(star tracker error) C_BI,     F the frame taken for T

The publication takes the chaser's own orbital frame O, from its GPS, for the target's: no orbit of the target
is needed. To first order they differ by the small rotation of T into O

    θ = (y/R, −x/R, ẏ/(wR)),    C_OT = I − [θ×],

0.08 degrees at 10 km, which the state itself tells and ``corrected`` takes out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

import losnav as ln
from losnav.attitude import dcm_from_mrp
from losnav.orbits import lvlh_from_inertial, target_to_chaser_lvlh

if TYPE_CHECKING:
    from losnav.scenarios.relative_navigation import RelativeNavigation
    from losnav.scenarios.relative_navigation.truth import Arc

__all__ = ["Draws", "Measurements", "camera", "corrected", "measure", "small_rotation"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Draws:
    """Unit normal numbers of a block of runs, one array for each source of error, (runs, T, 3)."""

    sensor: Array
    pointing: Array
    star_tracker: Array
    gps_position: Array
    gps_velocity: Array

    @classmethod
    def of(cls, rngs: Sequence[Generator], epochs: int) -> Draws:
        """Draw for the longest arc; shorter ones use the beginning."""
        normal = np.stack([rng.standard_normal((epochs, 5, 3)) for rng in rngs])
        return cls(*(np.ascontiguousarray(normal[:, :, k]) for k in range(5)))


@dataclass(frozen=True)
class Measurements:
    """What a filter is given.

    Attributes
    ----------
    sensor : RangeBearing
        The camera and laser, with the noise the filter assumes: the angles' own and the star tracker's.
    z : (runs, T, 3) array
        Range, azimuth, elevation; m and rad.
    dcm : (runs, T, 3, 3) array
        Body from the frame taken for the target's.
    orbit : (runs, T, 6) array
        The chaser's GPS fixes, inertial, m and m/s.
    """

    sensor: ln.sensors.RangeBearing
    z: Array
    dcm: Array
    orbit: Array


def small_rotation(angles: Array) -> Array:
    """Attitude matrix ``exp(−[a×])`` of rotation vectors of less than half a turn (rad), (..., 3)."""
    # tan(a/4) a/|a|: the MRP of the rotation; a series keeps it exact to rounding at zero.
    quarter = 0.25 * np.linalg.norm(angles, axis=-1, keepdims=True)
    ratio = np.where(quarter > 1e-4, np.tan(quarter) / np.maximum(quarter, 1e-4), 1 + quarter**2 / 3)
    return dcm_from_mrp(0.25 * ratio * angles)


def camera(scenario: RelativeNavigation) -> ln.sensors.RangeBearing:
    """Camera and laser as the filter takes them: the star tracker's error adds to that of the angles."""
    angle = np.hypot(scenario.angle_sigma, scenario.star_tracker_sigma)
    return ln.sensors.RangeBearing(scenario.range_sigma, float(angle))


def measure(scenario: RelativeNavigation, arc: Arc, draws: Draws) -> Measurements:
    """Measurements of all runs along an arc."""
    s, epochs = scenario, len(arc.times)
    pointing = s.control_sigma * draws.pointing[:, :epochs] + s.control_bias
    body = small_rotation(pointing) @ arc.pointing
    attitude = body @ np.swapaxes(arc.target_frame, -1, -2)
    noise = draws.sensor[:, :epochs] * [s.range_sigma, s.angle_sigma, s.angle_sigma]
    sensor = camera(s)
    z = sensor.predict(arc.relative, dcm=attitude) + noise
    believed = small_rotation(s.star_tracker_sigma * draws.star_tracker[:, :epochs]) @ body
    gps = np.concatenate(
        [s.gps_position_sigma * draws.gps_position, s.gps_velocity_sigma * draws.gps_velocity], axis=-1
    )
    orbit = arc.chaser + gps[:, :epochs]
    if s.frame == "target":
        frame = np.broadcast_to(arc.target_frame, believed.shape)
    else:
        frame = lvlh_from_inertial(orbit[..., :3], orbit[..., 3:])
    return Measurements(sensor, z, believed @ np.swapaxes(frame, -1, -2), orbit)


def corrected(scenario: RelativeNavigation, arc: Arc, dcm: Array, state: Array) -> Array:
    """Body from the target's frame, ``C_BO C_OT(state)``: the near-parallel simplification repaired to first
    order."""
    radius = np.linalg.norm(arc.chaser[:, :3], axis=-1)
    return np.asarray(dcm @ target_to_chaser_lvlh(state, radius, scenario.mean_motion))

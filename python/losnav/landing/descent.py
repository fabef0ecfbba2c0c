"""True motion of a lander, and the inertial measurements that belong to it exactly.

Over one step of the inertial unit the specific force ``f`` and the inertial rate ``w`` are constant in body
axes, in the truth as in the samples. With ``C = dcm'`` (site from body), ``W`` the rate of the site:

    C(t+s) = exp(-[W x] s) C(t) exp([w x] s)                     exact
    r'' = C f + g(r) - 2 W x r' - W x (W x (rho + r))            Runge-Kutta of order 4, the step of the unit

1. The attitude at the samples is what the profile says; ``w`` is the rate that leads from one to the next.
2. ``f`` is what the guidance asks of the true state at the beginning of the step, less the free motion.

A mechanisation of the samples without errors therefore returns the truth to its own order: by the same rule
(:class:`losnav.dynamics.Strapdown`) to rounding, by the mid-step rule at 10 Hz to about 1e-5 m in 600 s. Left
out: the thrust's own errors, flexible modes, the torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, positive, rotations, vectors
from losnav.attitude import quaternion_from_dcm, rotation_error
from losnav.errors import InvalidInputError
from losnav.landing.attitude import AttitudeProfile, Sway, turned
from losnav.landing.guidance import Guidance
from losnav.navigation_state import NavState

if TYPE_CHECKING:
    from losnav.dynamics import Site

__all__ = ["Descent", "simulate_descent"]


@dataclass(frozen=True, eq=False)
class Descent:
    """A true trajectory at the samples of the inertial unit; batches have their dimensions in front.

    Attributes
    ----------
    time : (T + 1,) array
        Since the start, s.
    position, velocity : (..., T + 1, 3) arrays
        Site frame, m and m/s.
    dcm : (T + 1, 3, 3) array
        Body from site.
    specific_force, angular_rate : (..., T, 3) and (T, 3) arrays
        What an inertial unit without errors measures over each step: body axes, m/s^2 and rad/s.
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    dcm: FloatArray
    specific_force: FloatArray
    angular_rate: FloatArray

    @property
    def step(self) -> float:
        """Sampling of the inertial unit, s."""
        return float(self.time[1] - self.time[0])

    @property
    def state(self) -> NavState:
        """The truth as a navigation state with batch shape (..., T + 1) and no biases."""
        shape = (*self.position.shape[:-1], 4)
        quaternion = np.broadcast_to(quaternion_from_dcm(self.dcm), shape)
        return NavState(self.position, self.velocity, quaternion)

    def every(self, interval: float) -> np.ndarray[Any, np.dtype[np.intp]]:
        """Indices into ``time`` of the epochs ``interval``, ``2 interval``, ... (s); the start is not among
        them.

        Raises
        ------
        InvalidInputError
            If the interval is no multiple of the step.
        """
        return np.arange(self.stride(interval), len(self.time), self.stride(interval))

    def stride(self, interval: float) -> int:
        """Steps of the inertial unit in an interval (s), which must be a whole number of them."""
        steps = round(float(positive(interval, "interval")) / self.step)
        if steps < 1 or not math.isclose(steps * self.step, interval, rel_tol=1e-9):
            raise InvalidInputError(
                f"interval: expected a multiple of the step, {self.step:g} s, got {interval:g} s"
            )
        return steps


def simulate_descent(
    site: Site,
    gravity: Any,
    position: ArrayLike,
    velocity: ArrayLike,
    *,
    duration: float,
    guidance: Guidance | None = None,
    attitude: AttitudeProfile | None = None,
    step: float = 0.1,
) -> Descent:
    """Fly a descent with the true gravity, guided on the true state (L3, L11).

    Parameters
    ----------
    site : Site
        Frame of the motion, with its rotation.
    gravity : object with ``acceleration(r)``
        The true field, body-fixed axes: one of :mod:`losnav.gravity`, or your own.
    position, velocity : (..., 3)
        Start, site frame, m and m/s; leading dimensions are lander by lander.
    duration, step : float
        Length of the descent and sampling of the inertial unit, s.
    guidance : callable, optional
        ``guidance(time, position, velocity) -> (..., 3)``, the acceleration wanted in the site frame. If it
        has an attribute ``hold_from``, its last command is repeated from that time on. None: free fall.
    attitude : callable, optional
        ``attitude(times (T,)) -> (T, 3, 3)``, body from site; a :class:`Sway` if None.

    Returns
    -------
    Descent

    Raises
    ------
    InvalidInputError
        On wrong shapes, times that are not positive, or a duration that is no multiple of the step.

    Examples
    --------
    >>> import losnav as ln
    >>> site, field = ln.dynamics.Site.inertial(), ln.gravity.Uniform([0.0, 0.0, -1.6])
    >>> guide = ln.landing.ApolloGuidance([0, 0, 30], [0, 0, -0.1], [0, 0, 0], final_time=60.0)
    >>> descent = ln.landing.simulate_descent(
    ...     site, field, [40.0, -30.0, 200.0], [-1.0, 0.7, -5.0], duration=60.0, guidance=guide
    ... )
    >>> descent.position[-1].round(1)
    array([ 0. , -0. , 30.2])
    """
    dt, length = (float(positive(value, name)) for value, name in ((step, "step"), (duration, "duration")))
    steps = round(length / dt)
    if steps < 1 or not math.isclose(steps * dt, length, rel_tol=1e-9):
        raise InvalidInputError(f"duration: expected a multiple of the step, {dt:g} s, got {length:g} s")
    r, v = vectors(position, "position"), vectors(velocity, "velocity")
    try:
        r, v = (array.copy() for array in np.broadcast_arrays(r, v))
    except ValueError:
        raise InvalidInputError(
            f"position, velocity: shapes {r.shape} and {v.shape} do not broadcast"
        ) from None
    time: FloatArray = np.asarray(dt * np.arange(steps + 1))
    spin = vectors(site.angular_velocity, "site.angular_velocity")
    profile = Sway() if attitude is None else attitude
    dcm = rotations(profile(time), "attitude")
    if dcm.shape != (steps + 1, 3, 3):
        raise InvalidInputError(f"attitude: expected shape ({steps + 1}, 3, 3) from it, got {dcm.shape}")
    # C(t+dt) = exp(-[W x] dt) C(t) exp([w x] dt), read from right to left as dcm = C'.
    unturned = dcm[:-1] @ turned(-spin * dt)
    rate = rotation_error(dcm[1:], unturned) / dt
    half = turned(0.5 * dt * rate) @ dcm[:-1] @ turned(-0.5 * dt * spin)
    motion = _Motion(site, gravity, spin)
    position, velocity, force = _fly(motion, (r, v), time, _Turning(dcm, half), guidance)
    return Descent(time, position, velocity, dcm, force, rate)


class _Motion:
    """Acceleration without specific force, ``g(r) - 2 W x v - W x (W x (rho + r))``, site frame."""

    def __init__(self, site: Site, gravity: Any, spin: FloatArray) -> None:
        self.field = gravity.acceleration
        self.from_fixed = vectors(site.site_from_fixed, "site.site_from_fixed")
        self.center = vectors(site.center, "site.center")
        x, y, z = spin
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        # Transposed: they multiply rows.
        self.centrifugal, self.coriolis = -(cross @ cross).T, -2.0 * cross.T
        self.turns = bool(spin.any())

    def __call__(self, r: FloatArray, v: FloatArray) -> FloatArray:
        from_center = r + self.center
        g = self.field(from_center @ self.from_fixed) @ self.from_fixed.T
        if not self.turns:
            return np.asarray(g)
        return np.asarray(g + from_center @ self.centrifugal + v @ self.coriolis)

    def step(
        self, r: FloatArray, v: FloatArray, dt: float, pushes: tuple[FloatArray, FloatArray, FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Runge-Kutta's step of order 4; all of the acceleration at the start, then C f halfway and at the
        end."""
        a1, middle, end = pushes
        v2 = v + 0.5 * dt * a1
        a2 = self(r + 0.5 * dt * v, v2) + middle
        v3 = v + 0.5 * dt * a2
        a3 = self(r + 0.5 * dt * v2, v3) + middle
        v4 = v + dt * a3
        a4 = self(r + dt * v3, v4) + end
        return r + dt / 6.0 * (v + 2.0 * (v2 + v3) + v4), v + dt / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)


@dataclass(frozen=True)
class _Turning:
    """Body from site at the samples and halfway between them."""

    dcm: FloatArray
    half: FloatArray


def _fly(
    motion: _Motion,
    start: tuple[FloatArray, FloatArray],
    time: FloatArray,
    turning: _Turning,
    guidance: Guidance | None,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and velocity at the samples, (..., T + 1, 3), and the specific force over the steps."""
    (r, v), dcm, half = start, turning.dcm, turning.half
    dt, steps = float(time[1] - time[0]), len(half)
    positions, velocities = (np.empty((steps + 1, *r.shape)) for _ in range(2))
    forces = np.zeros((steps, *r.shape))
    positions[0], velocities[0] = r, v
    freeze = getattr(guidance, "hold_from", math.inf)
    wanted: FloatArray | None = None
    for k in range(steps):
        a1 = free = motion(r, v)
        if guidance is not None:
            if wanted is None or time[k] < freeze:
                wanted = as_float64(guidance(float(time[k]), r, v), "guidance")
            # Rows times C = dcm' turn site components into body components, rows times dcm turn them back.
            a1, forces[k] = wanted, (wanted - free) @ dcm[k].T
        r, v = motion.step(r, v, dt, (a1, forces[k] @ half[k], forces[k] @ dcm[k + 1]))
        positions[k + 1], velocities[k + 1] = r, v
    return np.moveaxis(positions, 0, -2), np.moveaxis(velocities, 0, -2), np.moveaxis(forces, 0, -2)

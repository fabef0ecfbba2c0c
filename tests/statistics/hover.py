"""A lander above a field of landmarks whose true motion is known in closed form.

Constant acceleration, constant inertial rate, uniform gravity, a frame that does not turn. Nothing of
losnav's own simulator is in it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

import losnav as ln

GRAVITY = np.array([0.0, 0.0, -4e-3])
ACCELERATION = np.array([0.005, -0.003, 0.01])
RATE = np.array([0.002, -0.001, 0.01])
START = ln.NavState([50.0, -30.0, 500.0], [-0.5, 0.3, -2.0], [1.0, 0.0, 0.0, 0.0])
# Samples of the unit per epoch, and their spacing.
SUBSTEPS, STEP = 10, 0.1
EPOCHS = 100
TIMES = np.arange(1.0, EPOCHS + 1.0)
IMU = ln.dynamics.Imu(velocity_random_walk=1e-4, angle_random_walk=1e-5)
SIGMA = np.array([5.0] * 3 + [0.1] * 3 + [0.01] * 3)
LANDMARKS = np.array(
    [
        [-210.0, 150.0, 12.0],
        [180.0, -220.0, -8.0],
        [40.0, 260.0, 3.0],
        [-120.0, -90.0, -15.0],
        [250.0, 60.0, 9.0],
        [-20.0, 10.0, 1.0],
        [110.0, 170.0, -4.0],
        [-260.0, -200.0, 17.0],
    ]
)
PIXEL, SPEED = 1.0, 0.01


def turned(q, rate, dt):
    """Quaternion after a constant body rate."""
    angle = np.linalg.norm(rate) * dt
    x, y, z = np.sin(angle / 2) * rate / np.linalg.norm(rate)
    w = np.cos(angle / 2)
    a, b, c, d = q
    return np.array(
        [
            d * x + w * a + b * z - c * y,
            d * y + w * b + c * x - a * z,
            d * z + w * c + a * y - b * x,
            d * w - a * x - b * y - c * z,
        ]
    )


class Hover:
    """``runs`` noisy flights of the one truth."""

    def __init__(self, runs: int, seed: int = 0) -> None:
        self.runs, self.rng = runs, np.random.default_rng(seed)

    @cached_property
    def truth(self):
        q0 = START.quaternion
        return ln.NavState(
            START.position + START.velocity * TIMES[:, None] + 0.5 * ACCELERATION * TIMES[:, None] ** 2,
            START.velocity + ACCELERATION * TIMES[:, None],
            [turned(q0, RATE, t) for t in TIMES],
        )

    @cached_property
    def controls(self):
        """Specific force and rate as measured, ``(runs, T * SUBSTEPS, 3)`` each."""
        middle = (np.arange(EPOCHS * SUBSTEPS) + 0.5) * STEP
        turns = ln.attitude.dcm_from_quaternion([turned(START.quaternion, RATE, t) for t in middle])
        force = turns @ (ACCELERATION - GRAVITY)
        shape = (self.runs, EPOCHS * SUBSTEPS, 3)
        noise = self.rng.normal(size=(2, *shape)) / np.sqrt(STEP)
        return (
            force + IMU.velocity_random_walk * noise[0],
            RATE + IMU.angle_random_walk * noise[1],
        )

    def pixels(self, landmarks=LANDMARKS):
        """Pixels of the true landmarks ``(8, 3)`` or ``(runs, 8, 3)``, with noise, ``(runs, T, 16)``."""
        camera = ln.sensors.LandmarkCamera(LANDMARKS, 500.0, PIXEL)
        marks = np.broadcast_to(landmarks, (self.runs, *LANDMARKS.shape))
        clean = np.stack([camera.predict(self.truth, landmarks=m[None]) for m in marks])
        return clean + self.rng.normal(0, PIXEL, clean.shape)

    @cached_property
    def velocities(self):
        """Velocity in body axes, ``(runs, T, 3)``."""
        clean = np.einsum("tij,tj->ti", self.truth.dcm, self.truth.velocity)
        return clean + self.rng.normal(0, SPEED, (self.runs, EPOCHS, 3))

    @cached_property
    def start(self):
        """Estimates whose errors are those of the first covariance."""
        errors = self.rng.normal(size=(self.runs, 9)) * SIGMA
        return ln.NavState.stack([START.inject(-error) for error in errors])


def model(gravity=GRAVITY, **options):
    """Strapdown of this place; nine errors unless told otherwise."""
    options = {"biases": False, **options}
    return ln.dynamics.Strapdown(ln.dynamics.Site.inertial(), ln.gravity.Uniform(gravity), IMU, **options)


def prior(extra=()):
    """The first covariance."""
    return np.diag(np.concatenate([SIGMA, extra]) ** 2)

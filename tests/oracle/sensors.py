"""Sensors of one target: predictions, complex-safe; Jacobians by complex step."""

from __future__ import annotations

import numpy as np

STEP = 1e-30


def arctangent(y, x):
    """atan2 that keeps the imaginary part of a complex step: the slope of the angle is (x dy - y dx)/r^2."""
    angle = np.arctan2(y.real, x.real)
    slope = (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2)
    return angle + 1j * slope


def range_bearing(position, dcm, target):
    """Equation (8): L = C (target - r); rho, azimuth, elevation as the arcsine the publication prints."""
    line = dcm @ (target - position)
    rho = np.sqrt(line @ line)
    return np.array([rho, arctangent(line[1] + 0j, line[0] + 0j), np.arcsin(line[2] / rho)])


def distance(position, target):
    d = position - target
    return np.array([np.sqrt(d @ d)])


def distance_rate(position, velocity, target):
    """Half the rate of the squared distance, over the distance."""
    d = position - target
    return np.array([d @ velocity / np.sqrt(d @ d)])


def jacobian(h, *points):
    """Derivative of ``h`` along all components of its arguments, by complex step."""
    sizes = [len(p) for p in points]
    columns = []
    for k in range(sum(sizes)):
        nudged = np.concatenate(points).astype(complex)
        nudged[k] += 1j * STEP
        columns.append(h(*np.split(nudged, np.cumsum(sizes)[:-1])).imag / STEP)
    return np.array(columns).T


def sun_direction(position, dcm):
    """From the observer to the Sun at the origin, in body axes."""
    return dcm @ (-position / np.sqrt(position @ position))


def boosted(direction, velocity, light=299792458.0):
    """A direction as an observer with ``velocity`` sees it: minus the boosted momentum of its photon."""
    beta = velocity / light
    square = beta @ beta
    gamma = 1 / np.sqrt(1 - square)
    k = -direction  # the photon flies the other way, its energy one
    energy = gamma * (1 - beta @ k)
    momentum = k - gamma * beta + ((gamma - 1) * (beta @ k) / square) * beta
    return -momentum / energy


def turned(dcm, alpha):
    """The attitude after a small error in body axes, (I - [alpha x]) dcm, complex-safe."""
    x, y, z = alpha
    return (np.eye(3) - np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])) @ dcm


def pinhole(position, dcm, landmarks, focal, center, *, mounting, lever_arm):
    """Pixels of landmarks one after another: axes x right, y down, z along the boresight."""
    pixels = []
    for landmark in landmarks:
        x, y, z = mounting @ (dcm @ (landmark - position) - lever_arm)
        pixels += [focal[0] * x / z + center[0], focal[1] * y / z + center[1]]
    return np.array(pixels)


def velocity_along(velocity, dcm, beams):
    """Velocity against the ground along beams given in body axes."""
    return np.array([(dcm.T @ beam) @ velocity for beam in beams])


def distance_to_ground(position, dcm, beam):
    """How far along a beam the plane z = 0 is: where (position + s direction) has no height left."""
    direction = dcm.T @ beam
    return np.array([-position[2] / direction[2]])


def body_direction(position, velocity, dcm, *, path, light_time, aberration, light=299792458.0):
    """To a body whose place ``path(delay before the measurement)`` tells, by fixed-point iteration."""
    delay = 0.0
    for _ in range(12 if light_time else 0):
        d = path(delay) - position
        delay = np.sqrt(d @ d) / light
    d = path(delay) - position
    u = d / np.sqrt(d @ d)
    return dcm @ (boosted(u, velocity) if aberration else u)

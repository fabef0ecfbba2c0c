"""Simulation of landings: guidance, true motion, and what the sensors make of it, run by run.

Pieces to recombine: :class:`ApolloGuidance` steers, :class:`Sway` (or any function of time) turns the body,
:func:`simulate_descent` integrates the truth; :func:`measure_inertial`, :func:`choose_landmarks` and
:func:`measure_images` give what a filter is fed; :func:`outage`, :func:`thinned` and :func:`arriving` spoil
it. All of them work on every run of a Monte Carlo at once and draw run ``k`` from a generator of its own
(:func:`streams`). Frame: East, North, Up at the site, see :class:`losnav.dynamics.Site`.
"""

from __future__ import annotations

from losnav.landing.attitude import NADIR, AttitudeProfile, Sway
from losnav.landing.descent import Descent, simulate_descent
from losnav.landing.faults import arriving, outage, thinned
from losnav.landing.guidance import ApolloGuidance, Guidance
from losnav.landing.inertial import InertialMeasurements, measure_inertial, streams
from losnav.landing.landmarks import ImageMeasurements, choose_landmarks, measure_images, ring_landmarks

__all__ = [
    "NADIR",
    "ApolloGuidance",
    "AttitudeProfile",
    "Descent",
    "Guidance",
    "ImageMeasurements",
    "InertialMeasurements",
    "Sway",
    "arriving",
    "choose_landmarks",
    "measure_images",
    "measure_inertial",
    "outage",
    "ring_landmarks",
    "simulate_descent",
    "streams",
    "thinned",
]

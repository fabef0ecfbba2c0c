"""Gravity of one body, in axes fixed to it.

Four models with one surface, ``potential(r)``, ``acceleration(r)``, ``gradient(r)``, all broadcasting over
leading dimensions: ``g = grad U`` with ``U > 0``, and ``gradient = dg/dr``, symmetric. ``factor * model`` is
the same field times a number: what a filter believes that knows gravity to so many per cent.

=========================  ==================================================================================
:class:`PointMass`         from afar; everything else near by
:class:`Uniform`           a laboratory
:class:`Harmonics`         in orbit: outside the sphere around the body, where the series converges
:class:`Polyhedron`        down to the surface, for constant density
=========================  ==================================================================================

:mod:`losnav.gravity.eros` has the measured field of Eros.
"""

from losnav.gravity import eros
from losnav.gravity.harmonics import BrillouinWarning, Harmonics
from losnav.gravity.point import PointMass, Uniform
from losnav.gravity.polyhedron import Polyhedron
from losnav.gravity.shape import read_shape

__all__ = [
    "LISTED",
    "BrillouinWarning",
    "Harmonics",
    "PointMass",
    "Polyhedron",
    "Uniform",
    "eros",
    "read_shape",
]

#: Models the engine holds itself: those that :class:`losnav.dynamics.Strapdown` takes.
LISTED: tuple[type, ...] = (PointMass, Uniform, Harmonics, Polyhedron)

"""What is measured of a state: prediction, Jacobian and simulation of the built-in sensors.

A sensor is a small frozen object. A state is one of

* ``(..., 3)`` position or ``(..., 6)`` ``[r v]``, with the known attitude as context: ``dcm=`` body from
  reference, where the sensor needs one;
* ``(position, mrp)``, a tuple of two arrays, or an object with these attributes such as a ``PoseSolution``;
* a :class:`losnav.NavState`.

Jacobian columns follow the state's tangent: ``[dr]``, ``[dr dv]``, ``[dp dalpha]`` with the attitude error
in body axes, or the 15 of a ``NavState``, ``[dr dv dalpha db_a db_g]``, those of the biases zero. States,
attitudes, landmarks and targets broadcast over leading dimensions.

Any object with ``predict``, ``jacobian`` and ``noise`` of the same signatures can stand in a sensor's place;
``residual`` if its measurement has angles.
"""

from losnav.sensors.celestial import BodyDirection, SunDirection
from losnav.sensors.delayed import Delayed
from losnav.sensors.lander import Altimeter, Velocimeter
from losnav.sensors.landmark_camera import LandmarkCamera
from losnav.sensors.line_of_sight import LineOfSight
from losnav.sensors.target import Range, RangeBearing, RangeRate

__all__ = [
    "Altimeter",
    "BodyDirection",
    "Delayed",
    "LandmarkCamera",
    "LineOfSight",
    "Range",
    "RangeBearing",
    "RangeRate",
    "SunDirection",
    "Velocimeter",
]

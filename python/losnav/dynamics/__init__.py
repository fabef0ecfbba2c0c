"""How a state moves: propagation, state transition and process noise of the built-in models.

A model is a small frozen object; anything with ``propagate``, ``transition`` and ``process_noise`` of the
same signatures can stand in its place. States, time steps and controls broadcast over leading dimensions.
Times are epochs of the caller's clock: a model that changes with time is told when a step starts.
"""

from losnav.dynamics.clohessy_wiltshire import ClohessyWiltshire
from losnav.dynamics.curvilinear import CurvilinearClohessyWiltshire
from losnav.dynamics.imu import GaussMarkov, Imu
from losnav.dynamics.relative_two_body import RelativeTwoBody
from losnav.dynamics.site import Site
from losnav.dynamics.strapdown import Strapdown
from losnav.dynamics.third_body import ThirdBody
from losnav.dynamics.two_body import TwoBody
from losnav.dynamics.yamanaka_ankersen import YamanakaAnkersen

__all__ = [
    "LISTED",
    "ClohessyWiltshire",
    "CurvilinearClohessyWiltshire",
    "GaussMarkov",
    "Imu",
    "RelativeTwoBody",
    "Site",
    "Strapdown",
    "ThirdBody",
    "TwoBody",
    "YamanakaAnkersen",
]

#: Models the filters' engine holds itself. Others, a subclass of one of these too, it asks step by step.
LISTED: tuple[type, ...] = (ClohessyWiltshire, TwoBody)

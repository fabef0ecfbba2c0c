"""How a state moves: propagation, state transition and process noise of the built-in models.

A model is a small frozen object; anything with ``propagate``, ``transition`` and ``process_noise`` of the
same signatures can stand in its place. States, time steps and controls broadcast over leading dimensions.
Times are epochs of the caller's clock: a model that changes with time is told when a step starts.
"""

from losnav.dynamics.clohessy_wiltshire import ClohessyWiltshire
from losnav.dynamics.relative_two_body import RelativeTwoBody
from losnav.dynamics.two_body import TwoBody

__all__ = ["LISTED", "ClohessyWiltshire", "RelativeTwoBody", "TwoBody"]

#: Models the engine knows itself; a subclass of one is a user's model.
LISTED: tuple[type, ...] = (ClohessyWiltshire, RelativeTwoBody, TwoBody)

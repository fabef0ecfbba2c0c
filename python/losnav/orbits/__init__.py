"""Orbital frames and what is measured in them: LVLH axes, relative states, curvilinear coordinates.

The orbital (LVLH) frame of a spacecraft has z to nadir, y along the negative orbit normal, and x = y x z in
the orbital plane along the flight. A relative state is chaser minus target in the target's frame, its
velocity as seen in that rotating frame. Everything broadcasts over leading dimensions.
"""

from losnav.orbits.curvilinear import curvilinear_from_lvlh, lvlh_from_curvilinear
from losnav.orbits.frames import (
    chaser_state,
    lvlh_from_inertial,
    lvlh_rate,
    mean_motion,
    relative_state,
    target_state,
    target_to_chaser_lvlh,
)

__all__ = [
    "chaser_state",
    "curvilinear_from_lvlh",
    "lvlh_from_curvilinear",
    "lvlh_from_inertial",
    "lvlh_rate",
    "mean_motion",
    "relative_state",
    "target_state",
    "target_to_chaser_lvlh",
]

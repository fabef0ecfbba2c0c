"""Published line-of-sight navigation systems, ready to run, judged claim by claim.

Each scenario is a frozen dataclass of every parameter of its system. ``load`` makes one, ``run`` repeats it
with fresh noise, and the result holds a table for a report, the published claims with our figures beside
them, and the plots.

>>> import losnav as ln
>>> ln.scenarios.load("landmark-landing", duration=430.0).sampling
2.0
"""

from __future__ import annotations

import importlib
from typing import Final, cast

from losnav.errors import InvalidInputError, LosnavError
from losnav.scenarios.verdicts import Claim, Claims, Result, Scenario, Table

__all__ = ["NAMES", "Claim", "Claims", "Result", "Scenario", "Table", "available", "load"]

#: Every system losnav is made for, in the order of the documentation.
NAMES: Final = (
    "landmark-landing",
    "relative-navigation",
    "sun-line-of-sight",
    "small-body-landing",
    "star-tracker",
)

#: Where the finished ones live: module and class. Imported on load only.
_REGISTRY: Final = {
    "landmark-landing": ("losnav.scenarios.landmark_landing", "LandmarkLanding"),
    "relative-navigation": ("losnav.scenarios.relative_navigation", "RelativeNavigation"),
    "sun-line-of-sight": ("losnav.scenarios.sun_line_of_sight", "SunLineOfSight"),
    "small-body-landing": ("losnav.scenarios.small_body_landing", "SmallBodyLanding"),
    "star-tracker": ("losnav.scenarios.star_tracker", "StarTracker"),
}


def available() -> tuple[str, ...]:
    """Names that :func:`load` accepts in this version of losnav.

    Examples
    --------
    >>> from losnav import scenarios
    >>> "landmark-landing" in scenarios.available()
    True
    """
    return tuple(name for name in NAMES if name in _REGISTRY)


def load(name: str, **overrides: object) -> Scenario:
    """Make a scenario, with any of its parameters replaced.

    Parameters
    ----------
    name : str
        One of :func:`available`.
    **overrides
        Parameters of the scenario's dataclass; its documentation gives the unit of each.

    Returns
    -------
    Scenario
        A frozen dataclass with a ``run`` method.

    Raises
    ------
    InvalidInputError
        If the name or a parameter is unknown, or a value is out of its range.
    LosnavError
        If the scenario belongs to a later version.

    Examples
    --------
    >>> import losnav as ln
    >>> landing = ln.scenarios.load("landmark-landing", focal_plane_sigma=0.3e-6)
    >>> round(landing.los_sigma, 9)            # rad
    6e-06
    """
    if name not in NAMES:
        raise InvalidInputError(f"name: expected one of {', '.join(NAMES)}, got {name!r}")
    if name not in _REGISTRY:
        raise LosnavError(f"scenario {name!r} is not in this version; available: {', '.join(available())}")
    module, attribute = _REGISTRY[name]
    scenario = getattr(importlib.import_module(module), attribute)
    known = set(scenario.__dataclass_fields__)
    if unknown := sorted(set(overrides) - known):
        raise InvalidInputError(
            f"{unknown[0]}: expected a parameter of {name}: {', '.join(sorted(known))}, got an unknown one"
        )
    return cast(Scenario, scenario(**overrides))

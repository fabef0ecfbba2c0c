"""The thirteen claims of the publication, taken apart and judged.

Nothing here is typed in from a table but the printed values: every figure of ours is computed from the
campaign's arrays, from covariances of the library, or by trying random cases on the spot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from losnav.scenarios.star_tracker.fusion_claims import covariance_claims, fusion_claims
from losnav.scenarios.star_tracker.geometry_claims import geometry_claims
from losnav.scenarios.star_tracker.property_claims import property_claims
from losnav.scenarios.verdicts import Claims

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["judge_claims"]


def judge_claims(result: StarTrackerResult) -> Claims:
    """All claims of the publication in its order; claim 13 is the five properties, P1 to P5."""
    families = (covariance_claims, geometry_claims, fusion_claims, property_claims)
    return Claims([claim for family in families for claim in family(result)])

"""The claims of the publication, S1 to S10, taken apart and judged; beyond them, what a navigator asks next.

Nothing here is typed in from a table but the printed values and limits: every figure of ours is computed from
the campaign's arrays, from the Cramér-Rao bound, or from the Lie derivatives on the spot.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from losnav.scenarios.sun_line_of_sight.accuracy_claims import accuracy_claims
from losnav.scenarios.sun_line_of_sight.degree_claims import degree_claims
from losnav.scenarios.sun_line_of_sight.index_claims import index_claims
from losnav.scenarios.sun_line_of_sight.robustness_claims import robustness_claims
from losnav.scenarios.verdicts import Claims

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult

__all__ = ["judge_claims"]


def judge_claims(result: SunLineOfSightResult) -> Claims:
    """All claims, in their order."""
    return Claims(
        [
            *degree_claims(result.scenario),
            *accuracy_claims(result),
            *index_claims(result.scenario),
            *robustness_claims(result),
        ]
    )

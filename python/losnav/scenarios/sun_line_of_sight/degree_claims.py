"""Claims 1 to 6: what the observability degree is, and how it depends on the orbit."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.scenarios.judging import computed
from losnav.scenarios.sun_line_of_sight.arcs import compare
from losnav.scenarios.sun_line_of_sight.orbit import (
    canonical,
    curve,
    degree,
    dip_from,
    lie_rows,
    orbit_state,
    reversal,
)
from losnav.scenarios.verdicts import Claim, Verdict

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = ["degree_claims"]

Array = NDArray[np.float64]

_KM = 1e3
# A degree below this is that of rounding.
_NOTHING = 1e-12
# Singular values of one Lie matrix span less than this; a lost one is below.
_RANK = 1e-11
_ENDS = np.array([0.0, np.pi])
_ORDERS = (3, 4, 5)
_SAME = 1e-9
# Units of length that are compared, in units of the scenario's.
_STRETCH = (0.1, 0.5, 2.0, 10.0)
_PRINTED_DIP = 0.6


@lru_cache(maxsize=4)
def degree_claims(scenario: SunLineOfSight) -> tuple[Claim, ...]:
    """Claims 1 to 6, which no run can change."""
    families = (_meaning, _units, _along, _semi_major_axis, _inclination, _eccentricity)
    return tuple(claim for family in families for claim in family(scenario))


def _decided(truth: bool) -> Verdict:
    return "holds" if truth else "does not"


def _meaning(s: SunLineOfSight) -> list[Claim]:
    """S1: between 0 and 1, and positive iff weakly observable."""
    eccentricities = np.array(s.eccentricities)[:, None]
    grid = curve(s, np.linspace(0.0, 2 * np.pi, 73), eccentricity=eccentricities)
    states = orbit_state(s, np.linspace(0.0, 2 * np.pi, 73))
    sizes, time = canonical(s)
    ranks = []
    for order in range(s.order + 1):
        rows = lie_rows(s, states, order) * time ** np.repeat(np.arange(order + 1), 3)[:, None]
        found = ln.observability.analyze(rows, scale=sizes, tolerance=_RANK).rank
        ranks.append(int(np.min(found)))
    fall = np.array([s.semi_major_axis, 0.0, 0.0, 0.3 * float(sizes[3]), 0.0, 0.0])
    straight = float(degree(s, fall))
    full = ranks[3:] == [6] * (s.order - 2)
    return [
        computed(
            float(grid.max()),
            number="1a",
            statement="The degree lies between 0 and 1",
            printed="0 to 1",
            ours=f"{grid.min():.2g} to {grid.max():.2g} on {grid.size} states",
            verdict=_decided(bool(grid.min() >= 0.0 and grid.max() <= 1.0)),
            why="Smallest over largest singular value of the 18 x 6 matrix, over an orbit of every "
            "eccentricity.",
            established="holds",
        ),
        computed(
            straight,
            number="1b",
            statement="It is positive where the system is locally weakly observable, and only there",
            printed="yes",
            ours=f"rank {', '.join(str(r) for r in ranks)} with derivatives up to 0, 1, 2, ...; straight to "
            f"the "
            f"Sun {straight:.1g}",
            verdict=_decided(full and straight < _NOTHING),
            why="Three derivatives are the least: the Sun's gravity, which alone has a length in it, enters "
            "the "
            "direction with the third. Motion straight to or from the Sun is unobservable with any number.",
            established="holds",
        ),
    ]


def _units(s: SunLineOfSight) -> list[Claim]:
    """S2: the state must be made dimensionless."""
    raw = lie_rows(s, orbit_state(s, 0.0)) * np.repeat([_KM, _KM], 3)
    bare, scaled = float(ln.observability.degree(raw)), float(curve(s, 0.0))
    return [
        computed(
            bare,
            number="2",
            statement="Without units of length and time the degree is of no use",
            printed="-",
            ours=f"{bare:.1g} in km and km/s, {scaled:.3g} with mu = 1",
            verdict=_decided(bare < _NOTHING),
            why="At the perihelion. In km and s the smallest singular value is below rounding of the "
            "largest.",
            established="holds",
        )
    ]


def _along(s: SunLineOfSight) -> list[Claim]:
    """S3: low at the perihelion, high at the aphelion, and why."""
    whole = curve(s)
    ends = {order: curve(s, _ENDS, order=order) for order in _ORDERS}
    own = curve(s, _ENDS, unit_length=s.semi_major_axis)
    extreme = whole.min() >= whole[0] * (1 - _SAME) and whole.max() <= whole[len(whole) // 2] * (1 + _SAME)
    rising = all(low < high for low, high in (*ends.values(), own))
    c = compare(s)
    low, high = int(np.argmin(c.degree)), int(np.argmax(c.degree))
    return [
        computed(
            float(whole[len(whole) // 2] / whole[0]),
            number="3a",
            statement="Along the orbit the degree is lowest at the perihelion and highest at the aphelion",
            printed="yes",
            ours=f"{whole[0]:.3g} and {whole[len(whole) // 2]:.3g}",
            verdict=_decided(bool(extreme and rising)),
            why="So with derivatives up to 3 ("
            + ", ".join(f"{x:.2g}" for x in ends[3])
            + ") and 4 ("
            + ", ".join(f"{x:.2g}" for x in ends[4])
            + "), and with the semi-major axis for a unit.",
            established="holds",
        ),
        computed(
            float(c.position[low] / c.position[high]),
            number="3b",
            statement="It is low near the perihelion because fewer measurements are made there",
            printed="yes",
            ours=f"as many measurements on the arc of the lowest degree tell {c.position[low] / _KM:.0f} "
            f"km, on "
            f"that of the highest {c.position[high] / _KM:.0f} km",
            verdict=_decided(bool(c.position[low] > c.position[high])),
            why="The degree belongs to a point and knows of no sampling. Cramér-Rao bound on arcs of equal "
            f"length, from f = {np.degrees(c.anomaly[low]):.0f} and {np.degrees(c.anomaly[high]):.0f} deg: "
            f"the "
            "fast arc near the perihelion tells more in the same time, not less.",
            established="does not",
        ),
    ]


def _semi_major_axis(s: SunLineOfSight) -> list[Claim]:
    """S4: the semi-major axis turns the curve round, or the unit does."""
    where = {order: reversal(s, order) for order in _ORDERS}
    small, large = (curve(s, _ENDS, semi_major_axis=a) for a in (0.5 * where[5], 2.0 * where[5]))
    turned = bool(small[0] < small[1] and large[0] > large[1])
    f = np.linspace(0.0, np.pi, 19)
    base = curve(s, f)
    change = max(
        float(
            np.abs(
                curve(s, f, semi_major_axis=x * s.semi_major_axis, unit_length=x * s.unit_length) / base - 1
            ).max()
        )
        for x in _STRETCH
    )
    return [
        computed(
            where[5] / _KM,
            number="4a",
            statement="With a small semi-major axis it is low at the perihelion, with a large one at the "
            "aphelion",
            printed="yes",
            ours=f"reversed from {where[5] / _KM:.3g} km on "
            f"({where[4] / _KM:.3g} and {where[3] / _KM:.3g} km with derivatives up to 4 and 3)",
            verdict=_decided(turned),
            why=f"Unit of length {s.unit_length / _KM:.4g} km for all of them.",
            established="holds",
        ),
        computed(
            change,
            number="4b",
            statement="That is an influence of the orbit, not of the unit of length",
            printed="-",
            ours=f"orbit and unit stretched together change the degree by {change:.1g} of itself at most",
            verdict=_decided(change > _SAME),
            why="degree(x a; x L) = degree(a; L): only their ratio matters. With the semi-major axis for a "
            "unit there is no influence of the semi-major axis at all.",
            established="does not",
        ),
    ]


def _inclination(s: SunLineOfSight) -> list[Claim]:
    """S5: the inclination."""
    f = np.linspace(0.0, 2 * np.pi, 37)
    inclinations = np.array(s.inclinations)[:, None]
    curves = curve(s, f, inclination=inclinations)
    spread = float((np.ptp(curves, axis=0) / curves.mean(axis=0)).max())
    tilted = np.concatenate([[0.0], np.radians([30.0, 60.0, 90.0])])
    angles = _of_angles(s, orbit_state(s, np.pi, inclination=tilted))
    change = float(angles.max() / angles.min())
    return [
        computed(
            spread,
            number="5a",
            statement="The inclination does not matter",
            printed="yes",
            ours=f"degrees of {len(s.inclinations)} inclinations differ by {spread:.1g} of themselves at "
            f"most",
            verdict=_decided(spread < _SAME),
            why="Turning the orbit turns the rows and columns of the matrix of a unit vector.",
            established="holds",
        ),
        computed(
            change,
            number="5b",
            statement="Nor does it if azimuth and elevation are measured",
            printed="-",
            ours=f"at the aphelion {angles.max():.2g} to {angles.min():.2g} for inclinations up to "
            f"{np.degrees(tilted[-1]):.0f} deg",
            verdict=_decided(change < 1 + _SAME),
            why="Two angles stretch near the poles of their sphere; so the publication has used the vector.",
            established="does not",
        ),
    ]


def _of_angles(s: SunLineOfSight, states: Array) -> Array:
    """Degree of azimuth and elevation of the Sun in the ecliptic axes."""
    sensor = ln.sensors.RangeBearing(1.0, s.sigma)
    rows = ln.observability.lie_matrix(
        ln.dynamics.TwoBody(s.mu), sensor, states, s.order, scale="SI", dcm=np.eye(3)
    )
    parts = np.asarray(rows).reshape(*rows.shape[:-2], s.order + 1, 3, 6)[..., 1:, :]
    sizes, time = canonical(s)
    parts = parts * time ** np.arange(s.order + 1)[:, None, None] * sizes
    return np.asarray(ln.observability.degree(parts.reshape(*rows.shape[:-2], -1, 6)))


def _eccentricity(s: SunLineOfSight) -> list[Claim]:
    """S6: dips at the aphelion of eccentric orbits."""
    from_five, from_four = dip_from(s, 5), dip_from(s, 4)
    without = dip_from(s, 5, own_unit=True)
    return [
        computed(
            from_five,
            number="6a",
            statement=f"From an eccentricity of {_PRINTED_DIP} on the degree dips at the aphelion",
            printed=f"{_PRINTED_DIP}",
            ours=f"from {from_five:.3f} on ({from_four:.3f} with derivatives up to 4)",
            verdict=_decided(0.5 < from_five <= _PRINTED_DIP),
            why="Printed are curves for 0.5, without a dip, and 0.6, with one.",
            established="holds",
        ),
        computed(
            min(without, 1.0),
            number="6b",
            statement="It dips because lines of sight overlap",
            printed="yes",
            ours="no dip at any eccentricity with the semi-major axis for a unit"
            if np.isinf(without)
            else f"from {without:.3f} on with the semi-major axis for a unit",
            verdict=_decided(bool(np.isfinite(without))),
            why="The same lines of sight, another unit of length.",
            established="does not",
        ),
    ]

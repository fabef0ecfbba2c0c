"""The measured gravity of the asteroid 433 Eros, as NEAR Shoemaker found it.

Source: NASA Planetary Data System, NEAR-A-5-COLLECTED-MODELS-V1.0, ``n15acoeff.tab`` (model NEAR15A,
JGE15A01); Konopliv et al. and Miller et al., *Icarus* 155, 3-17, 2002. Here up to degree 10: beyond, the
published errors exceed the coefficients. The axes of the table have the prime meridian of the PDS; in the
axes of :func:`principal` the long axis is x.

The body reaches from 3.1 km to 17.7 km from its centre, so a lander is inside the sphere where these series
converge: see :class:`losnav.gravity.Polyhedron`.
"""

from __future__ import annotations

import numpy as np

from losnav.gravity.harmonics import Harmonics

__all__ = [
    "BRILLOUIN_RADIUS",
    "MU",
    "POLE",
    "RADIUS",
    "ROTATION_RATE",
    "five_terms",
    "near15a",
    "principal",
]

#: Gravitational parameter, m^3/s^2 (+- 2.2).
MU = 4.46275472004e5
#: Radius of reference of the coefficients, m.
RADIUS = 16000.0
#: Radius of the sphere around the body, m.
BRILLOUIN_RADIUS = 17700.0
#: Rate of rotation about z, rad/s (1639.389232 degrees a day; 5.27026 h).
ROTATION_RATE = float(np.radians(1639.389232) / 86400.0)
#: Right ascension and declination of the pole, and the angle of the prime meridian at J2000, rad (ICRF).
POLE = (float(np.radians(11.363)), float(np.radians(17.232)), float(np.radians(326.08)))

# Degree, order, C, S; fully normalised.
_NEAR15A = (
    (2, 0, -0.0524618393097, 0.0),
    (2, 1, -1.63791296116e-06, -1.40003806164e-07),
    (2, 2, 0.0823993879858, -0.0281095559016),
    (3, 0, -0.00141446537045, 0.0),
    (3, 1, 0.00406016475596, 0.00336846899323),
    (3, 2, 0.00177591409489, -0.000703803181478),
    (3, 3, -0.0104163999496, -0.012071440482),
    (4, 0, 0.0129314819962, 0.0),
    (4, 1, -0.000100350933584, 0.000136939929063),
    (4, 2, -0.0174688018325, 0.00462909953071),
    (4, 3, -0.000300201192046, -0.000119207164256),
    (4, 4, 0.0174551668902, -0.00910529276948),
    (5, 0, 0.000658933858013, 0.0),
    (5, 1, -0.00276507316, -0.0012176437761),
    (5, 2, -0.000783400083663, 0.000381291649798),
    (5, 3, 0.00457612464839, 0.00353948354414),
    (5, 4, 0.000496909573768, -0.000698062572977),
    (5, 5, -0.0102064314816, -0.00583950568922),
    (6, 0, -0.00497836830437, 0.0),
    (6, 1, -2.43584360884e-05, -0.000123806736405),
    (6, 2, 0.00654236012916, -0.00119068956912),
    (6, 3, 0.000287760856777, 7.54297057642e-05),
    (6, 4, -0.00564696275765, 0.00176871415479),
    (6, 5, -0.000487912268921, 4.79265798636e-05),
    (6, 6, 0.00508559874845, -0.00160218963559),
    (7, 0, -0.000456465554646, 0.0),
    (7, 1, 0.00172212842068, 0.000704232300006),
    (7, 2, 0.000383562866553, -0.000198217150641),
    (7, 3, -0.00247156882972, -0.00143634284583),
    (7, 4, -0.000242836745686, 0.000326817153996),
    (7, 5, 0.00377380680782, 0.00190051572734),
    (7, 6, 3.24908737435e-05, -0.000495855917059),
    (7, 7, -0.00676682521427, -0.00219813817734),
    (8, 0, 0.00263212620638, 0.0),
    (8, 1, -5.00251571436e-05, -1.80509056174e-05),
    (8, 2, -0.00313715054851, 2.80086999721e-05),
    (8, 3, -0.000308700030069, -3.19178761046e-05),
    (8, 4, 0.0027670365905, -0.000480859248402),
    (8, 5, 0.000482584868144, -0.000102494392443),
    (8, 6, -0.0025413460856, 2.38751937165e-05),
    (8, 7, -0.000190465417509, -7.00412168746e-05),
    (8, 8, 0.00226721252014, 0.00137112588975),
    (9, 0, 0.000182381470524, 0.0),
    (9, 1, -0.000765841810598, -0.000125828763205),
    (9, 2, -0.000372214732495, -0.000189464220843),
    (9, 3, 0.00141592298982, 0.000998616252456),
    (9, 4, -0.000484244343546, -0.000274835674258),
    (9, 5, -0.00171645413405, -0.000979868420897),
    (9, 6, -0.000235947224651, 8.48626690994e-05),
    (9, 7, 0.00306274643906, 0.000867524523741),
    (9, 8, 0.000439923903761, -7.12609459189e-05),
    (9, 9, -0.00327339319759, -0.000722599450487),
    (10, 0, -0.000345521920962, 0.0),
    (10, 1, -0.000592277322251, 0.00112359538868),
    (10, 2, 0.00144591662224, -0.000767662656405),
    (10, 3, 0.000419639934209, 0.000450322622142),
    (10, 4, -3.61489944481e-05, -0.000704604805314),
    (10, 5, -0.000630688268739, -0.000924904765129),
    (10, 6, 0.00152741535971, 0.000930333438975),
    (10, 7, 0.00079339054, -0.000888264880037),
    (10, 8, -0.000902608748543, -4.35810565051e-05),
    (10, 9, -0.00157701659895, 5.24710138002e-05),
    (10, 10, 0.00118741936384, 0.00134677342074),
)
_DEGREE = 10


def near15a(degree: int = _DEGREE) -> Harmonics:
    """Measured field, in the axes of the Planetary Data System.

    Parameters
    ----------
    degree : int
        The highest degree, up to 10.

    Returns
    -------
    Harmonics
        Fully normalised.

    Raises
    ------
    InvalidInputError
        If the degree is not from 0 to 10.

    Examples
    --------
    >>> from losnav.gravity import eros
    >>> eros.near15a(4)
    Harmonics(mu=446275.472004, radius=16000.0, degree 4, fully normalised)
    """
    c, s = np.zeros((2, _DEGREE + 1, _DEGREE + 1))
    c[0, 0] = 1.0
    for n, m, cosine, sine in _NEAR15A:
        c[n, m], s[n, m] = cosine, sine
    field = Harmonics.from_normalized(MU, RADIUS, c, s, brillouin_radius=BRILLOUIN_RADIUS)
    return field.truncated(degree)


def principal(degree: int = _DEGREE) -> Harmonics:
    """Measured field in axes turned about z until the long axis is x (by -9.418 degrees): ``S22 = 0``.

    Parameters
    ----------
    degree : int
        The highest degree, up to 10.

    Returns
    -------
    Harmonics
        Fully normalised.

    Raises
    ------
    InvalidInputError
        If the degree is not from 0 to 10.

    Examples
    --------
    >>> from losnav.gravity import eros
    >>> field = eros.principal(4)
    >>> print(f"{field.c[2, 2]:.6f} {abs(field.s[2, 2]):.0e}")
    0.087062 0e+00
    """
    field = near15a(degree)
    if degree < 2:
        return field
    return field.rotated(0.5 * np.arctan2(field.s[2, 2], field.c[2, 2]))


def five_terms(*, brillouin_radius: float = BRILLOUIN_RADIUS) -> Harmonics:
    """Five even terms of landing studies, C20, C22, C40, C42, C44: unnormalised, principal axes.

    Left out are degree 3, odd orders, and what the rotation leaves of S42 (1.3e-3 normalised) and S44
    (3.5e-3).

    Parameters
    ----------
    brillouin_radius : float
        As for :class:`Harmonics`; 0 for studies that take this field for the truth.

    Returns
    -------
    Harmonics
        Unnormalised.

    Raises
    ------
    InvalidInputError
        If the radius is negative.

    Examples
    --------
    >>> from losnav.gravity import eros
    >>> print(f"{eros.five_terms().c[2, 0]:.6e}")
    -1.173082e-01
    """
    c = principal(4).coefficients(normalized=False)[0].copy()
    keep = [(0, 0), (2, 0), (2, 2), (4, 0), (4, 2), (4, 4)]
    terms = np.zeros_like(c)
    for n, m in keep:
        terms[n, m] = c[n, m]
    return Harmonics(MU, RADIUS, terms, np.zeros_like(terms), brillouin_radius=brillouin_radius)

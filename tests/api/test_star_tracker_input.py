"""The doorway of losnav.star_tracker: what is refused, and how; frozen, picklable, documented results."""

import copy
import inspect
import pickle

import numpy as np
import pytest

import losnav as ln
from losnav import InvalidInputError
from tests.oracle import star_tracker as oracle

ST = ln.star_tracker
ARCSEC = oracle.ARCSEC
STAR = np.array([[0.0, 0.0, 1.0]])
HEADS = [ST.Head.looking(z, 0.35, 5 * ARCSEC, n) for z, n in zip(np.eye(3), "ABC", strict=True)]
STARS = [h.stars(4, n) for n, h in enumerate(HEADS)]
CATALOGUE = [b @ h.mounting.T for b, h in zip(STARS, HEADS, strict=True)]
COVARIANCE = np.diag([2.5, 2.5, 17.5]) ** 2 * ARCSEC**2
ATTITUDES = [h.mounting.T for h in HEADS]
FRAMES = [STARS] * 3, [CATALOGUE] * 3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ST.Head(2 * np.eye(3)), r"mounting: expected a rotation matrix"),
        (lambda: ST.Head(np.eye(3)[None]), r"mounting: expected shape \(3, 3\)"),
        (lambda: ST.Head(np.eye(3), fov=20.0), r"fov: expected a field below pi rad.*degrees"),
        (lambda: ST.Head(np.eye(3), fov=-0.1), r"fov: expected a positive"),
        (lambda: ST.Head(np.eye(3), noise=0.0), r"noise: expected a noise model or the 1-sigma"),
        (lambda: ST.Head(np.eye(3), noise="good"), r"noise: expected a noise model or the 1-sigma"),
        (lambda: ST.Head(np.eye(3), mounting_covariance=-np.eye(3)), r"mounting_covariance: expected a symm"),
        (lambda: ST.Head(np.eye(3), mounting_covariance=np.eye(2)), r"mounting_covariance: expected shape"),
        (lambda: ST.Head.looking([0, 0, 0]), r"boresight: expected a vector that is not zero"),
        (lambda: ST.Head.looking(np.eye(3)), r"boresight: expected shape \(3,\)"),
        (lambda: ST.Head(np.eye(3)).covariance(5), r"fov: expected a head with a field"),
        (lambda: ST.Head(np.eye(3)).stars(5, 0), r"fov: expected a head with a field"),
        (lambda: HEADS[0].stars(-1, 0), r"count: expected a whole number of at least 0"),
        (lambda: HEADS[0].covariance(1), r"stars: expected a whole number of at least 2"),
        (lambda: HEADS[0].covariance(5, "hexagon"), r'shape: expected "square" or "circle"'),
        (lambda: ST.PixelNoise(1000.0, -0.1), r"sigma_px: expected a positive"),
        (lambda: ST.PixelNoise(np.inf, 0.1), r"focal_length_px: expected a finite"),
        (lambda: ST.PixelNoise.from_fov(4.0, 1024, 0.1), r"fov: expected a field below pi"),
        (lambda: ST.PixelNoise(1000.0, 0.1).covariance([1.0, 0, 0]), r"los: at right angles"),
        (lambda: ST.fuse([], [], []), r"heads: expected at least one Head"),
        (lambda: ST.fuse(5, [], []), r"heads: expected a sequence of Head"),
        (lambda: ST.fuse([HEADS[0], "B"], [STAR] * 2, [STAR] * 2), r"heads\[1\]: expected a Head"),
        (
            lambda: ST.fuse(HEADS, STARS[:2], CATALOGUE),
            r"body_vectors: expected 3 entries, one for each head",
        ),
        (lambda: ST.fuse(HEADS, STARS, CATALOGUE[:1]), r"catalogue_vectors: expected 3 entries"),
        (
            lambda: ST.fuse(HEADS, [STARS[0], STARS[1][:2], STARS[2]], CATALOGUE),
            r"catalogue_vectors\[1\]: expected the head's 2 stars, got 4",
        ),
        (
            lambda: ST.fuse(HEADS, [STARS[0], 2 * STARS[1], STARS[2]], CATALOGUE),
            r"body_vectors\[1\]\[0\]: expected a unit vector",
        ),
        (lambda: ST.fuse(HEADS, [[]] * 3, [[]] * 3), r"body_vectors: expected at least one star in any head"),
        (lambda: ST.fuse(HEADS[:1], [STAR], [STAR], robust=True), r"body_vectors: expected at least 2 stars"),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, []).best(), r"angles: expected at least one"),
        (lambda: ST.fuse(HEADS, STARS, CATALOGUE, [1.0, 2.0]), r"sigmas: expected 3 entries"),
        (lambda: ST.fuse(HEADS, STARS, CATALOGUE, -1.0), r"sigmas\[0\]: expected a positive"),
        (
            lambda: ST.fuse(HEADS, STARS, CATALOGUE, [1.0, [1.0, 2.0], 1.0]),
            r"sigmas\[1\]: expected a scalar or",
        ),
        (lambda: ST.fuse(HEADS, STARS, CATALOGUE, 1.0, "magic"), r"method"),
        (
            lambda: ST.fuse(HEADS, STARS, CATALOGUE, covariances=[np.eye(3), -np.eye(3), np.eye(3)]),
            r"covariances\[1\].*symmetric positive",
        ),
        (
            lambda: ST.fuse(HEADS[:1], [STAR], [STAR], covariances=[np.diag([0.0, 0, 1])]),
            r"covariances\[0\]: expected a spread across every star",
        ),
        (lambda: ST.fuse_attitudes(HEADS, ATTITUDES[:2], [COVARIANCE] * 3), r"attitudes: expected shape"),
        (lambda: ST.fuse_attitudes(HEADS, ATTITUDES, [COVARIANCE] * 2), r"covariances: expected shape"),
        (
            lambda: ST.fuse_attitudes(HEADS, [ATTITUDES[0], 2 * np.eye(3), None], [COVARIANCE] * 3),
            r"attitudes\[1\]: expected a rotation",
        ),
        (
            lambda: ST.fuse_attitudes(HEADS, ATTITUDES, [COVARIANCE, 0 * COVARIANCE, COVARIANCE]),
            r"covariances\[1\]: expected a positive definite",
        ),
        (
            lambda: ST.fuse_attitudes(HEADS, ATTITUDES, [COVARIANCE] * 3, false_alarm=0.0),
            r"false_alarm: expected a probability",
        ),
        (
            lambda: ST.detection_power(HEADS, [COVARIANCE] * 3, 3, [0, 0, 1]),
            r"head: expected a head from 0 to 2",
        ),
        (lambda: ST.detection_power(HEADS[:1], [COVARIANCE], 0, [0, 0, 1]), r"heads: expected at least 2"),
        (lambda: ST.fused_covariance([COVARIANCE] * 2, [np.eye(3)] * 3), r"mountings: expected 2 entries"),
        (
            lambda: ST.fused_covariance(COVARIANCE, np.eye(3)),
            r"covariances: expected shape \(\.\.\., N, 3, 3\)",
        ),
        (
            lambda: ST.fused_covariance([np.diag([1.0, 1, 0])] * 2, [np.eye(3)] * 2),
            r"covariances\[0\]: expected a positive definite matrix.*two stars",
        ),
        (lambda: ST.mounting_bias([COVARIANCE], [np.eye(3)], [0, 0, 1]), r"errors: expected shape"),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, 2.2), r"angles: expected 0\.00 to 120\.00 deg"),
        (
            lambda: ST.separation_sweep([COVARIANCE] * 3, [1.0, 90.0]),
            r"angles\[1\]: expected 0\.00 to 120\.00",
        ),
        (lambda: ST.separation_sweep([COVARIANCE] * 4, 1.0), r"geometry: expected 2 or 3 heads"),
        (lambda: ST.separation_sweep([COVARIANCE] * 2, 1.0, "asymmetric"), r"geometry: expected 3 heads"),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, 1.0, "star"), r'geometry: expected "symmetric"'),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, 0.1, "asymmetric"), r"angles: expected 21\.50 to 158"),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, 1.0, frame=3), r"frame: expected a head from 0 to 2"),
        (
            lambda: ST.separation_sweep([COVARIANCE] * 3, 1.0, frame="body"),
            r"frame: expected a head's number",
        ),
        (lambda: ST.separation_sweep([COVARIANCE] * 3, 1.0).best("roll"), r"measure: expected"),
        (lambda: ST.optimal_layout(1), r"count: expected a whole number of at least 2"),
        (lambda: ST.optimal_layout(3, ratio=0.5), r"ratio: expected at least 1"),
        (lambda: ST.optimal_layout(3, sigma=[1.0, 2.0]), r"sigma: expected a scalar or shape \(3,\)"),
        (lambda: ST.optimal_layout(3, criterion="best"), r"criterion: expected"),
        (
            lambda: ST.optimal_layout(3, exclusions=[[0, 0, 1]]),
            r"exclusions\[0\]: expected \(direction, half",
        ),
        (
            lambda: ST.optimal_layout(3, exclusions=[([0, 0, 0], 1.0)]),
            r"exclusions\[0\]: expected a direction",
        ),
        (
            lambda: ST.optimal_layout(3, exclusions=[([0, 0, 1], 4.0)]),
            r"exclusions\[0\]: expected a half-angle",
        ),
        (lambda: ST.select_stars(STARS[0], 5), r"count: expected at most the 4 stars"),
        (lambda: ST.select_stars(STARS[0], 1), r"count: expected a whole number of at least 2"),
        (lambda: ST.select_stars(STARS[0], 3, criterion="best"), r"criterion: expected"),
        (lambda: ST.select_stars(STARS[0], 3, method="luck"), r"method: expected"),
        (
            lambda: ST.select_stars(HEADS[0].stars(60, 1), 12, method="exhaustive"),
            r"method: exhaustive would",
        ),
        (lambda: ST.align_heads(HEADS[:1], [STARS[:1]], [CATALOGUE[:1]]), r"heads: expected at least 2"),
        (lambda: ST.align_heads(HEADS, *FRAMES, reference=3), r"reference: expected a head from 0 to 2"),
        (
            lambda: ST.align_heads(HEADS, FRAMES[0], FRAMES[1][:1]),
            r"body_vectors, catalogue_vectors: expected",
        ),
        (lambda: ST.align_heads(HEADS, [], []), r"body_vectors, catalogue_vectors: expected"),
        (
            lambda: ST.align_heads(HEADS, [STARS, [STARS[0], STARS[1] * 2, None]], FRAMES[1][:2]),
            r"frame 1: body_vectors\[1\]\[0\]: expected a unit",
        ),
        (
            lambda: ST.align_heads(HEADS, [[STAR, None, None]], [[STAR, None, None]]),
            r"body_vectors: expected a frame with stars in two directions",
        ),
        (lambda: ST.aberrate(STAR, [3e8, 0, 0]), r"velocity: expected a speed below that of light"),
        (lambda: ST.aberrate(STAR, np.zeros((2, 2, 3))[:, :, :2]), r"velocity: expected shape"),
        (lambda: ST.catalogue_directions(0.0, 0.0, parallax=-1e-9), r"parallax: expected no negative"),
        (lambda: ST.catalogue_directions([0.0, 1], [0.0, 1, 2]), r"leading dimensions do not broadcast: ra"),
        (lambda: ST.catalogue_directions(0.0, 0.0, observer=[0, 1]), r"observer: expected shape"),
        (
            lambda: ST.catalogue_covariance(0.0, 0.0, np.eye(3)),
            r"covariance: expected shape \(\.\.\., 2, 2\)",
        ),
        (lambda: ST.to_epoch(HEADS, STARS, [0.0, 0.1], [0, 0, 1]), r"times: expected 3 entries"),
        (
            lambda: ST.to_epoch(HEADS, STARS, [0.0, [0.1, 0.2], 0.0], [0, 0, 1]),
            r"times\[1\]: expected one time",
        ),
        (lambda: ST.to_epoch(HEADS, STARS, 0.0, [0, 1]), r"rate: expected shape"),
        (
            lambda: ST.epoch_covariance(HEADS[0], COVARIANCE, 0.1, np.eye(2)),
            r"rate_covariance: expected shape",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(InvalidInputError, match=f"^{message}"):
        call()


RESULTS = {
    "head": lambda: HEADS[0],
    "fused attitude": lambda: ST.fuse_attitudes(HEADS, ATTITUDES, [COVARIANCE] * 3),
    "sweep": lambda: ST.separation_sweep([COVARIANCE] * 3, [0.5, 1.0]),
    "layout": lambda: ST.optimal_layout(4),
    "alignment": lambda: ST.align_heads(HEADS, *FRAMES),
    "pixel noise": lambda: ST.PixelNoise(1000.0, 0.1),
}


def arrays(result):
    return {k: v for k, v in vars(result).items() if isinstance(v, np.ndarray)}


@pytest.mark.parametrize("name", RESULTS)
@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_and_pickles(name, duplicate):
    result = RESULTS[name]()
    twin = duplicate(result)
    assert type(twin) is type(result)
    for key, value in arrays(result).items():
        assert np.array_equal(value, getattr(twin, key), equal_nan=True)
    assert len(str(twin)) > 10


@pytest.mark.parametrize("name", RESULTS)
def test_results_are_frozen(name):
    result = RESULTS[name]()
    with pytest.raises(AttributeError):
        setattr(result, next(iter(vars(result))), None)


def test_a_head_keeps_its_own_mounting():
    mounting = np.eye(3)
    head = ST.Head(mounting)
    mounting[0, 0] = -1
    assert head.mounting[0, 0] == 1
    with pytest.raises(ValueError, match="read-only"):
        head.mounting[0, 0] = 5


def test_a_noise_model_of_ones_own():
    """Anything with sigma and covariance will do: here stars twice as bad along x."""

    class Smeared:
        def sigma(self, body_vectors):
            return np.full(np.shape(body_vectors)[:-1], 1.6 * ARCSEC)

        def covariance(self, body_vectors):
            shape = np.shape(body_vectors)
            return np.broadcast_to(np.diag([4.0, 1, 1]) * ARCSEC**2, (*shape, 3))

    head = ST.Head(np.eye(3), 0.1, Smeared())
    stars = head.stars(50, 1)
    covariance = ST.fuse([head], [stars], [stars]).covariance
    assert np.sqrt(covariance[1, 1] / covariance[0, 0]) == pytest.approx(2, rel=0.01)
    assert np.linalg.inv(head.information(stars)) == pytest.approx(covariance, rel=1e-9)


def test_nothing_is_a_batch_of_nothing():
    assert str(ST.separation_sweep([COVARIANCE] * 3, [])) == "SeparationSweep(3 heads, 0 angles)"
    none = [np.empty((0, *b.shape)) for b in STARS]
    for noise in (5 * ARCSEC, ST.PixelNoise(2000.0, 0.1)):
        heads = [ST.Head(h.mounting, h.fov, noise) for h in HEADS]
        assert ST.fuse(heads, none, CATALOGUE).dcm.shape == (0, 3, 3)
        assert ST.fuse(heads, none, CATALOGUE, robust=True).inliers.shape[0] == 0
    empty = ST.fuse_attitudes(HEADS, np.empty((0, 3, 3, 3)), [COVARIANCE] * 3)
    assert empty.dcm.shape == (0, 3, 3)
    assert empty.quaternion.shape == (0, 4)
    assert ST.fused_covariance(np.empty((0, 3, 3, 3)), ATTITUDES).shape == (0, 3, 3)


def test_bare_mountings_are_heads():
    expected = ST.fuse(HEADS, STARS, CATALOGUE, 1e-5)
    bare = ST.fuse([h.mounting for h in HEADS], STARS, CATALOGUE, 1e-5)
    assert np.array_equal(bare.dcm, expected.dcm)


def test_solutions_are_attitudes():
    """Those of solve_attitude with their own covariances; one star only: that head is blind."""
    solutions = [ln.solve_attitude(b, r, sigma=1e-5) for b, r in zip(STARS, CATALOGUE, strict=True)]
    fused = ST.fuse_attitudes(HEADS, solutions)
    assert fused.used.all()
    assert np.abs(fused.dcm - np.eye(3)).max() < 1e-12
    solutions[1] = ln.solve_attitude(STARS[1][:1], CATALOGUE[1][:1], sigma=1e-5)
    assert ST.fuse_attitudes(HEADS, solutions).blind.tolist() == [False, True, False]
    with pytest.raises(InvalidInputError, match=r"^attitudes: expected 3 entries"):
        ST.fuse_attitudes(HEADS, solutions[:2])
    with pytest.raises(InvalidInputError, match=r"^covariances: expected those of the attitudes"):
        ST.fuse_attitudes(HEADS, ATTITUDES)


def test_contract():
    """Names and order of arguments that user code is written against."""
    expected = {
        "Head": ["mounting", "fov", "noise"],
        "fuse": ["heads", "body_vectors", "catalogue_vectors", "sigmas", "method"],
        "fuse_attitudes": ["heads", "attitudes", "covariances"],
        "fused_covariance": ["covariances", "mountings"],
        "separation_sweep": ["covariances", "angles", "geometry"],
    }
    for name, arguments in expected.items():
        found = inspect.signature(getattr(ST, name)).parameters
        assert list(found)[: len(arguments)] == arguments
        for argument in arguments:
            assert found[argument].kind is inspect.Parameter.POSITIONAL_OR_KEYWORD
    fused = ST.fuse_attitudes(HEADS, ATTITUDES, [COVARIANCE] * 3)
    for field in ("dcm", "quaternion", "mrp", "covariance", "information", "loss", "chi2", "dof", "rank"):
        assert np.shape(getattr(fused, field)) == np.shape(getattr(ST.fuse(HEADS, STARS, CATALOGUE), field))


def test_public_functions_have_examples():
    for name in ST.__all__:
        thing = getattr(ST, name)
        if inspect.isfunction(thing):
            assert ">>>" in thing.__doc__, name

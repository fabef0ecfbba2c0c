"""A hundred thousand spoiled calls from a seed, without shrinking; LOSNAV_FUZZ=N for N of every function.

Finds what is rare; test_fuzz.py finds what is small. A panic is no Exception and ends the test.
"""

import os
import warnings

import numpy as np
import pytest

from losnav import LosnavError
from tests.api.calls import CALLS, numbers

CALLS_EACH = int(os.environ.get("LOSNAV_FUZZ", "4000"))
ORDINARY = [0.0, -0.0, 1.0, -1.0, 2.0, 0.5, 1 + 2**-52, 2.0**53, np.pi]
EXTREME = [np.nan, np.inf, -np.inf, 5e-324, 1e-310, 1.7e308, -1.7e308]
BETWEEN = [1e-200, 1e-100, 1e-20, 1e-8, 1e8, 1e20, 1e100, 1e154, 1e160]
VALUES = np.array([*ORDINARY, *EXTREME, *BETWEEN])
SCALES = np.array([1e-300, 1e-160, 1e-80, 1e-10, 1e10, 1e80, 1e160, 1e300])


def spoil(rng, value):
    """One to four random changes: an entry, a row, the scale, a permutation, noise, the last axes."""
    value = np.array(value)
    for _ in range(rng.integers(1, 5)):
        kind = rng.integers(7)
        with np.errstate(all="ignore"):
            if kind <= 1 and value.size:
                value.flat[rng.integers(value.size)] = rng.choice(VALUES)
            elif kind == 2 and value.ndim:
                value[rng.integers(len(value))] = rng.choice(VALUES)
            elif kind == 3:
                value = value * rng.choice(SCALES)
            elif kind == 4 and value.ndim:
                value = value[rng.integers(len(value), size=len(value))]
            elif kind == 5:
                value = value * (1 + 10.0 ** rng.integers(-16, 2) * rng.standard_normal(value.shape))
            elif kind == 6:
                value = np.broadcast_to(value, (rng.integers(0, 3), *value.shape)).copy()
                break
        if not (value.ndim and len(value)):
            break
    return value


def sound(result):
    """Finite wherever success is claimed."""
    converged = np.asarray(getattr(result, "converged", True))
    for value in numbers(result):
        if value.dtype.kind == "f":
            claimed = np.isfinite(value[converged]) if converged.shape else np.isfinite(value) | ~converged
            if not claimed.all():
                return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize("name", CALLS)
def test_many_spoiled_calls(name):
    rng = np.random.default_rng(sum(map(ord, name)))
    call = CALLS[name]
    arguments = sorted(call.arrays)
    answered = refused = 0
    bad = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(CALLS_EACH):
            chosen = [a for a in arguments if rng.random() < 0.5] or arguments
            changes = {a: spoil(rng, call.arrays[a]) for a in chosen}
            try:
                result = call(**changes)
            except LosnavError:
                refused += 1
                continue
            except Exception as error:
                bad.append((repr(error)[:200], changes))
                continue
            answered += 1
            if not sound(result):
                bad.append(("not finite", changes))
    assert not bad, f"{len(bad)} of {CALLS_EACH}, the first: {bad[0]}"
    # Neither everything refused nor everything swallowed: the spoiling reaches both sides of the door.
    assert answered > CALLS_EACH // 100
    assert refused > CALLS_EACH // 100

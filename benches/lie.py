"""Lie matrices beside twins: the direction to the Sun along a two-body orbit, orders 0 to 5, 18 by 6.

==============  ==========================================  ===============================================
contender       how                                         in losnav's terms
==============  ==========================================  ===============================================
losnav          power series with derivatives, any model    arguments checked; units chosen
                and sensor
SymPy twin      derivatives by hand of SymPy, common        this model and sensor alone; a minute to make;
                subexpressions, ``lambdify`` to NumPy       no checks
JAX twin        ``jax.experimental.jet`` through a          this model and sensor alone; compiled; no
                recursion, ``jacfwd``, ``jit``, ``vmap``    checks
==============  ==========================================  ===============================================

Run it by itself: ``python -m benches.lie``. Canonical units everywhere; contenders whose library is missing
are left out.
"""

from __future__ import annotations

import math
import sys
import time

import numpy as np

import losnav as ln
from benches.clock import Contender, interleaved
from benches.report import verdict

ORDER = 5
MODEL, SENSOR = ln.dynamics.TwoBody(1.0), ln.sensors.SunDirection(5e-5)
STATE = np.array([0.9, 0.3, 0.2, -0.4, 0.9, 0.1])


def states(count, seed=7):
    """Orbits about the one of the single call."""
    return STATE + 0.05 * np.random.default_rng(seed).standard_normal((count, 6))


def losnav_matrix(x):
    """One call."""
    space = {"x": x, "lie_matrix": ln.observability.lie_matrix, "m": MODEL, "s": SENSOR}
    statement = f"y = lie_matrix(m, s, x, {ORDER})"
    return Contender("losnav lie_matrix", statement, space, max(1, x.size // 6))


def sympy_matrix(x):
    """Derivatives as expressions."""
    import sympy

    symbols = sympy.symbols("x:6", real=True)
    r, v = sympy.Matrix(symbols[:3]), sympy.Matrix(symbols[3:])
    distance = sympy.sqrt(r.dot(r))
    field, h = sympy.Matrix([*v, *(-r / distance**3)]), -r / distance
    rows = []
    for _ in range(ORDER + 1):
        rows.append(h.jacobian(symbols))
        h = rows[-1] * field
    made = sympy.lambdify([symbols], sympy.Matrix.vstack(*rows), "numpy", cse=True)
    if x.ndim > 1:
        return Contender("SymPy twin", "y = [made(row) for row in x]", {"x": x, "made": made}, len(x))
    return Contender("SymPy twin", "y = made(x)", {"x": x, "made": made}, 1)


def jax_matrix(x):
    """Taylor arithmetic of JAX."""
    import jax
    from jax.experimental.jet import jet

    jax.config.update("jax_enable_x64", True)
    jnp = jax.numpy

    def field(y):
        r = y[:3]
        return jnp.concatenate([y[3:], -r / jnp.sqrt(r @ r) ** 3])

    def derivatives(y):
        terms = [field(y)]
        for _ in range(ORDER - 1):
            first, others = jet(field, (y,), (terms,))
            terms = [first, *others]
        h, others = jet(lambda z: -z[:3] / jnp.sqrt(z[:3] @ z[:3]), (y,), (terms,))
        return jnp.concatenate([h, *others])

    matrix = jax.jacfwd(derivatives)
    made = jax.jit(matrix if x.ndim == 1 else jax.vmap(matrix))
    space = {"x": jnp.asarray(x), "made": made}
    return Contender("JAX twin", "y = made(x).block_until_ready()", space, max(1, x.size // 6))


def available(makers, x):
    """Contenders whose library is here, each with what it makes of the states."""
    found = []
    for maker in makers:
        start = time.perf_counter()
        try:
            contender = maker(x)
        except ImportError:
            continue
        exec(contender.statement, contender.namespace)
        contender.note = f"{time.perf_counter() - start:.1f} s to make"
        found.append(contender)
    return found


def table(title, makers, x, *, rounds, target):
    """Rows of Markdown: medians of interleaved rounds, ratio to losnav, difference; the target in us."""
    contenders = available(makers, x)
    times = interleaved(contenders, rounds)
    reference = np.asarray(contenders[0].namespace["y"])
    lines = [
        f"### {title}",
        "",
        "| contender | median, µs each | ratio | difference | |",
        "|---|---|---|---|---|",
    ]
    for contender, taken in zip(contenders, times, strict=True):
        answer = np.asarray(contender.namespace["y"]).reshape(reference.shape)
        error = np.abs(answer - reference).max() / np.abs(reference).max()
        ratio = taken.median / times[0].median
        each = 1e6 * taken.median
        lines.append(f"| {contender.name} | {each:.3g} | {ratio:.3g} | {error:.1e} | {contender.note} |")
    ours = 1e6 * times[0].median
    return "\n".join([*lines, "", verdict("µs for losnav", ours, target, at_least=False), ""])


def section(*, quick, rounds):
    """The section of the results."""
    makers = [losnav_matrix, sympy_matrix, jax_matrix]
    size = 1000 if quick else 100_000
    rows = math.prod((ORDER + 1, 3))
    return "\n".join(
        [
            "## Lie derivatives",
            "",
            f"Direction to the Sun along a two-body orbit, orders 0 to {ORDER}: {rows} rows, 6 columns.",
            "",
            table("One state", makers, STATE, rounds=rounds, target=3.0),
            table(
                f"{size} states, each", [losnav_matrix, jax_matrix], states(size), rounds=rounds, target=1.0
            ),
        ]
    )


if __name__ == "__main__":
    print(section(quick="--quick" in sys.argv, rounds=15))

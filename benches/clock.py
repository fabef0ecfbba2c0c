"""Times of several contenders in one interleaved run: the same seconds of one machine for all."""

from __future__ import annotations

import gc
import statistics
import timeit
from dataclasses import dataclass, field

TARGET_SECONDS = 4e-3
"""Length of one measurement: long beside the clock's resolution, short beside the scheduler's moods."""
FEWEST = 5
"""Rounds everybody gets."""
PATIENCE_SECONDS = 3.0
"""Time a contender may take in one table before further rounds leave it out."""


@dataclass
class Contender:
    """Something to time: a statement over a namespace that does ``calls`` calls, and its answers."""

    name: str
    statement: str
    namespace: dict
    calls: int
    answers: list = field(default_factory=list)
    note: str = ""


@dataclass
class Time:
    """Seconds for one call."""

    median: float
    minimum: float


def interleaved(contenders, rounds):
    """Median and minimum over the rounds; each round times every contender once, in turning order."""
    timers = [timeit.Timer(c.statement, globals=c.namespace) for c in contenders]
    numbers = []
    for timer in timers:
        timer.timeit(1)
        once = min(timer.timeit(1) for _ in range(3))
        numbers.append(max(1, int(TARGET_SECONDS / max(once, 1e-9))))
    seconds = [[] for _ in contenders]
    spent = [0.0] * len(contenders)
    gc.collect()
    for turn in range(rounds):
        for step in range(len(contenders)):
            k = (step + turn) % len(contenders)
            # The slowest of all would take minutes: five rounds tell enough of them.
            if turn < FEWEST or spent[k] < PATIENCE_SECONDS:
                elapsed = timers[k].timeit(numbers[k])
                spent[k] += elapsed
                seconds[k].append(elapsed / numbers[k] / contenders[k].calls)
    return [Time(statistics.median(s), min(s)) for s in seconds]

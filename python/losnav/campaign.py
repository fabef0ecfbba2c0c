"""Monte Carlo campaigns: any executor, exact checkpoints, the same bits for any number of workers.

A campaign is ``runs`` independent repetitions of a task, cut into blocks of consecutive runs. The task
receives the seeds of one block and returns arrays whose first axis counts the runs, so it can solve the whole
block as one batch.

1. Run ``k`` draws all its random numbers from ``SeedSequence(seed).spawn(runs)[k]``, wherever and whenever it
   is computed.
2. The cut into blocks depends on ``runs`` and ``block`` alone, never on the executor. A task therefore sees
   the same batches, and returns the same bits, with 1, 2 or 8 workers (on machines with the same instruction
   set).
3. Each finished block is written to ``out`` under a temporary name, flushed to the disk and renamed: a block
   is there whole or not at all. A process killed anywhere resumes from the blocks it finds and ends with the
   bits of an uninterrupted campaign.
4. Only the calling process touches ``out``; workers return arrays, so they may live on other machines.
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import json
import multiprocessing
import operator
import os
import signal
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from losnav.errors import InvalidInputError

__all__ = ["Progress", "Task", "is_finished", "run_campaign", "worker_pool"]

Arrays: TypeAlias = dict[str, NDArray[Any]]
#: Called with the number of finished runs and the total.
Progress: TypeAlias = Callable[[int, int], None]

_MANIFEST = "campaign.json"
_RESULTS = "results.npz"
_FORMAT = 1


class Task(Protocol):
    """What a campaign repeats: the seeds of a block of runs in, arrays with one row for each run out."""

    def __call__(self, seeds: Sequence[SeedSequence], /) -> Mapping[str, NDArray[Any]]: ...


def run_campaign(
    task: Task,
    runs: int,
    *,
    seed: int = 0,
    block: int = 50,
    executor: concurrent.futures.Executor | None = None,
    out: str | os.PathLike[str] | None = None,
    resume: bool = False,
    progress: bool | Progress = False,
    describe: Mapping[str, Any] | None = None,
) -> Arrays:
    """Run a Monte Carlo campaign and return its arrays, run by run.

    Parameters
    ----------
    task : callable
        ``task(seeds) -> {name: array}`` with one row for each seed. It must be picklable for executors that
        use other processes: a module-level function, a ``functools.partial`` of one, or an instance of a
        module-level class.
    runs : int
        Number of runs, at least 1.
    seed : int
        Seed of the campaign; run ``k`` gets ``SeedSequence(seed).spawn(runs)[k]``.
    block : int
        Runs handed to ``task`` at a time, and the grain of the checkpoints. Part of the campaign's identity.
    executor : concurrent.futures.Executor, optional
        Where blocks run: a thread or process pool, Dask's ``client.get_executor()``,
        ``mpi4py.futures.MPIPoolExecutor``… None runs them here, one after the other. The executor is not shut
        down.
    out : path, optional
        Folder of the checkpoints and of the final ``results.npz``. Created if absent.
    resume : bool
        Continue the campaign found in ``out``. Without it a folder that already holds one is refused, never
        overwritten.
    progress : bool or callable
        True shows a bar on standard error if that is a terminal (nothing otherwise); a callable receives
        ``(done, total)``.
    describe : mapping, optional
        JSON-able description of the task (name, parameters). Stored in ``out`` and compared on resume.

    Returns
    -------
    dict of arrays
        The task's arrays, each with ``runs`` rows in run order.

    Raises
    ------
    InvalidInputError
        If an argument is out of range, ``out`` holds another campaign, or the task returns arrays of the
        wrong length.

    Notes
    -----
    An interrupt (Ctrl-C) or an exception of the task cancels what has not started, stores what has finished,
    and is raised again.

    Examples
    --------
    >>> import numpy as np
    >>> from losnav.campaign import run_campaign
    >>> def dice(seeds):
    ...     return {"sum": np.array([np.random.default_rng(s).integers(1, 7, size=2).sum() for s in seeds])}
    >>> run_campaign(dice, runs=6, seed=1, block=4)["sum"].shape
    (6,)
    """
    runs, block, seed = _count("runs", runs), _count("block", block), _count("seed", seed, least=0)
    store = None if out is None else _Store(Path(out), _manifest(runs, seed, block, describe), resume)
    if store is not None and (finished := store.load_results()) is not None:
        return finished
    blocks = {start: min(start + block, runs) for start in range(0, runs, block)}
    done: dict[int, Arrays] = {}
    if store is not None:
        done.update((start, arrays) for start in blocks if (arrays := store.load_block(start)) is not None)
    todo = [(start, stop) for start, stop in blocks.items() if start not in done]
    with _reporting(progress) as report:
        count = sum(blocks[start] - start for start in done)
        report(count, runs)
        for start, arrays in _computed(task, seed, todo, executor, store):
            done[start] = arrays
            count += blocks[start] - start
            report(count, runs)
    results = {name: np.concatenate([done[start][name] for start in blocks]) for name in done[0]}
    if store is not None:
        store.save_results(results)
    return results


def is_finished(out: str | os.PathLike[str]) -> bool:
    """Whether a folder holds a campaign with its results.

    Examples
    --------
    >>> import tempfile
    >>> from losnav.campaign import is_finished
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     is_finished(folder)
    False
    """
    return Path(out, _RESULTS).exists()


def _count(argument: str, value: int, least: int = 1) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise InvalidInputError(f"{argument}: expected an integer, got {value!r}") from None
    if number < least:
        raise InvalidInputError(f"{argument}: expected at least {least}, got {number}")
    return number


def _manifest(runs: int, seed: int, block: int, describe: Mapping[str, Any] | None) -> dict[str, Any]:
    from losnav import __version__

    manifest = {
        "format": _FORMAT,
        "losnav": __version__,
        "runs": runs,
        "seed": seed,
        "block": block,
        "task": dict(describe or {}),
    }
    # Through JSON and back, so that a fresh manifest compares equal to a stored one (tuples become lists).
    loaded: dict[str, Any] = json.loads(json.dumps(manifest))
    return loaded


def _block(task: Task, seed: int, start: int, stop: int) -> Arrays:
    """Compute runs ``start`` to ``stop``; module-level so that any executor can pickle it."""
    # A child made from its spawn key is the one spawn() returns, without making the thousands before it.
    seeds = [SeedSequence(seed, spawn_key=(k,)) for k in range(start, stop)]
    arrays = {name: np.asarray(values) for name, values in task(seeds).items()}
    for name, values in arrays.items():
        if values.ndim == 0 or len(values) != len(seeds):
            raise InvalidInputError(
                f"task()[{name!r}]: expected {len(seeds)} rows, one for each seed, got shape {values.shape}"
            )
    if not arrays:
        raise InvalidInputError("task(): expected at least one array, got none")
    return arrays


def _computed(
    task: Task,
    seed: int,
    todo: Sequence[tuple[int, int]],
    executor: concurrent.futures.Executor | None,
    store: _Store | None,
) -> Iterator[tuple[int, Arrays]]:
    """Yield (start, arrays) of each block as it finishes, stored first."""
    if executor is None:
        for start, stop in todo:
            arrays = _block(task, seed, start, stop)
            if store is not None:
                store.save_block(start, arrays)
            yield start, arrays
        return
    futures = {executor.submit(_block, task, seed, start, stop): start for start, stop in todo}
    waiting = set(futures)
    try:
        for future in concurrent.futures.as_completed(futures):
            arrays = future.result()
            if store is not None:
                store.save_block(futures[future], arrays)
            waiting.discard(future)
            yield futures[future], arrays
    except BaseException:
        _abandon(waiting, futures, store)
        raise


def _abandon(
    waiting: set[concurrent.futures.Future[Arrays]],
    futures: Mapping[concurrent.futures.Future[Arrays], int],
    store: _Store | None,
) -> None:
    """Cancel what has not started and keep what has finished."""
    for future in waiting:
        future.cancel()
    for future in waiting:
        if store is not None and future.done() and not future.cancelled() and future.exception() is None:
            store.save_block(futures[future], future.result())


class _Store:
    """The folder of one campaign: a manifest, finished blocks, and in the end one file of results."""

    def __init__(self, folder: Path, manifest: dict[str, Any], resume: bool) -> None:
        self.folder = folder
        path = folder / _MANIFEST
        try:
            folder.mkdir(parents=True, exist_ok=True)
            found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
        except (OSError, ValueError) as error:
            raise InvalidInputError(
                f"out: expected a folder for checkpoints, got {folder}: {error}"
            ) from None
        if found is None:
            self._replace(path, lambda file: file.write(json.dumps(manifest, indent=1).encode()))
            return
        if not resume:
            raise InvalidInputError(
                f"out: expected a folder without a campaign, or resume, got {folder}, which holds one"
            )
        was, now = ({**m, **m["task"]} for m in (found, manifest))
        changed = [key for key in {**now, **was} if key != "task" and was.get(key) != now.get(key)]
        if changed:
            got = ", ".join(
                f"{key} {_brief(was.get(key))} instead of {_brief(now.get(key))}" for key in changed
            )
            raise InvalidInputError(f"out: expected the campaign to resume, got {folder} with {got}")
        for leftover in folder.glob(".*.tmp"):
            leftover.unlink(missing_ok=True)

    def save_block(self, start: int, arrays: Arrays) -> None:
        self._replace(self._block_path(start), lambda file: _savez(file, arrays))

    def load_block(self, start: int) -> Arrays | None:
        return self._load(self._block_path(start))

    def save_results(self, arrays: Arrays) -> None:
        self._replace(self.folder / _RESULTS, lambda file: _savez(file, arrays))
        for path in self.folder.glob("block-*.npz"):
            path.unlink(missing_ok=True)

    def load_results(self) -> Arrays | None:
        return self._load(self.folder / _RESULTS)

    def _block_path(self, start: int) -> Path:
        return self.folder / f"block-{start:08d}.npz"

    @staticmethod
    def _load(path: Path) -> Arrays | None:
        try:
            # Opened here: NumPy leaves the file it opened itself open when the archive is damaged.
            with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        except (FileNotFoundError, zipfile.BadZipFile, EOFError, ValueError):
            # Absent or damaged (a disk error: renaming never leaves half a file): compute it again.
            return None

    def _replace(self, path: Path, write: Callable[[Any], object]) -> None:
        temporary = self.folder / f".{path.name}.{os.getpid()}.tmp"
        with open(temporary, "wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)


def _savez(file: Any, arrays: Arrays) -> None:
    # A mapping of names may not be spread over a signature that also names options.
    save: Callable[..., None] = np.savez
    save(file, **arrays)


def _brief(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "…"


@contextlib.contextmanager
def _reporting(progress: bool | Progress) -> Iterator[Progress]:
    """Turn ``progress`` into a callable: the caller's own, a bar on a terminal, or silence."""
    if callable(progress):
        yield progress
    elif not progress or not sys.stderr.isatty():
        yield lambda done, total: None
    else:
        try:
            from rich.console import Console
            from rich.progress import Progress as Bar
        except ImportError:
            yield _plain_bar
            return
        with Bar(console=Console(stderr=True), transient=True) as bar:
            line = bar.add_task("runs", total=None)
            yield lambda done, total: bar.update(line, completed=done, total=total)


def _plain_bar(done: int, total: int) -> None:
    filled = 40 * done // total
    end = "\n" if done == total else ""
    sys.stderr.write(f"\r[{'#' * filled}{'.' * (40 - filled)}] {done}/{total} runs{end}")
    sys.stderr.flush()


def worker_pool(jobs: int) -> concurrent.futures.ProcessPoolExecutor:
    """Make a pool of worker processes suited to campaigns on this machine.

    The workers are started afresh (never forked from a process that may already run threads), each solves its
    batches on one core, and they leave Ctrl-C to the calling process, which stores what has finished before
    it stops.

    Parameters
    ----------
    jobs : int
        Number of processes, at least 1.

    Returns
    -------
    concurrent.futures.ProcessPoolExecutor
        To be used as a context manager.

    Raises
    ------
    InvalidInputError
        If ``jobs`` is less than 1.

    Examples
    --------
    >>> from losnav.campaign import worker_pool
    >>> with worker_pool(1) as pool:
    ...     pool.submit(abs, -3).result()
    3
    """
    return concurrent.futures.ProcessPoolExecutor(
        max_workers=_count("jobs", jobs),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_prepare_worker,
    )


def _prepare_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # One core for each worker; the solver's own thread pool reads this when it first starts.
    os.environ.setdefault("RAYON_NUM_THREADS", "1")

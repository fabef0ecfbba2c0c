"""The campaign engine: same bits whatever the executor, and whatever kills it on the way."""

from __future__ import annotations

import concurrent.futures
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from numpy.random import SeedSequence, default_rng

from losnav.campaign import run_campaign, worker_pool
from losnav.errors import InvalidInputError

RUNS, BLOCK, SEED = 23, 4, 11

# A campaign slow enough to be shot: a block takes 50 ms. It listens to Ctrl-C even where the tests run in the
# background of a shell, which would have its children ignore it.
SLOW = """
import signal, sys, time
import numpy as np
from losnav.campaign import run_campaign

signal.signal(signal.SIGINT, signal.default_int_handler)

def task(seeds):
    time.sleep(0.05)
    return {"x": np.stack([np.random.default_rng(s).standard_normal(5) for s in seeds])}

run_campaign(task, 40, seed=3, block=2, out=sys.argv[1], resume="resume" in sys.argv)
"""


def draws(seeds):
    """Five normals and a counter for each run; module-level, so that processes can unpickle it."""
    x = np.stack([default_rng(seed).standard_normal(5) for seed in seeds])
    return {"x": x, "positive": (x > 0).sum(axis=1)}


def fails_late(seeds):
    if any(seed.spawn_key[0] >= 12 for seed in seeds):
        raise ZeroDivisionError("run 12")
    return draws(seeds)


def dies_late(seeds):
    if any(seed.spawn_key[0] >= 12 for seed in seeds):
        os._exit(1)
    return draws(seeds)


def too_few_rows(seeds):
    return {"x": np.zeros(len(seeds) + 1)}


@pytest.fixture(scope="module")
def expected():
    seeds = SeedSequence(SEED).spawn(RUNS)
    return np.stack([default_rng(seed).standard_normal(5) for seed in seeds])


def same(arrays, expected):
    return arrays["x"].tobytes() == expected.tobytes() and np.array_equal(
        arrays["positive"], (expected > 0).sum(axis=1)
    )


def test_run_k_draws_from_spawned_seed_k(expected):
    assert same(run_campaign(draws, RUNS, seed=SEED, block=BLOCK), expected)


def test_independent_draws_do_not_depend_on_the_block(expected):
    assert same(run_campaign(draws, RUNS, seed=SEED, block=100), expected)


@pytest.mark.parametrize("workers", [1, 2, 8])
def test_threads_give_the_same_bits(workers, expected):
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        assert same(run_campaign(draws, RUNS, seed=SEED, block=BLOCK, executor=pool), expected)


@pytest.mark.parametrize("workers", [1, 2, 8])
def test_processes_give_the_same_bits(workers, expected):
    with worker_pool(workers) as pool:
        assert same(run_campaign(draws, RUNS, seed=SEED, block=BLOCK, executor=pool), expected)


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_dask_cluster_gives_the_same_bits(expected, tmp_path):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.run(sys.path.extend, sys.path)
        arrays = run_campaign(draws, RUNS, seed=SEED, block=BLOCK, executor=client.get_executor())
    assert same(arrays, expected)


def test_results_are_stored_and_read_back(tmp_path, expected):
    run_campaign(draws, RUNS, seed=SEED, block=BLOCK, out=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["campaign.json", "results.npz"]

    def never(seeds):
        raise AssertionError("a finished campaign is not computed again")

    assert same(run_campaign(never, RUNS, seed=SEED, block=BLOCK, out=tmp_path, resume=True), expected)


def test_exception_keeps_what_has_finished(tmp_path, expected):
    with pytest.raises(ZeroDivisionError):
        run_campaign(fails_late, RUNS, seed=SEED, block=BLOCK, out=tmp_path)
    assert len(list(tmp_path.glob("block-*.npz"))) == 3
    seen = []
    arrays = run_campaign(
        draws, RUNS, seed=SEED, block=BLOCK, out=tmp_path, resume=True, progress=lambda *p: seen.append(p)
    )
    assert same(arrays, expected)
    assert seen == [(12, 23), (16, 23), (20, 23), (23, 23)]


def test_exception_in_a_pool_keeps_what_has_finished(tmp_path):
    with concurrent.futures.ThreadPoolExecutor(2) as pool, pytest.raises(ZeroDivisionError):
        run_campaign(fails_late, RUNS, seed=SEED, block=BLOCK, out=tmp_path, executor=pool)
    assert not (tmp_path / "results.npz").exists()
    stored = {path.name for path in tmp_path.glob("block-*.npz")}
    assert stored <= {f"block-{start:08d}.npz" for start in (0, 4, 8)}
    assert stored


def test_death_of_a_worker_keeps_what_has_finished(tmp_path, expected):
    with worker_pool(1) as pool, pytest.raises(concurrent.futures.BrokenExecutor):
        run_campaign(dies_late, RUNS, seed=SEED, block=BLOCK, out=tmp_path, executor=pool)
    assert len(list(tmp_path.glob("block-*.npz"))) == 3
    assert same(run_campaign(draws, RUNS, seed=SEED, block=BLOCK, out=tmp_path, resume=True), expected)


def test_damaged_block_is_computed_again(tmp_path, expected):
    with pytest.raises(ZeroDivisionError):
        run_campaign(fails_late, RUNS, seed=SEED, block=BLOCK, out=tmp_path)
    block = tmp_path / "block-00000004.npz"
    block.write_bytes(block.read_bytes()[:100])
    assert same(run_campaign(draws, RUNS, seed=SEED, block=BLOCK, out=tmp_path, resume=True), expected)


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    subprocess.run([sys.executable, "-c", SLOW, str(folder)], check=True, timeout=60)
    return (folder / "results.npz").read_bytes()


@pytest.mark.parametrize("stop", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("blocks", [1, 7])
def test_killed_campaign_resumes_to_the_same_bytes(tmp_path, uninterrupted, stop, blocks):
    command = [sys.executable, "-c", SLOW, str(tmp_path)]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 30
    while len(list(tmp_path.glob("block-*.npz"))) < blocks:
        assert process.poll() is None, "the campaign ended before it could be stopped"
        assert time.monotonic() < deadline
        time.sleep(0.005)
    os.kill(process.pid, stop)
    assert process.wait(timeout=30) != 0
    kept = len(list(tmp_path.glob("block-*.npz")))
    assert blocks <= kept < 20
    assert not (tmp_path / "results.npz").exists()
    subprocess.run([*command, "resume"], check=True, timeout=60)
    assert (tmp_path / "results.npz").read_bytes() == uninterrupted


def test_folder_with_a_campaign_is_not_overwritten(tmp_path):
    run_campaign(draws, 4, out=tmp_path)
    before = (tmp_path / "results.npz").read_bytes()
    with pytest.raises(InvalidInputError, match="resume"):
        run_campaign(draws, 4, seed=1, out=tmp_path)
    assert (tmp_path / "results.npz").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"seed": 1}, "seed"),
        ({"runs": 5}, "runs"),
        ({"block": 3}, "block"),
        ({"describe": {"a": 2}}, "a 1 instead of 2"),
    ],
)
def test_another_campaign_is_not_resumed(tmp_path, change, name):
    run_campaign(draws, out=tmp_path, **{"runs": 4, "describe": {"a": 1}})
    with pytest.raises(InvalidInputError, match=name):
        run_campaign(draws, out=tmp_path, resume=True, **{"runs": 4, "describe": {"a": 1}, **change})


@pytest.mark.parametrize(
    "arguments", [{"runs": 0}, {"runs": 2.5}, {"runs": 2, "block": 0}, {"runs": 2, "seed": -1}]
)
def test_impossible_arguments(arguments):
    with pytest.raises(InvalidInputError):
        run_campaign(draws, **arguments)


def test_wrong_number_of_rows():
    with pytest.raises(InvalidInputError, match="one for each seed"):
        run_campaign(too_few_rows, 3)


def test_out_that_is_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInputError, match="out"):
        run_campaign(draws, 3, out=tmp_path / "file")


def test_progress_is_silent_without_a_terminal(capfd):
    run_campaign(draws, 3, progress=True)
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


class Terminal:
    """A standard error that claims to be a terminal."""

    encoding = "utf-8"

    def __init__(self):
        self.text = ""

    def isatty(self):
        return True

    def write(self, text):
        self.text += text
        return len(text)

    def flush(self):
        pass


def test_plain_progress_bar_without_rich(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setitem(sys.modules, "rich.console", None)
    run_campaign(draws, 4, block=2, progress=True)
    assert terminal.text.endswith("4/4 runs\n")
    assert "2/4 runs" in terminal.text


def test_rich_progress_bar(monkeypatch):
    pytest.importorskip("rich")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    run_campaign(draws, 4, block=2, progress=True)
    assert "runs" in terminal.text

"""Commands shown on a page run and print what is shown; functions, files and options a page names exist."""

import doctest
import importlib
import re
import shlex

import pytest

from losnav import scenarios
from losnav.cli import main
from tests.conftest import REPOSITORY
from tests.docs.test_examples import FLAGS, PAGES

ROOTS = [REPOSITORY / p for p in ("", "python/losnav", "rust/losnav-core/src", "rust/losnav-py/src")]
SUFFIXES = r"\.(?:py|pyi|rs|md|csv|png|toml|json|txt|npz)"
# Written by a command, into a folder the reader chooses.
MADE = {
    "landmarks.csv",
    "observations.csv",
    "mismatched.csv",
    "misnamed.csv",
    "claims.json",
    "claims.txt",
    "report.json",
    "results.npz",
}


def sessions(page):
    """``(command, what it prints)`` of all console blocks that have a prompt."""
    for block in re.findall(r"^```console\n(.*?)^```", page.read_text(encoding="utf-8"), flags=re.M | re.S):
        for part in re.split(r"^\$ ", block, flags=re.M)[1:]:
            command, _, shown = part.partition("\n")
            yield command, shown


SHOWN = [page for page in PAGES if any(True for _ in sessions(page))]


@pytest.mark.parametrize("page", SHOWN, ids=lambda p: str(p.relative_to(REPOSITORY)))
def test_sessions(page, tmp_path, monkeypatch, capsys):
    """``cat`` makes the file it shows, ``losnav`` prints what stands below it; all in one empty directory."""
    monkeypatch.chdir(tmp_path)
    ran = 0
    for command, shown in sessions(page):
        program, *arguments = shlex.split(command)
        if program == "cat":
            (tmp_path / arguments[0]).write_text(shown, encoding="utf-8")
            continue
        assert program == "losnav", f"{page.name}: cannot check {command!r}"
        main(arguments)
        printed = capsys.readouterr()
        got = printed.out + printed.err
        assert doctest.OutputChecker().check_output(shown, got, FLAGS), f"$ {command}\n{got}"
        ran += 1
    assert ran


def spans(page):
    """Code spans of a page, and the commands of blocks without a prompt."""
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```console\n(.*?)^```", text, flags=re.M | re.S)
    commands = [line.split("  #")[0].strip("$ ") for block in blocks for line in block.splitlines()]
    return re.findall(r"`([^`\n]+)`", re.sub(r"```.*?```", "", text, flags=re.S)) + [c for c in commands if c]


def exists(dotted):
    """Whether a dotted public name leads somewhere."""
    thing = importlib.import_module("losnav")
    for name in dotted.split(".")[1:]:
        if not hasattr(thing, name):
            try:
                importlib.import_module(f"{thing.__name__}.{name}")
            except (AttributeError, ImportError):
                return False
        thing = getattr(thing, name)
    return True


def options():
    """Everything ``losnav --help`` and its commands offer."""
    sources = (REPOSITORY / "python" / "losnav" / "cli").glob("*.py")
    return {o for s in sources for o in re.findall(r"--[a-z][a-z-]+", s.read_text(encoding="utf-8"))} | {
        "--help"
    }


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(REPOSITORY)))
def test_what_is_named_exists(page):
    rules = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    for span in spans(page):
        for dotted in re.findall(r"(?:^|[\s(])((?:losnav|ln)(?:\.[A-Za-z]\w*)+)", span):
            assert exists(dotted), f"{page.name}: {dotted}"
        for path in re.findall(
            rf"^[\w./-]+/[\w.-]+{SUFFIXES}$|^[\w-]+{SUFFIXES}$|^(?:tests|docs|rust|python)/[\w/]+$", span
        ):
            found = path in MADE or any((root / path).exists() for root in ROOTS)
            assert found, f"{page.name}: no file {path}"
        for target in re.findall(r"^make ([a-z-]+)", span):
            assert re.search(rf"^{target}:", rules, flags=re.M), f"{page.name}: make {target}"
        if span.startswith(("losnav ", "--")):
            for option in re.findall(r"--[a-z][a-z-]+", span):
                assert option in options(), f"{page.name}: {option}"


# Parameters that make a campaign quick and leave the statements of its claims alone.
QUICK = {
    "landmark-landing": {"sampling": 43.0, "cold_times": (0.0, 300.0)},
    "relative-navigation": {"approach_duration": 6000.0},
    "sun-line-of-sight": {"sampling": 36000.0},
    "small-body-landing": {
        "start_position": (60.0, -40.0, 300.0),
        "start_velocity": (-0.5, 0.4, -3.0),
        "duration": 60.0,
        "settled": 20.0,
        "outage_start": 20.0,
        "outage_duration": 30.0,
        "gravity_errors": (0.0, 1.0),
        "landmark_rings": 8.0,
    },
}


@pytest.mark.parametrize("name", scenarios.available())
def test_the_reproduction_page_is_of_these_claims(name):
    """Its statements and verdicts are those of the code; numbers of a small campaign differ."""
    text = (REPOSITORY / "docs" / "reproductions" / f"{name}.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| (\w+) \| \*\*([a-z ]+)\*\* \| (.+?) \|", text, flags=re.M)
    claims = scenarios.load(name, **QUICK.get(name, {})).run(runs=20, seed=1).claims()
    assert shown == [(c.number, c.established, c.statement) for c in claims]

"""Every example of the documentation runs and prints what it says."""

import doctest
import importlib
import pkgutil
import re

import numpy as np
import pytest

import losnav
from tests.conftest import REPOSITORY

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
PAGES = sorted([*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")])
PROMPTED = [p for p in PAGES if ">>>" in p.read_text(encoding="utf-8")]
MODULES = sorted(
    ["losnav"]
    + [
        m.name
        for m in pkgutil.walk_packages(losnav.__path__, "losnav.")
        if not m.name.rsplit(".", 1)[-1].startswith("_")
    ]
)


@pytest.fixture(autouse=True)
def printing():
    """Examples show arrays as NumPy prints them by default."""
    with np.printoptions():
        yield


def run(test):
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    report = []
    runner.run(test, out=report.append)
    assert not runner.failures, "".join(report)
    return runner.tries


@pytest.mark.parametrize("name", MODULES)
def test_docstrings(name):
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name and not error.name.startswith("losnav"):
            pytest.skip(f"{name} needs the optional package {error.name}")
        raise
    for test in doctest.DocTestFinder(exclude_empty=True).find(module, extraglobs={}):
        if test.examples:
            run(test)


def test_public_functions_have_runnable_examples():
    """The built-in ones included, whose docstrings live beside their Python signature."""
    without = []
    for name in losnav.__all__:
        thing = getattr(losnav, name)
        if callable(thing) and not isinstance(thing, type) and ">>>" not in (thing.__doc__ or ""):
            without.append(name)
    assert not without


@pytest.mark.parametrize("page", PROMPTED, ids=lambda p: str(p.relative_to(REPOSITORY)))
def test_pages(page, tmp_path, monkeypatch):
    """All prompts of a page in order, in one namespace and an empty directory."""
    monkeypatch.chdir(tmp_path)
    text = re.sub(r"^```.*$", "", page.read_text(encoding="utf-8"), flags=re.M)
    test = doctest.DocTestParser().get_doctest(text, {}, page.name, str(page), 0)
    assert run(test) > 0


def test_the_readme_has_an_example():
    assert REPOSITORY / "README.md" in PROMPTED


# --- links --------------------------------------------------------------------------------------------


def anchors(page):
    """GitHub's anchors of a page's headings."""
    found = set()
    for heading in re.findall(r"^#+\s+(.*)$", page.read_text(encoding="utf-8"), flags=re.M):
        plain = re.sub(r"[`*]|\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip().lower()
        found.add(re.sub(r"[^\w\- ]", "", plain).replace(" ", "-"))
    return found


def links(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    text = re.sub(r"`[^`\n]*`", "", text)
    return re.findall(r"!?\[[^\]]*\]\(([^)\s]+)\)", text)


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(REPOSITORY)))
def test_links_resolve(page):
    for link in links(page):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page.name}: {link}"
        if anchor and target.suffix == ".md":
            assert anchor in anchors(target), f"{page.name}: {link}"

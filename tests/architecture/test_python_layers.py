"""Python: imports only point down the layers; compat and scenarios are users of the public API."""

import ast

import pytest

from tests.conftest import REPOSITORY

PACKAGE = REPOSITORY / "python" / "losnav"
LAYERS = [
    {"errors", "_arrays", "_core", "constants"},
    {"attitude", "noise", "gravity", "navigation_state", "ephemeris", "sensors", "dynamics", "orbits"},
    {"pose", "attitude_determination", "star_tracker", "filters", "observability", "consistency", "landing"},
    {"scenarios", "campaign"},
    {"cli", "compat", "plotting"},
]
RANK = {module: rank for rank, layer in enumerate(LAYERS) for module in layer}
FILES = sorted(p for p in PACKAGE.rglob("*.py") if p != PACKAGE / "__init__.py")


def room(path):
    """Top-level module of the package a file belongs to; the figures of a scenario are plotting."""
    if path.name.endswith("figures.py"):
        return "plotting"
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path):
    """Absolute dotted names of everything of losnav that a file imports, anywhere in it."""
    package = ["losnav", *path.relative_to(PACKAGE).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.split(".")[0] == "losnav")
        elif isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            name = ".".join([*base, *([node.module] if node.module else [])])
            if name.split(".")[0] == "losnav":
                yield from (f"{name}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_down(path):
    here = room(path)
    assert here in RANK, f"{path.name} is in no layer"
    for name in imports(path):
        parts = name.split(".")
        if len(parts) > 1 and parts[1] in RANK:
            assert RANK[parts[1]] <= RANK[here], f"{path.relative_to(PACKAGE)} imports {name}"


@pytest.mark.parametrize(
    "path",
    [p for p in FILES if room(p) in {"compat", "scenarios"}],
    ids=lambda p: str(p.relative_to(PACKAGE)),
)
def test_compat_and_scenarios_use_the_public_api(path):
    for name in imports(path):
        private = [part for part in name.split(".") if part.startswith("_") and not part.startswith("__")]
        own = name.split(".")[1:2] == [path.relative_to(PACKAGE).parts[0]]
        assert own or not private, f"{path.relative_to(PACKAGE)} reaches for {name}"


COERCIONS = {"asarray", "array", "ascontiguousarray", "asanyarray", "require"}


def test_the_only_coercion_home():
    """Nobody but _arrays.py turns an argument into an array, below the scenario layer."""
    for path in FILES:
        if path.name == "_arrays.py" or RANK.get(room(path), 9) > 2:
            continue
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef) or function.name.startswith("_"):
                continue
            arguments = {a.arg for a in [*function.args.args, *function.args.kwonlyargs]}
            for node in ast.walk(function):
                if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
                    given = [a.id for a in node.args if isinstance(a, ast.Name)]
                    direct = node.func.attr in COERCIONS and arguments.intersection(given)
                    assert not direct, f"{path.name}: {function.name} coerces {given} itself"


def test_something_was_looked_at():
    assert {"errors", "attitude", "pose"} <= {room(p) for p in FILES}
    assert any("losnav" in name for p in FILES for name in imports(p))


def test_file_and_function_sizes():
    for path in FILES:
        text = path.read_text(encoding="utf-8")
        assert text.count("\n") <= 500, f"{path.relative_to(PACKAGE)} is too long"
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                documentation = ast.get_docstring(node) or ""
                length = node.end_lineno - node.lineno - documentation.count("\n")
                assert length < 60, f"{path.relative_to(PACKAGE)}: {node.name} has {length} lines"

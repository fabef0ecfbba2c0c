"""Rust: arrows only point down the layers, numpy and unsafe live where they may."""

import re

import pytest

from tests.conftest import REPOSITORY

CORE = REPOSITORY / "rust" / "losnav-core" / "src"
BINDINGS = REPOSITORY / "rust" / "losnav-py" / "src"
# error <- math <- models <- {estimators, analysis}; of the two siblings analysis may read the estimators'
# sinks (the information is the normal equations without a residual), never the other way.
LAYER = {"error": 0, "math": 1, "models": 2, "estimators": 3, "analysis": 4}
CORE_FILES = sorted(CORE.rglob("*.rs"))
BINDING_FILES = sorted(BINDINGS.rglob("*.rs"))


def code(path):
    """Source without comments and string literals."""
    text = path.read_text(encoding="utf-8")
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    text = re.sub(r'"(?:\\.|[^"\\])*"', '""', text)
    return re.sub(r"//[^\n]*", "", text)


def shipped(path):
    """Code of a file without its tests; nothing of a file of tests."""
    return "" if path.stem == "tests" else re.sub(r"#\[cfg\(test\)\].*", "", code(path), flags=re.S)


def module_path(path):
    """('estimators', 'minimal', 'p3p') of a file of the core."""
    parts = list(path.relative_to(CORE).with_suffix("").parts)
    return parts[:-1] if parts[-1] == "mod" else parts


def rooms_named(path):
    """Top-level modules of the core a file refers to, through ``crate::`` or chains of ``super::``."""
    text = code(path)
    rooms = set(re.findall(r"\bcrate::(\w+)", text))
    for group in re.findall(r"\bcrate::\{([^;]*)\}\s*;", text):
        depth, name = 0, ""
        for character in group + ",":
            depth += {"{": 1, "}": -1}.get(character, 0)
            if character == "," and depth == 0:
                rooms.add(name.strip().split("::")[0])
                name = ""
            else:
                name += character
    here = module_path(path)
    for chain, name in re.findall(r"\b((?:super::)+)(\w+)", text):
        climbed = here[: max(len(here) - chain.count("super"), 0)]
        rooms.add([*climbed, name][0])
    return rooms & set(LAYER)


@pytest.mark.parametrize("path", CORE_FILES, ids=lambda p: str(p.relative_to(CORE)))
def test_core_arrows_point_down(path):
    room = module_path(path)[0]
    if room == "lib":
        return
    assert room in LAYER, f"{path} is in no layer: error, math, models, estimators or analysis"
    for other in rooms_named(path) - {room}:
        assert LAYER[other] < LAYER[room], f"{path.relative_to(REPOSITORY)} ({room}) uses {other}"


def test_every_layer_is_inhabited_and_some_arrow_is_seen():
    """Guards the two tests above against looking in the wrong place."""
    assert {module_path(p)[0] for p in CORE_FILES} >= set(LAYER)
    assert any("math" in rooms_named(p) for p in CORE_FILES if module_path(p)[0] == "models")


def test_core_has_no_std_no_unsafe_no_heap():
    lib = (CORE / "lib.rs").read_text(encoding="utf-8")
    assert "#![no_std]" in lib
    assert "#![forbid(unsafe_code)]" in lib
    for path in CORE_FILES:
        text = shipped(path)
        assert not re.search(r"\bunsafe\b(?!_code)", text), path
        assert not re.search(r"\b(alloc|std)::(vec|boxed|string|collections)", text), path


def test_core_kernels_have_no_way_to_panic_by_name():
    """No unwrap, expect or panic outside tests; indices are proven by the embedded build."""
    for path in CORE_FILES:
        text = shipped(path)
        found = re.findall(r"\.(?:unwrap|expect)\(|\b(?:panic|todo|unimplemented|unreachable)!", text)
        assert not found, (path, found)


# Reading arrays, vector types, and calls into functions compiled for one instruction set.
UNSAFE = {"convert.rs", "lanes.rs", "dispatch.rs"}


@pytest.mark.parametrize("path", BINDING_FILES, ids=lambda p: p.name)
def test_only_convert_names_numpy(path):
    assert path.name == "convert.rs" or not re.search(r"\bnumpy\b", code(path)), f"{path.name} names numpy"


@pytest.mark.parametrize("path", BINDING_FILES, ids=lambda p: p.name)
def test_unsafe_stays_at_home_and_has_its_reason(path):
    """In three files only; each block under a SAFETY comment, or one reason in the file's head."""
    if path.name not in UNSAFE:
        assert not re.search(r"\bunsafe\b(?!_code|_op)", code(path)), f"{path.name} is unsafe"
        return
    lines = path.read_text(encoding="utf-8").splitlines()
    if any("`unsafe` because" in line for line in lines if line.startswith("//!")):
        return
    for number, line in enumerate(lines):
        if re.search(r"\bunsafe\s*\{", line.split("//")[0]):
            above = lines[max(number - 12, 0) : number + 1]
            assert any("SAFETY" in each for each in above), f"{path.name}:{number + 1} gives no reason"


def test_function_and_file_sizes():
    """Files beyond 500 lines want splitting (budget 400, with room for the tests inside)."""
    for path in CORE_FILES + BINDING_FILES:
        body = re.split(r"#\[cfg\(test\)\]", path.read_text(encoding="utf-8"))[0]
        assert body.count("\n") <= 500, f"{path.relative_to(REPOSITORY)} has {body.count(chr(10))} lines"

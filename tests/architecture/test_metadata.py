"""What the installed distribution promises."""

import importlib.metadata
import re

import losnav


def test_numpy_is_the_only_dependency_and_only_with_a_floor():
    requirements = importlib.metadata.requires("losnav") or []
    running = [r for r in requirements if "extra ==" not in r]
    assert len(running) == 1
    assert re.fullmatch(r"numpy\s*>=\s*[\d.]+", running[0].strip()), running


def test_version_and_typing():
    assert losnav.__version__ == importlib.metadata.version("losnav")
    names = {str(f).replace("\\", "/") for f in importlib.metadata.files("losnav") or []}
    installed = any(name.endswith("losnav/py.typed") for name in names)
    editable = any(name.endswith((".pth", "direct_url.json")) for name in names)
    assert installed or editable


def test_command_is_installed():
    scripts = importlib.metadata.entry_points(group="console_scripts")
    assert any(s.name == "losnav" and s.value == "losnav.cli:main" for s in scripts)


def test_python_floor():
    metadata = importlib.metadata.metadata("losnav")
    assert metadata["Requires-Python"] == ">=3.10"

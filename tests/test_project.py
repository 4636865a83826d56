"""What the project says of itself in several places is the same everywhere."""

import importlib
import pkgutil
import re
import tomllib
from pathlib import Path

import pytest

import tests.benchmarks

ROOT = Path(__file__).parents[1]


def test_version_and_licence_are_those_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = dict(re.findall(r"^(\w+): (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE))
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert (ROOT / "LICENSE").read_text(encoding="utf-8").startswith("BSD 3-Clause License")
    newest = re.search(r"^## (\S+)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert newest[1] == project["version"]


@pytest.mark.slow
def test_every_benchmark_finds_what_it_imports() -> None:
    """The tests run none of them. `peer_...` run in the environments of other programs."""
    for found in pkgutil.iter_modules(tests.benchmarks.__path__):
        if found.name.startswith("peer_"):
            continue
        module = importlib.import_module(f"tests.benchmarks.{found.name}")
        assert module.__doc__, found.name

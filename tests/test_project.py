"""What the project says of itself in several places is the same everywhere, and true."""

import importlib
import pkgutil
import re
import runpy
import tomllib
from pathlib import Path

import pytest

import tests.benchmarks
from solver.outcome import Outcome
from studies.fe_models.deck.read import HARMLESS, KEYWORDS
from studies.scenes import BUNDLED
from studyrunner.kinds.table import KINDS
from studyrunner.report.contents import all_figures
from studyrunner.study.sections import SECTIONS

ROOT = Path(__file__).parents[1]
PACKAGES = [ROOT / name for name in ("solver", "studies", "studyrunner")]
EQUATIONS = frozenset(range(1, 27))
"""Of the paper."""

_NUMBER = r"\((\d+)[a-d]?\)"
_CITATION = re.compile(rf"\bEqs?\.\s+{_NUMBER}(?:(?:\s*(?:,|-|to|and|or)\s*)+{_NUMBER})*")
_RANGE = re.compile(rf"{_NUMBER}\s*(?:-|to)\s*(?={_NUMBER})")


def page(name):
    return (ROOT / name).read_text(encoding="utf-8")


def test_version_and_licence_are_those_of_the_package():
    project = tomllib.loads(page("pyproject.toml"))["project"]
    citation = dict(re.findall(r"^(\w+): (.+)$", page("CITATION.cff"), re.MULTILINE))
    assert citation["version"] == project["version"]
    assert citation["license"] == project["license"]
    assert page("LICENSE").startswith("BSD 3-Clause License")
    assert re.search(r"^## (\S+)$", page("CHANGELOG.md"), re.MULTILINE)[1] == project["version"]


@pytest.mark.slow
def test_every_benchmark_finds_what_it_imports() -> None:
    """The tests run none of them. `peer_...` run in the environments of other programs."""
    for found in pkgutil.iter_modules(tests.benchmarks.__path__):
        if not found.name.startswith("peer_"):
            assert importlib.import_module(f"tests.benchmarks.{found.name}").__doc__, found.name


def test_every_benchmark_of_the_pages_is_there():
    pages = [*ROOT.glob("*.md"), *(path for package in PACKAGES for path in package.rglob("*.md"))]
    texts = [path.read_text(encoding="utf-8") for path in pages]
    named = {name for text in texts for name in re.findall(r"tests\.benchmarks\.(\w+)", text)}
    there = {found.name for found in pkgutil.iter_modules(tests.benchmarks.__path__)}
    assert named
    assert named <= there, f"there is no {named - there}"


def test_the_map_of_the_house_names_what_there_is():
    section = page("CONTRIBUTING.md").split("\n## Map of the house\n")[1].split("\n## ")[0]
    names = {path.name for package in PACKAGES for path in package.rglob("*")}
    names |= {"solver", "studies", "studyrunner", "tests"}
    said = set(re.findall(r"`(?:\w+/)*(\w+\.(?:py|md|js|css))`", section))
    folders = {name for path in re.findall(r"`((?:\w+/)+)", section) for name in path.strip("/").split("/")}
    assert said
    assert said | folders <= names, f"there is no {', '.join(sorted((said | folders) - names))}"
    rooms = [path for name in ("solver", "studyrunner") for path in (ROOT / name).iterdir() if path.is_dir()]
    assert {path.name for path in rooms} - {"__pycache__"} <= folders


def numbers_of(text):
    """Numbers in a list such as (7), (11)-(15) or (24) to (26), those between the ends of a range as well."""
    found = {int(number) for number in re.findall(_NUMBER, text)}
    for first, last in _RANGE.findall(text):
        found |= set(range(int(first), int(last) + 1))
    return found


def cited_in(path):
    """Numbers of the equations that docstrings and comments of a source file cite."""
    text = re.sub(r"\s*\n\s*#?\s*", " ", path.read_text(encoding="utf-8"))
    return set().union(*(numbers_of(citation[0]) for citation in _CITATION.finditer(text)))


def test_every_equation_of_the_paper_is_cited():
    assert set().union(*(cited_in(path) for path in PACKAGES[0].rglob("*.py"))) == EQUATIONS


def test_the_page_of_the_physics_says_where_each_equation_is():
    section = page("solver/PHYSICS.md").split("\n## 7. ")[1]
    rows = [line.split("|")[1:4] for line in section.splitlines() if line.startswith("| (")]
    said: set[int] = set()
    for numbers, _, places in rows:
        wanted = numbers_of(numbers)
        files = re.findall(r"`(\S+\.py)`", places)
        there = [cited_in(PACKAGES[0] / file) for file in files]
        assert all(wanted & found for found in there), f"one of {files} cites none of {sorted(wanted)}"
        assert wanted <= set().union(*there), f"equations {sorted(wanted)} in {files}"
        said |= wanted
    assert said == EQUATIONS


def test_the_reference_names_all():
    page = ROOT / "docs" / "reference.py"
    text = page.with_suffix(".md").read_text(encoding="utf-8")
    assert text == runpy.run_path(str(page))["reference"](), "make it again: .venv/bin/python docs/reference.py"
    names = {f"{table}.{key}" for table in ("study", "solver", "slow_time") for key in SECTIONS[table].model_fields}
    names |= {str(outcome) for outcome in Outcome} | {figure.name for figure in all_figures()} | set(BUNDLED)
    names |= {*KEYWORDS, *HARMLESS}.union(*(kind.variables for kind in KINDS.values()))
    assert [name for name in names if f"`{name}" not in text] == []

"""Which equations of the paper the solver cites, and whether the page of the physics says rightly where each one is."""

import io
import re
import tokenize
from pathlib import Path

import solver

FOLDER = Path(solver.__file__).parent
EQUATIONS = frozenset(range(1, 27))

NOT_CITED: dict[int, str] = {}
"""Equations that no docstring or comment of the solver cites, each with the reason why."""

_NUMBER = r"\((\d+)[a-d]?\)"
_CITATION = re.compile(rf"\bEqs?\.\s+{_NUMBER}(?:(?:\s*(?:,|-|to|and|or)\s*)+{_NUMBER})*")
_RANGE = re.compile(rf"{_NUMBER}\s*(?:-|to)\s*(?={_NUMBER})")


def cited_in(text):
    """Numbers of the equations that a text cites; those between the ends of a range as well."""
    found: set[int] = set()
    for citation in _CITATION.finditer(text):
        found |= numbers_of(citation[0])
    return found


def numbers_of(text):
    """Numbers in a list such as (7), (11)-(15) or (24) to (26)."""
    found = {int(number) for number in re.findall(_NUMBER, text)}
    for first, last in _RANGE.findall(text):
        found |= set(range(int(first), int(last) + 1))
    return found


def words_of(path):
    """Docstrings and comments of a source file, each as one line of text."""
    kinds = (tokenize.COMMENT, tokenize.STRING)
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    return "\n".join(" ".join(token.string.strip("#").split()) for token in tokens if token.type in kinds)


def test_every_equation_of_the_paper_is_cited_or_has_a_reason():
    cited = set().union(*(cited_in(words_of(path)) for path in FOLDER.rglob("*.py")))
    assert cited <= EQUATIONS
    assert EQUATIONS - cited == set(NOT_CITED), "equations that nothing cites"


def test_the_page_of_the_physics_says_where_each_equation_is():
    page = (FOLDER / "PHYSICS.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:4] for line in page.split("\n## 7. ")[1].splitlines() if line.startswith("| (")]
    told: set[int] = set()
    for numbers, _, places in rows:
        wanted = numbers_of(numbers)
        files = re.findall(r"`(\S+\.py)`", places)
        there = [cited_in(words_of(FOLDER / file)) for file in files]
        assert all(wanted & found for found in there), f"one of {files} cites none of {sorted(wanted)}"
        assert wanted <= set().union(*there), f"equations {sorted(wanted)} in {files}"
        told |= wanted
    assert told == EQUATIONS

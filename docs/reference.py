"""The reference: keys, scenes, variables, outcomes, figures and keywords of decks, from the tables of the program.

    .venv/bin/python docs/reference.py

writes the page `docs/reference.md`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from solver.outcome import Outcome
from studies.fe_models.deck.read import HARMLESS, KEYWORDS
from studies.fe_models.from_files.parameters import Parameters
from studies.scene import list_keys
from studies.scenes import BUNDLED, scene_help
from studyrunner.coordinates import COORDINATES, OF_SCENE, SCENE
from studyrunner.kinds.table import KINDS
from studyrunner.report.contents import all_figures
from studyrunner.study.keys import key_list
from studyrunner.summary.answer import ADVICE, OF_GIVEN_NUMBERS
from studyrunner.variables import Variable

HEAD = """# Reference

Keys of a study file, bundled scenes, variables, outcomes, figures and keywords of decks.
`.venv/bin/python docs/reference.py` makes this page from the tables of the program.
"""


def reference() -> str:
    """The page, Markdown: all lists, each under a heading of the second level."""
    of_scene = {**SCENE["exact"], **{name: each for name, each in OF_SCENE.items() if name not in COORDINATES}}
    sections = {
        "Keys of a study file": key_list(),
        "Bundled scenes": "\n\n".join("#" + scene_help(model) for model in BUNDLED),
        "Keys of finite-element models": list_keys(Parameters),
        **{f"Variables of {kind.words}": _variables(kind.variables) for kind in KINDS.values()},
        "Variables of the scene": _variables(of_scene),
        "Coordinates": _variables(COORDINATES),
        "Outcomes": _table(
            ("number", "outcome", "meaning", "what to do"),
            (
                (
                    f"{int(each)}",
                    f"`{each}`",
                    each.sentence,
                    ". ".join(filter(None, (ADVICE.get(each), OF_GIVEN_NUMBERS.get(each)))),
                )
                for each in Outcome
            ),
        ),
        "Figures of a report": _table(
            ("file", "shows", "how to read it"),
            (
                (f"`{each.name}`", each.title.format(slow="cycles", over="frequency"), each.caption)
                for each in all_figures()
            ),
        ),
        "Keywords of decks": _keywords(),
    }
    return "\n\n".join((HEAD.rstrip(), *(f"## {heading}\n\n{text}" for heading, text in sections.items()))) + "\n"


def _variables(variables: Mapping[str, Variable]) -> str:
    rows = (
        (f"`{name}`", each.units, ", ".join(each.dimensions), f"{each.long_name}. {each.comment}".rstrip())
        for name, each in variables.items()
    )
    return _table(("name", "unit", "dimensions after the axes", "meaning"), rows)


def _keywords() -> str:
    """Keywords that are read, with their parameters, and keywords that cannot change the model."""
    procedures = [name for name, each in KEYWORDS.items() if "*" in each.parameters]
    rows = (
        (f"`{name}`", " ".join(sorted(each.parameters)), " ".join(sorted(each.harmless)))
        for name, each in sorted(KEYWORDS.items())
        if name not in procedures
    )
    return "\n\n".join(
        (
            "Without blanks. Read as well: `*INCLUDE` with `INPUT`.",
            _table(("read", "parameters that are acted upon", "parameters that are skipped"), rows),
            f"Procedures, with any parameters: {_names(procedures)}.",
            f"Skipped: {_names(sorted(HARMLESS))}.",
        )
    )


def _names(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = (" | ".join(cell.replace("|", r"\|") for cell in row) for row in (heads, ("---",) * len(heads), *rows))
    return "\n".join(f"| {line} |" for line in lines)


if __name__ == "__main__":
    Path(__file__).with_suffix(".md").write_text(reference(), encoding="utf-8")

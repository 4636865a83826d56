"""The reference: keys, scenes, variables, outcomes, figures and keywords of decks, from the tables of the program.

    .venv/bin/python docs/reference.py

prints the page, Markdown. The HTML site has it as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from solver.outcome import Outcome
from studies.fe_models.deck.read import HARMLESS, KEYWORDS
from studies.fe_models.from_files.parameters import Parameters
from studies.scene import list_keys
from studies.scenes import BUNDLED, scene_help
from studyrunner.coordinates import COORDINATES, SCENE, STUCK_FREQUENCY
from studyrunner.report.contents import CAPTIONS, FIGURES
from studyrunner.study.keys import key_list
from studyrunner.variables import (
    ASKED,
    COUNTS,
    LOOPS,
    OF_A_HISTORY,
    OF_A_MISSION,
    OF_A_MODE_POINT,
    OF_MISSIONS,
    OF_MODES,
    Variable,
)


def reference() -> str:
    """All lists, Markdown, each under a heading of the second level."""
    wear = ASKED | COUNTS | LOOPS | OF_A_HISTORY | SCENE["exact"] | SCENE["natural_frequency"] | SCENE["mesh"]
    sections = {
        "Keys of a study file": key_list(),
        "Bundled scenes": "\n\n".join("#" + scene_help(model) for model in BUNDLED),
        "Keys of finite-element models": list_keys(Parameters),
        "Variables of wear histories": _variables(wear | {"stuck_frequency": STUCK_FREQUENCY}),
        "Variables of missions": _variables(OF_MISSIONS | OF_A_MISSION),
        "Variables of nonlinear modes": _variables(OF_MODES | OF_A_MODE_POINT),
        "Coordinates": _variables(COORDINATES),
        "Outcomes": _table(
            ("number", "outcome", "meaning"),
            ((f"{int(each)}", f"`{each}`", each.sentence) for each in Outcome),
        ),
        "Figures of a report": _table(
            ("file", "shows", "how to read it"),
            (
                (f"`{each.name}`", each.title.format(slow="cycles", over="frequency"), CAPTIONS.get(each.name, ""))
                for each in FIGURES
            ),
        ),
        "Keywords of decks": _keywords(),
    }
    return "\n\n".join(f"## {heading}\n\n{text}" for heading, text in sections.items()) + "\n"


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
    print("# Reference\n\n" + reference(), end="")

"""The lists of variables on the page of the result file are those of the tables.

`python -m tests.studyrunner.test_result_page` writes them again.
"""

from pathlib import Path

from studyrunner.coordinates import SCENE, STUCK_FREQUENCY
from studyrunner.variables import ASKED, COUNTS, KEPT, LOOPS, OF_A_MISSION, OF_A_MODE_POINT, OF_MISSIONS, OF_MODES

PAGE = Path(__file__).parents[2] / "studyrunner/RESULT_FILE.md"
OF_SCENE = SCENE["exact"] | SCENE["natural_frequency"] | {"stuck_frequency": STUCK_FREQUENCY}
WEAR = ASKED | COUNTS | LOOPS | KEPT | OF_SCENE
LISTS = {"wear": WEAR, "missions": OF_MISSIONS | OF_A_MISSION, "modes": OF_MODES | OF_A_MODE_POINT}


def listed(variables, known):
    """A line for each set of dimensions, and one for what is as in `known`; errors of variables are not named."""
    errors = {f"{name}_error" for name in variables}
    lines = {}
    for name, entry in variables.items():
        like = known.get(name.removesuffix("_begin"))
        if name in errors:
            continue
        when = entry.long_name.removeprefix(like.long_name) if like is not None else entry.long_name
        if when == "" or when.startswith(" "):
            lines.setdefault(f"as above{when}", []).append(f"`{name}`")
        else:
            unit = "" if entry.units == "1" or entry.is_text else f" ({entry.units})"
            lines.setdefault(", ".join(entry.dimensions) or "point", []).append(f"`{name}`{unit}: {entry.long_name}")
    return "\n".join(f"- **{of}**: {'; '.join(entries)}." for of, entries in lines.items())


def page_with_lists(text):
    """The page, with the lists between their marks made from the tables."""
    for name, variables in LISTS.items():
        before, rest = text.split(f"<!-- variables: {name} -->\n")
        after = rest[rest.index("<!-- end -->") :]
        text = f"{before}<!-- variables: {name} -->\n{listed(variables, {} if name == 'wear' else WEAR)}\n{after}"
    return text


def test_the_lists_are_those_of_the_tables():
    text = PAGE.read_text(encoding="utf-8")
    assert page_with_lists(text) == text


if __name__ == "__main__":
    PAGE.write_text(page_with_lists(PAGE.read_text(encoding="utf-8")), encoding="utf-8")

"""The reference has what the tables of the program have."""

import runpy
from pathlib import Path

from solver.outcome import Outcome
from studies.fe_models.deck.read import HARMLESS, KEYWORDS
from studies.scenes import BUNDLED
from studyrunner.report.contents import FIGURES
from studyrunner.study.sections import SECTIONS
from studyrunner.variables import ASKED, OF_A_HISTORY, OF_A_MISSION, OF_MISSIONS, OF_MODES

PAGE = Path(__file__).parents[1] / "docs" / "reference.py"


def test_the_reference_names_all():
    text = runpy.run_path(str(PAGE))["reference"]()
    names = {f"{table}.{key}" for table in ("study", "solver", "slow_time") for key in SECTIONS[table].model_fields}
    names |= {str(outcome) for outcome in Outcome} | {figure.name for figure in FIGURES} | set(BUNDLED)
    names |= {*ASKED, *OF_A_HISTORY, *OF_MODES, *OF_MISSIONS, *OF_A_MISSION, *KEYWORDS, *HARMLESS}
    assert [name for name in names if f"`{name}" not in text] == []
    assert len({figure.name for figure in FIGURES}) == len(FIGURES)

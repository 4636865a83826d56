"""Messages of the solver name keys as a study has them: a user of `run-study` has no arguments in Python."""

import ast
import re
from pathlib import Path

from pydantic import BaseModel

import solver
from solver.outcome import Outcome
from studyrunner.advice import Used, advise
from studyrunner.mission_variables import OF_A_MISSION, OF_MISSIONS
from studyrunner.mode_variables import OF_A_MODE_POINT, OF_MODES
from studyrunner.study.sections import LoadingSection
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, KEPT

_ROOMS = Path(next(iter(solver.__path__)))
_NAMED = re.compile(r"\b([a-z_.]+) = |\b([a-z]+(?:_[a-z]+)+(?:\.[a-z_]+)?)\b")
"""A key with a value, or any name of two words or more."""
_OF_SCENES = {"friction_coefficient", "half_width"}


def keys_of_a_study():
    """Keys of all tables, alone and with the name of their table, and variables of results."""
    found = {*ASKED, *KEPT, *OF_MODES, *OF_A_MODE_POINT, *OF_MISSIONS, *OF_A_MISSION, *_OF_SCENES}
    for name, field in {**Study.model_fields, "loading": LoadingSection.model_fields}.items():
        annotation = LoadingSection if name == "loading" else field.annotation
        if isinstance(annotation, type) and issubclass(annotation, BaseModel):
            found |= {*annotation.model_fields, *(f"{name}.{key}" for key in annotation.model_fields)}
    return found


def messages(path):
    """Texts with blanks in a module but for its docstrings, values in them as {}."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            child.inside = node
    for node in ast.walk(tree):
        inside = getattr(node, "inside", None)
        if isinstance(inside, ast.Expr | ast.JoinedStr):
            continue
        if isinstance(node, ast.JoinedStr):
            text = "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
        else:
            continue
        if " " in text:
            yield text


def named_in(text):
    return {one or other for one, other in _NAMED.findall(text)}


def test_messages_of_the_solver_name_keys_of_a_study():
    # modules beside the rooms are called from Python, and their messages are about arguments
    paths = [*(path for path in _ROOMS.glob("*/**/*.py") if path.parent != _ROOMS), _ROOMS / "outcome.py"]
    keys, wrong = keys_of_a_study(), {}
    for path in paths:
        for text in messages(path):
            if unknown := named_in(text) - keys:
                wrong[text] = unknown
    assert wrong == {}


def test_advice_names_keys_of_a_study():
    keys = keys_of_a_study()
    for outcome in Outcome:
        for used in (Used("explicit", "up"), Used("adaptive", "down", 3, 64), Used("final", "ramp", by_depth=True)):
            text = advise(outcome.meaning, used)
            assert named_in(text) <= keys, text
    assert "solver.time_limit" in advise("time_limit", Used("adaptive", "up"))

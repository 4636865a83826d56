"""Tuning constants: frozen, one instance a room, one meaning a name, each with what it is and why."""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import re
from itertools import pairwise
from pathlib import Path

import pytest

import solver
from tests.solver.option_fields import all_options

ROOT = Path(solver.__file__).parent
ROOMS = sorted(path.parent.name for path in ROOT.glob("*/options.py"))


def instance(room: str) -> object:
    """The one instance in the options of a room."""
    module = importlib.import_module(f"solver.{room}.options")
    (found,) = (value for name, value in vars(module).items() if name.isupper() and dataclasses.is_dataclass(value))
    return found


@pytest.mark.slow
@pytest.mark.parametrize("room", ROOMS)
def test_every_option_is_used_in_a_line_of_code(room: str) -> None:
    code = "".join(path.read_text() for path in ROOT.rglob("*.py"))
    for field in dataclasses.fields(instance(room)):  # type: ignore[arg-type]
        assert re.search(rf"\b([A-Z_]+|self)\.{field.name}\b", code), field.name


@pytest.mark.parametrize("name", sorted(all_options()))
def test_every_option_says_what_it_is(name: str) -> None:
    options = all_options()[name]
    body = ast.parse(inspect.getsource(type(options))).body[0].body  # type: ignore[attr-defined]
    said = {
        before.target.id
        for before, after in pairwise(body)
        if isinstance(before, ast.AnnAssign)
        and isinstance(after, ast.Expr)
        and isinstance(after.value, ast.Constant)
        and len(str(after.value.value)) > 10
    }
    assert {field.name for field in dataclasses.fields(options)} - said == set()

"""The page of bundled scenes is what the scenes say, and the command prints the same."""

import re
from pathlib import Path

import pytest

from studies.scene_help import all_scenes, scene_help
from studies.scenes import BUNDLED, scene_parameters
from studyrunner.cli import main

PAGE = Path(__file__).parents[2] / "studies" / "SCENES.md"


def test_the_page_is_what_the_scenes_say():
    assert PAGE.read_text(encoding="utf-8") == all_scenes(), "python -m studies.scene_help > studies/SCENES.md"


@pytest.mark.parametrize("model", BUNDLED)
def test_every_parameter_has_a_row_with_its_default(model):
    rows = re.findall(r"^- `(\w+)(?: = ([^`]+))?`: (.*)$", scene_help(model), re.M)
    fields = scene_parameters(model).model_fields
    assert [name for name, _, _ in rows] == list(fields)
    for (_, default, meaning), field in zip(rows, fields.values(), strict=True):
        assert field.description.startswith(meaning)
        if isinstance(field.default, float):
            assert float(default) == field.default


def test_the_command_prints_one_scene(capsys):
    assert main(["--scene-help", "two_masses"]) == 0
    assert capsys.readouterr().out == scene_help("two_masses") + "\n"


def test_an_unknown_scene_names_those_that_there_are(capsys):
    assert main(["--scene-help", "two_mases"]) == 2
    told = capsys.readouterr().err
    assert "two_mases" in told
    assert "dovetail_sector" in told
    assert len(told.splitlines()) == 1

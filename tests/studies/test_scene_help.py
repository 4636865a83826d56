"""The page of bundled scenes is what the scenes say, and the command prints the same."""

from pathlib import Path

from studies.scene_help import all_scenes, scene_help
from studyrunner.cli import main

PAGE = Path(__file__).parents[2] / "studies" / "SCENES.md"


def test_the_page_is_what_the_scenes_say():
    assert PAGE.read_text(encoding="utf-8") == all_scenes(), "python -m studies.scene_help > studies/SCENES.md"


def test_the_command_prints_one_scene(capsys):
    assert main(["--scene-help", "two_masses"]) == 0
    assert capsys.readouterr().out == scene_help("two_masses") + "\n"

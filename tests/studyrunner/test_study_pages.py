"""Pages on studies: every example is read, and complete ones are planned."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.study.study_file import format_study, read_study
from studyrunner.study.toml_text import format_toml, read_toml
from tests.studies.fe_models.decks import SECTOR

ROOT = Path(__file__).parents[2]
PAGES = [path for path in ROOT.rglob("*.md") if ".venv" not in path.parts and "```toml" in path.read_text("utf-8")]
EXAMPLES = [
    pytest.param(text, id=f"{page.stem}-{number}", marks=[pytest.mark.slow] * ("[study]" in text))
    for page in sorted(PAGES)
    for number, text in enumerate(re.findall(r"^```toml\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S))
]


@pytest.fixture
def files(folder):
    """What the examples name: a result, a scene file, decks, reduced matrices."""
    depth = np.zeros((1, 1, 4, 24))
    coordinates = {"frequency": [211.5], "scheme": ["adaptive"], "cycle": [0.0, 1e4, 5e4, 1e5]}
    result = xr.Dataset({"wear_depth": (("frequency", "scheme", "cycle", "contact"), depth)}, coordinates)
    result.to_netcdf(folder / "dovetail.nc")
    assert main(["sdof_slider", "--write-scene", "my_root.h5"]) == 0
    shutil.copy(SECTOR, "sector.inp")
    shutil.copy(ROOT / "studies" / "blade_root.inp", "blade_root.inp")
    for name in ("nodes.csv", "blade.pch", "stress.csv"):
        Path(name).touch()


@pytest.mark.parametrize("text", EXAMPLES)
def test_every_example_is_a_study(text, files, capsys):
    table = read_toml(text.encode(), "page")
    complete = {"study", "scene"} <= table.keys() and table.keys() & {"axes", "mission"}
    given = {"study": {"name": "s"}, "scene": {"model": "dovetail_sector"}, "axes": {}}
    whole = table if complete else {**given, **table}
    whole["scene"].setdefault("model", "dovetail_sector")
    if not complete and "modal_amplitude" not in whole["axes"]:
        whole["axes"].setdefault("frequency", 211.5)
    if whole["scene"]["model"] == "sector.inp":
        # the names of the page are those of any deck
        whole["scene"].pop("friction_coefficient")
    Path("s.toml").write_text(format_toml(whole), encoding="utf-8")
    study = read_study("s.toml")
    assert study.dimensions
    if complete:
        Path("s.toml").write_text(text, encoding="utf-8")
        assert main(["s.toml", "--plan"]) == 0
        assert "points" in capsys.readouterr().out


def test_a_new_study_is_planned_and_its_comments_are_its_defaults(folder, capsys):
    assert main(["--new", "wear"]) == 0
    text = Path("wear.toml").read_text("utf-8")
    study = read_study("wear.toml")
    assert study.study.name == "wear"
    assert main(["wear.toml", "--plan"]) == 0
    capsys.readouterr()
    body, _, scatter = text.partition("# [scatter]")
    shown = re.sub(r"^# (\w+ = )", r"\1", body, flags=re.M)
    assert len(read_toml(shown.encode(), "")["solver"]) == 5
    Path("shown.toml").write_text(shown, encoding="utf-8")
    assert format_study(read_study("shown.toml")) == format_study(study)
    Path("scatter.toml").write_text(body + ("[scatter]" + scatter).replace("\n# ", "\n"), encoding="utf-8")
    assert read_study("scatter.toml").dimensions["sample"] == tuple(range(16))
    shutil.copy(SECTOR, "sector.inp")
    assert main(["--new", "root", "--from", "sector.inp"]) == 0
    assert read_study("root.toml").axes.frequency_ratio == (0.99, 1.0)
    assert main(["root.toml", "--plan"]) == 0
    assert main(["--new", "none", "--from", "none.inp"]) == 2
    assert "none.inp: model: none.inp: there is no such file" in capsys.readouterr().err
    for name, words in (("wear", "there is such a file"), ("a/b", "without a slash")):
        assert main(["--new", name]) == 2
        assert re.fullmatch(f'run-study: command line: --new = "{name}": .*{words}.*\n', capsys.readouterr().err)

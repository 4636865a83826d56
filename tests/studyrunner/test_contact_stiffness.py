"""`contact_stiffness` in studies: of bundled scenes, scene files and decks, as an axis, and run again from a result."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from solver import with_contact_stiffness
from studies import build_scene, read_scene
from studies.fe_models.from_files import scene as scene_of_files
from studies.scene_answers import stuck_frequencies
from studyrunner.cli import main
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.study.study_file import read_study
from studyrunner.user_error import UserError
from tests.studies.fe_models.decks import SECTOR
from tests.studyrunner.test_model_studies import STUDY as SECTOR_STUDY
from tests.studyrunner.test_scene_axes import CHEAP, compute, same_values

pytestmark = pytest.mark.usefixtures("folder")
SOFT = (1e11, 1e13)


def digest(study, *overrides):
    return describe_scene(build_study_scene(read_study(study, overrides))).digest


@pytest.mark.slow
def test_a_scene_file_holds_the_springs_or_gets_them_from_the_study(folder):
    rigid, soft = build_scene("sdof_slider"), build_scene("sdof_slider", contact_stiffness=SOFT[0])
    assert main(["sdof_slider", "--set", f"scene.contact_stiffness={SOFT[0]}", "--write-scene", "soft.h5"]) == 0
    assert main(["sdof_slider", "--write-scene", "rigid.h5"]) == 0
    np.testing.assert_array_equal(read_scene("soft.h5").linear[0].stiffness, soft.linear[0].stiffness)
    for name in ("rigid", "soft"):
        text = Path(read_study("sdof_slider").folder, "sdof_slider.toml").read_text(encoding="utf-8")
        head, rest = text.split("[scene]", 1)
        table = f'[scene]\nmodel = "{name}.h5"\nfriction_coefficient = 0.5\n'
        (folder / f"{name}.toml").write_text(head + table + rest[rest.index("\n[") :], encoding="utf-8")
    own = f"scene.contact_stiffness={SOFT[0]}"
    expected = describe_scene(soft).digest
    assert digest("rigid.toml", own) == digest("soft.toml") == expected != describe_scene(rigid).digest
    variables = "outputs.variables=['default']"
    first = compute("rigid.toml", "first.nc", *CHEAP, variables, own)
    # the result holds the scene with its springs, which are not added once more
    same_values(first, compute("first.nc", "again.nc"))
    with pytest.raises(UserError, match=r"scene.contact_stiffness = 10+\.0: leave it out: the result holds"):
        read_study("first.nc", [f"scene.contact_stiffness={SOFT[1]}"])
    one_value = compute("rigid.toml", "axis.nc", *CHEAP, variables, f"axes.contact_stiffness=[{SOFT[0]}]")
    same_values(one_value, compute("axis.nc", "again.nc"))
    same_values(one_value.squeeze("contact_stiffness"), first)


def test_a_deck_is_reduced_once_for_all_contact_stiffnesses(folder, monkeypatch):
    shutil.copy(SECTOR, folder / "sector.inp")
    (folder / "wear.toml").write_text(SECTOR_STUDY)
    reduced, reduce = [], scene_of_files.reduce_model
    monkeypatch.setattr(scene_of_files, "reduce_model", lambda *given: reduced.append(given) or reduce(*given))
    first, second = (build_study_scene(read_study("wear.toml", [f"scene.contact_stiffness={k}"])) for k in SOFT)
    assert len(reduced) == 1
    rigid = build_study_scene(read_study("wear.toml"))
    assert len(reduced) == 2
    lowest = [stuck_frequencies(model).frequencies[0, 0] for model in (first, second, rigid)]
    assert lowest == sorted(lowest)
    expected = describe_scene(with_contact_stiffness(rigid, SOFT[0])).digest
    assert describe_scene(first).digest == expected
    # another deck under the same name is another model
    (folder / "sector.inp").write_text((folder / "sector.inp").read_text().replace("*DENSITY\n7800", "*DENSITY\n7801"))
    assert digest("wear.toml", f"scene.contact_stiffness={SOFT[0]}") != expected

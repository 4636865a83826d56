"""What takes long is computed once: a later run takes it from the file, equal to the last bit."""

import numpy as np
import pytest

from solver.packing import Packed, pack
from studies.scenes import sector
from studyrunner.scene import computed as computed_module
from studyrunner.scene import scene as scene_module
from studyrunner.scene.computed import InMemory
from studyrunner.scene.scene import _parts, build_study_scene, describe_scene, write_study_scene
from studyrunner.study.study_file import read_study

SCENES: dict[str, tuple[str, list[str]]] = {
    "sector": ("dovetail", ["scene.mesh=1"]),
    "travelling wave": ("dovetail", ["scene.mesh=1", "scene.nodal_diameter=3"]),
    "finite-element model": ("blade_root", []),
    "masses": ("two_masses", []),
}


@pytest.fixture(autouse=True)
def keep_all(monkeypatch):
    """What takes no time is kept as well."""
    monkeypatch.setattr(computed_module, "LEAST_SECONDS", -1.0)


def forbid(monkeypatch):
    """From now on nothing is computed."""

    def compute(*_):
        raise AssertionError("computed again")

    monkeypatch.setattr(scene_module, "_build_here", compute)
    monkeypatch.setattr(sector, "prepare_model", compute)


def memory(model):
    """All that the last bits of a result depend on."""
    arrays = [(name, np.asarray(value)) for name, value in _parts(model)]
    return [(name, a.dtype.str, a.shape, a.strides, a.flags.c_contiguous, a.tobytes()) for name, a in arrays]


@pytest.mark.slow
@pytest.mark.parametrize("case", SCENES)
def test_a_scene_is_built_once(case, monkeypatch):
    study, kept = read_study(*SCENES[case]), InMemory()
    built = build_study_scene(study, computed=kept)
    forbid(monkeypatch)
    again = build_study_scene(read_study(*SCENES[case]), computed=kept)
    assert memory(again) == memory(built)
    assert list(again.linear) == list(built.linear)
    assert describe_scene(again).digest == describe_scene(built).digest
    assert type(again.contact.surface) is type(built.contact.surface)


def key_of(study):
    return {computed_module.model_key(study)}


def test_a_changed_file_or_source_makes_another_scene(tmp_path, monkeypatch):
    before = key_of(read_study("blade_root"))
    from studies.fe_models.from_files import scene as from_files

    monkeypatch.setattr(from_files, "file_digest", lambda _: "of another file")
    assert key_of(read_study("blade_root")) != before
    monkeypatch.undo()
    assert key_of(read_study("blade_root")) == before
    monkeypatch.setattr(computed_module, "package_digest", lambda package: f"another {package}")
    assert key_of(read_study("blade_root")) != before


def test_a_changed_scene_file_makes_another_scene(tmp_path):
    study = tmp_path / "of_file.toml"
    tables = '[study]\nname = "s"\n[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n[axes]\nfrequency = 1\n'
    study.write_text(f"{tables}contact_stiffness = [1e9, 1e10]\n")
    keys = []
    for mass in (1.0, 2.0):
        write_study_scene(read_study("two_masses", {"scene.mass_1": mass}), tmp_path / "scene.h5")
        keys += [computed_module.model_key(variant) for variant in read_study(study).variants]
    assert len(set(keys)) == 4


@pytest.mark.parametrize("wrong", [Packed("{", ()), pack(None), pack((1, 2)), pack(((0, 1), "model"))])
def test_what_is_no_model_is_built_again(wrong):
    study, kept = read_study("two_masses"), InMemory()
    built = build_study_scene(study, computed=kept)
    (key,) = kept
    kept[key] = wrong
    assert memory(build_study_scene(study, computed=kept)) == memory(built)
    assert kept[key] is not wrong

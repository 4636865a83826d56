"""The model of a study: computed once; its harmonics and pairs; a scene file, and a result, are each enough."""

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from solver.model import ContactInterface, needed_nodal_diameters
from solver.packing import Packed, pack, unpack_model
from studies import build_scene, read_scene, scene_file
from studies.fe_models.from_files import model as from_files
from studies.scene_file import read_description, read_mesh, write_scene
from studies.scene_source import Bundled
from studyrunner.cli import main
from studyrunner.coordinates import COORDINATES
from studyrunner.result import provenance
from studyrunner.scene import scene as scene_room
from studyrunner.scene.answers import write_study_scene
from studyrunner.scene.scene import build_study_scene, describe_scene, edge_pairs, largest_harmonics
from studyrunner.scene_building import SceneTask, build_scene_task
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from tests.mpi.launching import options, results
from tests.studies.scene_models import bits, plain, sector
from tests.studyrunner.small_studies import CHEAP, SLIDER, compute, same_values

pytestmark = pytest.mark.usefixtures("folder")


def digest_of(study, *overrides):
    return describe_scene(build_study_scene(read_study(study, overrides))).digest


# --- computed once ---

SCENES = {
    "sector": ("dovetail", ["scene.mesh=1"]),
    "travelling wave": ("dovetail", ["scene.mesh=1", "scene.nodal_diameter=3"]),
    "finite-element model": ("blade_root", []),
    "several responses on soft pairs": ("two_masses", ["scene.contact_stiffness=1e9"]),
}


def build(study, known=None):
    (built,) = build_scene_task(SceneTask(0, study, known), lambda _: None)
    return built


@pytest.mark.slow
@pytest.mark.parametrize("case", SCENES)
def test_a_model_is_built_once(case, monkeypatch):
    study = read_study(*SCENES[case])
    model, first = build_study_scene(study), build(study)
    again = unpack_model(first.model)
    assert bits(again) == bits(model)
    assert type(again.contact.surface) is type(model.contact.surface)
    monkeypatch.setattr(type(study.scene.source), "_build", pytest.fail)
    second = build(study, first.model)
    assert second.model is None
    assert second.facts.digest == first.facts.digest == describe_scene(model).digest


def test_a_changed_file_or_source_makes_another_scene(monkeypatch):
    def key():
        return {scene_room.model_key(read_study("blade_root"))}

    before = key()
    with monkeypatch.context() as changed:
        changed.setattr(from_files, "file_digest", lambda _: "of another file")
        assert key() != before
    assert key() == before
    monkeypatch.setattr(scene_room, "package_digest", lambda package: f"another {package}")
    assert key() != before


def test_a_changed_scene_file_makes_another_scene(monkeypatch):
    tables = '[study]\nname = "s"\n[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n[axes]\nfrequency = 1\n'
    Path("s.toml").write_text(f"{tables}contact_stiffness = [1e9, 1e10]\n")
    keys, opened, read = [], [], scene_file.read_mesh
    # once for all variants: a large file takes a hundredth of a second
    monkeypatch.setattr(scene_file, "read_mesh", lambda *place: opened.append(place) or read(*place))
    for mass in (1.0, 2.0):
        write_study_scene(read_study("two_masses", {"scene.mass_1": mass}), Path("scene.h5"), print)
        keys += [scene_room.model_key(variant) for variant in read_study("s.toml").variants]
    assert (len(set(keys)), len(opened)) == (4, 2)


@pytest.mark.parametrize("wrong", [Packed("{", ()), pack(None), pack(((0, 1), "model"))])
def test_what_is_no_model_is_built_again(wrong):
    study = read_study("two_masses")
    assert bits(unpack_model(build(study, wrong).model)) == bits(build_study_scene(study))


# --- in a scene file ---


@pytest.mark.slow
def test_a_scene_file_holds_the_contact_stiffness_or_gets_it_from_the_study():
    rigid, soft = (build_scene("sdof_slider", **given) for given in ({}, {"contact_stiffness": 1e11}))
    own = "scene.contact_stiffness=1e11"
    for name, given in (("soft", options(own)), ("rigid", [])):
        assert main(["sdof_slider", *given, "--write-scene", f"{name}.h5"]) == 0
        study = SLIDER.replace('"sdof_slider"', f'"{name}.h5"\nfriction_coefficient = 0.5')
        Path(f"{name}.toml").write_text(study, encoding="utf-8")
    np.testing.assert_array_equal(read_scene("soft.h5").linear[0].stiffness, soft.linear[0].stiffness)
    expected = describe_scene(soft).digest
    assert digest_of("rigid.toml", own) == digest_of("soft.toml") == expected != describe_scene(rigid).digest
    first = compute("rigid.toml", "first.nc", *CHEAP, own)
    # the result holds the scene with its springs, which are not added once more
    same_values(first, compute("first.nc", "again.nc"))
    with pytest.raises(UserError, match=r"scene.contact_stiffness = 10+\.0: "):
        read_study("first.nc", ["scene.contact_stiffness=1e13"])
    one_value = compute("rigid.toml", "axis.nc", *CHEAP, "axes.contact_stiffness=[1e11]")
    same_values(one_value, compute("axis.nc", "again.nc"))
    same_values(one_value.squeeze("contact_stiffness"), first)


def test_a_scene_file_gives_each_pair_its_friction_coefficient():
    contact = replace(plain().contact, friction_coefficient=np.array([0.2, 0.3, 0.4]))
    write_scene(replace(plain(), contact=contact), Path("rough.h5"))
    Path("s.toml").write_text(SLIDER.replace("sdof_slider", "rough.h5"), encoding="utf-8")
    study = read_study("s.toml")
    assert study.friction_coefficient is None
    assert build_study_scene(study).contact.friction_coefficient.tolist() == [0.2, 0.3, 0.4]
    assert "friction_coefficient" not in format_study(study)
    write_study_scene(study, Path("again.h5"), print)
    assert digest_of("s.toml", "scene.model=again.h5") == digest_of("s.toml")


@pytest.mark.parametrize("n_harmonics", [1, 2, 5])
def test_nodal_diameters_in_a_scene_file_bound_automatic_harmonics(n_harmonics, capsys):
    wave = replace(sector(), n_sectors=47, nodal_diameter=4)
    standing, travelling = wave.linear.values()
    needed = needed_nodal_diameters(4, 47, n_harmonics)
    scene = replace(wave, linear={k: standing if k == 0 else travelling for k in needed})
    assert largest_harmonics(scene) == n_harmonics
    write_scene(scene, Path("wave.h5"))
    text = SLIDER.replace('"sdof_slider"', '"wave.h5"\nfriction_coefficient = 0.3').replace("= 5", '= "auto"')
    Path("s.toml").write_text(text, encoding="utf-8")
    assert main(["s.toml", "--plan"]) == 0
    assert f"harmonics automatic (at most {n_harmonics}, for which" in capsys.readouterr().out


# --- pairs at the edge of a surface ---


def contact_in_a_plane(x, y):
    """Pairs at these places of a plane that lies anywhere in space."""
    axes, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    position = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3) @ axes + [0.3, -2.0, 0.1]
    n = len(position)
    dofs = np.stack([np.arange(n), np.full(n, -1), np.full(n, -1)], axis=1)
    return ContactInterface(dofs, np.ones(n), np.zeros(n), np.zeros(n), position, ("",) * n)


@pytest.mark.parametrize("side", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("skew", [0.0, 1.0])
def test_a_structured_mesh_has_the_edge_of_its_rows_and_columns(side, skew):
    i, j = np.meshgrid(np.arange(9.0), np.arange(5.0), indexing="ij")
    expected = (i == 0) | (i == 8) | (j == 0) | (j == 4)
    # round-off of a mesh of one's own leaves no edge straight
    noise = 1e-9 * np.random.default_rng(1).normal(size=i.shape)
    assert edge_pairs(contact_in_a_plane(i + skew * j + noise, side * j)).tolist() == expected.ravel().tolist()


def test_an_unstructured_mesh_has_its_edge_and_its_hole():
    random, kept = np.random.default_rng(0), []
    for place in random.random((1500, 2)):
        if all(np.hypot(*(place - other)) > 0.04 for other in kept) and np.hypot(*(place - 0.5)) > 0.2:
            kept.append(place)
    x, y = np.array(kept).T
    found = edge_pairs(contact_in_a_plane(x, y))
    from_side = np.minimum(np.minimum(x, 1.0 - x), np.minimum(y, 1.0 - y))
    from_hole = np.hypot(x - 0.5, y - 0.5) - 0.2
    assert found[from_side < 0.01].all()
    assert found[from_hole < 0.01].mean() > 0.5
    assert not found[(from_side > 0.08) & (from_hole > 0.08)].any()


def test_a_scene_that_says_its_edge_is_believed():
    contact = build_scene("cylinder_on_flat", strips=12).contact
    assert edge_pairs(contact).tolist() == [False] * 5 + [True]
    # along a line the ends are the edge
    assert edge_pairs(replace(contact, edge=None)).tolist() == [True] + [False] * 4 + [True]


def test_of_a_surface_that_is_all_edge_it_is_not_known_what_is_inside():
    x, y = np.meshgrid(np.arange(4.0), np.arange(2.0))
    assert edge_pairs(contact_in_a_plane(x, y)).tolist() == [2] * 8
    assert COORDINATES["contact_edge"].flags[2] == "not_known"


# --- a scene file, and a result, are each enough ---

COARSE = ("scene.mesh=1", "axes.frequency=[211.5, 212.0]", "axes.scheme=implicit", "slow_time.cycles=500")
OUTPUTS = ("slow_time.outputs=2", 'outputs.variables=["default"]', "outputs.loops=[3]", "solver.rtol=0.1")
LEVELS = ("solver.harmonics=2", "solver.samples=64")
WAVE = ("scene.nodal_diameter=3", "scene.n_sectors=20")
STUDY = """
study = {name = "dovetail", title = "Fretting wear of a dovetail root around the first bending mode"}
scene = {model = "scene.h5", friction_coefficient = 0.5}
axes = {scheme = "implicit", frequency = [211.5, 212.0], excitation_amplitude = 0.5}
slow_time = {cycles = 500, outputs = 2}
solver = {rtol = 0.1}
outputs = {loops = [3]}
"""
EXACT_SLIDER = ["sdof_slider", *options("axes.frequency=[150, 160]", "slow_time.cycles=2000", "slow_time.outputs=3")]
EXACT_SLIDER += options("outputs.variables=['default', 'exact']")
KEEP = options("outputs.scene=true")


@pytest.fixture
def not_built(monkeypatch):
    """From when it is called on, bundled scenes cannot be built."""

    return lambda: monkeypatch.setattr(Bundled, "_build", pytest.fail)


def groups(path):
    """What the group of the scene holds."""
    found: dict[str, object] = {}

    def note(name, item):
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            found[name] = repr(item[()].tolist())

    with h5py.File(path) as file:
        file["scene"].visititems(note)
        return found | {name: value for name, value in file["scene"].attrs.items() if name.startswith("n")}


@pytest.mark.slow
def test_a_written_scene_gives_the_same_result():
    assert main(["dovetail", "-o", "own.nc", *options(*COARSE, *OUTPUTS)]) == 0
    assert main(["dovetail", "--write-scene", "scene.h5", *options(*COARSE, *OUTPUTS)]) == 0
    Path("s.toml").write_text(STUDY, encoding="utf-8")
    assert main(["s.toml", "-o", "file.nc"]) == 0
    own, file = results("own.nc"), results("file.nc")
    assert "mesh_quad" in own
    assert list(own.variables) == list(file.variables)
    # a scene file does not say which mesh it is from
    assert {name for name in own.attrs if own.attrs[name] != file.attrs[name]} == {"study", "id", "summary"}
    own.attrs = file.attrs = {}
    xr.testing.assert_identical(own, file)
    # and the result alone is enough, wherever it is
    Path("elsewhere").mkdir()
    shutil.move("file.nc", "elsewhere/moved.nc")
    Path("scene.h5").unlink()
    assert main(["elsewhere/moved.nc", "-o", "again.nc"]) == 0
    xr.testing.assert_identical(results("again.nc"), results("elsewhere/moved.nc"))
    assert groups("again.nc") == groups("elsewhere/moved.nc")


@pytest.mark.slow
def test_it_is_the_model_in_the_file_that_is_run_and_another_scene_or_solver_is_said(not_built, monkeypatch, capsys):
    """Twice all masses, stiffnesses and forces, and half the wear coefficient: the same motion and the same wear."""
    assert main([*EXACT_SLIDER, *KEEP, "-o", "kept.nc"]) == 0
    with h5py.File("kept.nc", "r+") as file:
        for name in ("mass", "damping", "stiffness", "load/static", "load/harmonic", "contact/normal_load"):
            file[f"scene/{name}"][...] *= 2.0
    not_built()
    monkeypatch.setattr(provenance, "package_digest", lambda _: "another")
    capsys.readouterr()
    one = results("kept.nc")
    half = options(f"axes.wear_coefficient={0.5 * one.wear_coefficient.item()!r}")
    assert main(["kept.nc", *half, "-o", "twice.nc"]) == 0
    warned = [line for line in capsys.readouterr().err.splitlines() if "] kept.nc: " in line]
    assert ["another scene" in warned[0], "another solver" in warned[1], len(warned)] == [True, True, 2]
    twice = results("twice.nc")
    assert float(one.worn_volume.max()) > 0.0
    for name, factor in (("response_amplitude", 1.0), ("worn_volume", 1.0), ("mean_pressure", 2.0)):
        np.testing.assert_allclose(twice[name].values, factor * one[name].values, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("wave", [(), WAVE], ids=["standing", "travelling"])
def test_a_sector_keeps_all_nodal_diameters_and_its_mesh(wave, not_built):
    given = ("scene.mesh=1", "scene.stuck_modes=5", "axes.frequency=211.5", "slow_time.cycles=0", "outputs.scene=true")
    given += ("axes.scheme=implicit", "outputs.loops=[]", "outputs.variables=['worn_volume', 'mesh']", *wave, *LEVELS)
    study = read_study("dovetail", given)
    model = build_study_scene(study)
    digest = describe_scene(model).digest
    assert main(["dovetail", *options(*given), "-o", "kept.nc"]) == 0
    not_built()
    kept = read_study("kept.nc")
    assert describe_scene(build_study_scene(kept)).digest == digest
    assert "mesh" in kept.scene.source.offers
    assert kept.scene.parameters == study.scene.parameters
    assert main(["kept.nc", "--write-scene", "root.h5"]) == 0
    assert describe_scene(read_scene("root.h5", 2)).digest == digest
    mesh, again = read_mesh("kept.nc", "scene"), read_mesh("root.h5")
    np.testing.assert_equal(vars(again), vars(mesh))
    told = Bundled("dovetail_sector", Path()).describe(study.scene.parameters)
    assert read_description("root.h5") == read_description("kept.nc") == told
    with h5py.File("root.h5") as file:
        assert "mesh/quad" in file
        assert set(file.get("nd", ())) == ({str(number) for number in model.linear} if wave else set())
        assert not wave or {0, 3, 6} <= set(model.linear)

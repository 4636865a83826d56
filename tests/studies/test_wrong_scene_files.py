"""Every wrong scene file is refused and named by its dataset."""

import h5py
import numpy as np
import pytest

from studies.scene_answers import SurfaceMesh
from studies.scene_error import SceneError
from studies.scene_file import read_mesh, read_scene, write_scene
from tests.studies.scene_models import Change, changed, drop, general_model, linear_model, plain, poke, put, sector


def asymmetric(file):
    file["stiffness"][0, 1] *= 1 + 1e-6


def not_hermitian(file):
    file["nd/2/stiffness"][0, 1] = np.conj(file["nd/2/stiffness"][0, 1])


def rank_deficient(file):
    # The motion (1, 1, 0, ...) gets neither stiffness nor mass.
    motion = np.zeros(7)
    motion[:2] = np.sqrt(0.5)
    keep = np.eye(7) - np.outer(motion, motion)
    for key in ("stiffness", "mass"):
        matrix = keep @ file[key][()] @ keep
        file[key][...] = (matrix + matrix.T) / 2


def free_where_no_contact_is(file):
    file["stiffness"][6, :] = 0
    file["stiffness"][:, 6] = 0


def soft(file):
    del file["mass"]
    file["mass"] = h5py.SoftLink("/stiffness")


def attribute(name, value):
    def change(file):
        if value is None:
            del file.attrs[name]
        else:
            file.attrs[name] = value

    return change


FRICTION = "contact/friction_coefficient"

WRONG_PLAIN: list[tuple[Change, str, str]] = [
    (drop("stiffness"), "stiffness", "missing"),
    (drop("response/names"), "response/names", "missing"),
    (drop("contact/normal_load"), "contact/normal_load", "0.0 at index 1"),
    (put("inertia", np.eye(7)), "inertia", "unknown dataset"),
    (put("stiffness", np.eye(7)[:, :6]), "stiffness", "shape (7, 6)"),
    (put("load/static", np.ones(7, dtype=complex)), "load/static", "complex"),
    (put("mass", h5py.Empty("f8")), "mass", "single value or nothing"),
    (poke("stiffness", (2, 3), np.nan), "stiffness", "nan at index 2, 3"),
    (asymmetric, "stiffness", "not symmetric"),
    (put("stiffness", linear_model(7, hermitian=True, seed=5).stiffness), "stiffness", "complex"),
    (poke("mass", (6, 6), -5.0), "mass", "negative eigenvalue"),
    (rank_deficient, "stiffness", "rank"),
    (free_where_no_contact_is, "stiffness", "row of zeros"),
    (poke("contact/area", 1, -1e-4), "contact/area", "-0.0001 at index 1"),
    (put(FRICTION, np.array([0.5, 0.5, -0.1])), FRICTION, "-0.1 at index 2"),
    (put("contact/edge", np.array([0, 1, 2])), "contact/edge", "2"),
    (poke("contact/dofs", (0, 1), 4), "contact/dofs", "index 4 is used twice"),
    (poke("contact/dofs", (2, 0), -1), "contact/dofs", "pair 2 has no direction"),
    (put("contact/surface", ["a", "b"]), "contact/surface", "2 labels"),
    (put("contact/surface", np.array([b"\xff\xfe", b"a", b"b"])), "contact/surface", "UTF-8"),
    (put("response/names", ["a", "b", "c"]), "response/dofs", "shape (2, 7)"),
    (put("response/dofs", np.array([0, 7])), "response/dofs", "7"),
    (soft, "mass", "link"),
    (attribute("nodal_diameter", 1), "nodal_diameter", "1"),
]

WRONG_MESH: list[tuple[Change, str, str]] = [
    (drop("mesh/y"), "mesh/y", "missing"),
    (poke("mesh/x", 1, np.nan), "mesh/x", "not finite"),
    (put("mesh/quad", np.zeros((2, 3), dtype=int)), "mesh/quad", "shape (2, 3)"),
    (put("mesh/quad", np.full((2, 4), 0.5)), "mesh/quad", "0.5"),
    (put("mesh/part", ["blade"]), "mesh/part", "1 labels"),
]

WRONG_SECTOR: list[tuple[Change, str, str]] = [
    (not_hermitian, "nd/2/stiffness", "not Hermitian"),
    (drop("nd/2"), "nd/2", "missing"),
    (put("nd/2/response/names", ["tip", "other"]), "nd/2/response/names", "tip, other"),
    (poke("nd/2/load/harmonic", 0, np.nan), "nd/2/load/harmonic", "nan"),
    (put("nd/0/stiffness", linear_model(8, hermitian=True, seed=4).stiffness), "nd/0/stiffness", "complex"),
    (lambda file: file.copy("nd/2", "nd/4"), "nd/4", "6 sectors"),
    (attribute("n_sectors", None), "n_sectors", "missing"),
    (attribute("n_sectors", -6), "n_sectors", "-6"),
    (attribute("nodal_diameter", 1), "nd/1", "missing"),
]


@pytest.mark.parametrize(
    ("build", "change", "key", "value"),
    [(plain, *case) for case in WRONG_PLAIN] + [(sector, *case) for case in WRONG_SECTOR],
)
def test_a_wrong_file_is_named_by_its_dataset(tmp_path, build, change, key, value):
    path = changed(tmp_path, build(), change)
    with pytest.raises(SceneError) as caught:
        read_scene(path)
    assert caught.value.key == key
    assert value in caught.value.value
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("change", "key", "value"), WRONG_MESH)
def test_a_wrong_mesh_is_named_by_its_dataset(tmp_path, change, key, value):
    path = tmp_path / "scene.h5"
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    mesh = SurfaceMesh(nodes, np.array([[0, 1, 2, 3], [1, 4, 5, 2]]), ("blade", "disk"))
    write_scene(plain(), path, mesh)
    with h5py.File(path, "r+") as file:
        change(file)
    with pytest.raises(SceneError) as caught:
        read_mesh(path)
    assert caught.value.key == key
    assert value in caught.value.value


def test_the_harmonics_say_which_nodal_diameters_are_needed(tmp_path):
    # Nodal diameter 1 of 6 sectors: harmonics see 0, 1, 2, 3, 2, 1, 0, ...
    linear = linear_model(7, hermitian=True, seed=3)
    models = {0: linear_model(7, hermitian=False, seed=2), 1: linear, 2: linear}
    path = tmp_path / "scene.h5"
    write_scene(general_model(models, n_sectors=6, nodal_diameter=1), path)
    read_scene(path, 2)
    with pytest.raises(SceneError) as caught:
        read_scene(path, 3)
    assert caught.value.key == "nd/3"
    assert "fewer than 3 harmonics" in caught.value.remedy


def test_a_file_that_is_no_hdf5_or_damaged_is_said_so(tmp_path):
    path = tmp_path / "scene.h5"
    write_scene(plain(), path)
    content = path.read_bytes()
    for wrong in (b"", b"[study]\nname = 1\n", content[: len(content) // 2]):
        path.write_bytes(wrong)
        with pytest.raises(SceneError, match=r"scene\.h5") as caught:
            read_scene(path)
        assert caught.value.key == "model"

"""Every wrong scene file is refused and named by its dataset."""

import h5py
import numpy as np
import pytest

from studies.scene_answers import SurfaceMesh
from studies.scene_error import SceneError
from studies.scene_file import read_mesh, read_scene, write_scene
from tests.studies.scene_models import changed, drop, general_model, linear_model, plain, poke, put, sector


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


def meshed():
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
    return SurfaceMesh(nodes, np.array([[0, 1, 2, 3], [1, 4, 5, 2]]), ("blade", "disk"))


FRICTION = "contact/friction_coefficient"
COMPLEX = linear_model(8, hermitian=True, seed=4).stiffness
WRONG = [
    (plain, drop("stiffness"), "stiffness"),
    (plain, drop("response/names"), "response/names"),
    (plain, drop("contact/normal_load"), "contact/normal_load"),
    (plain, put("inertia", np.eye(7)), "inertia"),
    (plain, put("stiffness", np.eye(7)[:, :6]), "stiffness"),
    (plain, put("load/static", np.ones(7, dtype=complex)), "load/static"),
    (plain, put("mass", h5py.Empty("f8")), "mass"),
    (plain, poke("stiffness", (2, 3), np.nan), "stiffness"),
    (plain, asymmetric, "stiffness"),
    (plain, poke("mass", (6, 6), -5.0), "mass"),
    (plain, rank_deficient, "stiffness"),
    (plain, poke("contact/area", 1, -1e-4), "contact/area"),
    (plain, put(FRICTION, np.array([0.5, 0.5, -0.1])), FRICTION),
    (plain, put("contact/edge", np.array([0, 1, 2])), "contact/edge"),
    (plain, poke("contact/dofs", (0, 1), 4), "contact/dofs"),
    (plain, poke("contact/dofs", (2, 0), -1), "contact/dofs"),
    (plain, put("contact/surface", ["a", "b"]), "contact/surface"),
    (plain, put("contact/surface", np.array([b"\xff\xfe", b"a", b"b"])), "contact/surface"),
    (plain, put("response/names", ["a", "b", "c"]), "response/dofs"),
    (plain, put("response/dofs", np.array([0, 7])), "response/dofs"),
    (plain, soft, "mass"),
    (plain, attribute("nodal_diameter", 1), "nodal_diameter"),
    (sector, not_hermitian, "nd/2/stiffness"),
    (sector, drop("nd/2"), "nd/2"),
    (sector, put("nd/2/response/names", ["tip", "other"]), "nd/2/response/names"),
    (sector, put("nd/0/stiffness", COMPLEX), "nd/0/stiffness"),
    (sector, lambda file: file.copy("nd/2", "nd/4"), "nd/4"),
    (sector, attribute("n_sectors", None), "n_sectors"),
    (sector, attribute("nodal_diameter", 1), "nd/1"),
    (meshed, drop("mesh/y"), "mesh/y"),
    (meshed, poke("mesh/x", 1, np.nan), "mesh/x"),
    (meshed, put("mesh/quad", np.zeros((2, 3), dtype=int)), "mesh/quad"),
    (meshed, put("mesh/part", ["blade"]), "mesh/part"),
]


@pytest.mark.parametrize(("build", "change", "key"), WRONG)
def test_a_wrong_file_is_named_by_its_dataset(tmp_path, build, change, key):
    path = tmp_path / "scene.h5"
    if build is meshed:
        write_scene(plain(), path, meshed())
        with h5py.File(path, "r+") as file:
            change(file)
    else:
        path = changed(tmp_path, build(), change)
    with pytest.raises(SceneError) as caught:
        (read_mesh if build is meshed else read_scene)(path)
    assert caught.value.key == key
    assert "\n" not in str(caught.value)


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


def test_a_file_that_is_no_hdf5_or_damaged_is_said_so(tmp_path):
    path = tmp_path / "scene.h5"
    write_scene(plain(), path)
    content = path.read_bytes()
    for wrong in (b"", b"[study]\nname = 1\n", content[: len(content) // 2]):
        path.write_bytes(wrong)
        with pytest.raises(SceneError, match=r"scene\.h5") as caught:
            read_scene(path)
        assert caught.value.key == "model"

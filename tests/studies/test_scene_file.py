"""Scene files: bitwise round trip, other writers' habits, and wrong files, named by their dataset."""

from dataclasses import replace
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from solver import CubicSprings, IwanJoints
from solver.model import LinearModel
from studies.model_check import check_model
from studies.scene import SurfaceMesh
from studies.scene_error import SceneError
from studies.scene_file import read_mesh, read_scene, scene_datasets, write_scene
from tests.studies.scene_models import (
    attribute,
    bits,
    changed,
    drop,
    general_model,
    linear_model,
    plain,
    poke,
    put,
    sector,
    written,
)


def with_pairs(**values):
    model = plain()
    return replace(model, contact=replace(model.contact, **values))


def with_blade(model):
    """Of a ring: with the modes of the blade in the displacements of each nodal diameter."""
    random = np.random.default_rng(4)
    blades = {
        k: random.normal(size=(2, len(each.mass))) * (1.0 + 0.5j if k else 1.0) for k, each in model.linear.items()
    }
    return replace(model, linear={k: replace(each, blade=blades[k]) for k, each in model.linear.items()})


LAWS = CubicSprings((0,), [1.0, 2.0, 0.1 + 0.2], [0.0, 0.0, 3.0]), IwanJoints((1,), 4.0, 5.0, 0.0)


def joined():
    return with_pairs(laws=LAWS)


MODELS = {
    "plain": plain(),
    "sector": sector(),
    "rough": with_pairs(friction_coefficient=np.array([0.0, 0.1 + 0.2, 1.5])),
    "open ended": with_pairs(edge=np.array([False, True, True])),
    "ring": with_blade(sector()),
}


@pytest.mark.parametrize("name", MODELS)
def test_round_trip_is_bitwise(tmp_path, name):
    assert bits(read_scene(written(tmp_path, MODELS[name]), 5)) == bits(MODELS[name])
    assert [path.name for path in tmp_path.iterdir()] == ["scene.h5"]


def test_laws_of_other_kinds_come_back_and_press_nothing(tmp_path):
    # two laws of a kind come back as one
    two = replace(LAWS[0], pairs=(2,))
    model = with_pairs(laws=(*LAWS, two), normal_load=np.zeros(3))
    springs, iwan = read_scene(written(tmp_path, model)).contact.laws
    both = replace(
        LAWS[0], pairs=(0, 2), **{name: getattr(two, name).repeat(2, axis=0) for name in ("linear", "cubic")}
    )
    for found, expected in ((springs, both), (iwan, LAWS[1])):
        for name, values in vars(expected).items():
            assert np.array_equal(getattr(found, name), values)


def test_a_law_without_datasets_is_refused(tmp_path):
    with pytest.raises(SceneError, match="springs, iwan"):
        written(tmp_path, with_pairs(laws=(SimpleNamespace(pairs=(0,)),)))


def test_optional_datasets_have_defaults(tmp_path):
    optional = drop("damping", "contact/gap", "contact/position", "contact/surface", "contact/normal_load")
    model = read_scene(written(tmp_path, plain(), optional, poke("contact/dofs", (1, 0), 6)))
    contact = model.contact
    assert not any(values.any() for values in (model.linear[0].damping, contact.gap, contact.normal_load))
    assert np.isnan(contact.position).all()
    assert contact.surface == ("", "", "")


def by_hand(path, model, turned=False):
    """The file as a program with or without columns first writes it: all matrices are transposed, or none."""
    with h5py.File(path, "w") as file:
        for key, values in scene_datasets(model, None):
            kind = h5py.string_dtype() if values.dtype.kind == "U" else None
            values = values.astype(object) if kind else values
            file.create_dataset(key, data=values.T if turned else values, dtype=kind)


def test_three_pairs_written_columns_first_are_refused(tmp_path):
    path, root = tmp_path / "scene.h5", np.random.default_rng(0).normal(size=(9, 9))
    matrices = np.eye(9), np.eye(9), root @ root.T + np.eye(9)
    linear = LinearModel(*matrices, np.ones(9), np.ones(9, dtype=complex), np.eye(9)[:2])
    model = replace(with_pairs(dofs=np.arange(9).reshape(3, 3)), linear={0: linear}, response_names=("u0", "u1"))
    by_hand(path, model, turned=True)
    with pytest.raises(SceneError, match=r"^response/dofs: shape \(9, 2\); .* \(2, 9\)"):
        read_scene(path)
    for turned in (True, False):
        by_hand(path, model, turned=turned)
        changed(path, put("response/dofs", np.array([0, 1])))
        with pytest.raises(SceneError, match=r'^contact/dofs: 3 pairs, .* rows = "pairs"'):
            read_scene(path)
    changed(path, lambda file: file["contact/dofs"].attrs.update(rows="pairs"))
    assert read_scene(path).contact.dofs.tolist() == np.arange(9).reshape(3, 3).tolist()
    by_hand(path, model)  # two responses of nine displacements show the order
    read_scene(path)


def test_responses_can_be_indices_and_damping_coefficients(tmp_path):
    changes = put("response/dofs", np.array([6, 2], dtype=np.int32)), put("damping", np.array([3.0, 1e-5]))
    linear, own = read_scene(written(tmp_path, plain(), *changes)).linear[0], plain().linear[0]
    assert linear.response.tolist() == np.eye(7)[[6, 2]].tolist()
    assert np.array_equal(linear.damping, 3.0 * own.mass + 1e-5 * own.stiffness)


def test_other_types_of_numbers_are_read(tmp_path):
    own = plain().linear[0]
    # complex numbers as Octave has them
    compound = np.empty(7, dtype=[("real", "f8"), ("imag", "f8")])
    compound["real"], compound["imag"] = own.load_harmonic.real, own.load_harmonic.imag
    changes = (
        put("contact/dofs", np.array([[0, 1, 2], [-1, 3, 4], [5, -1, -1]], dtype=np.float64)),
        put("mass", np.eye(7, dtype=np.float32)),
        put("damping", np.eye(7, dtype=np.int16)),
        put("load/harmonic", compound),
        # zero imaginary parts at nodal diameter 0 say nothing
        put("stiffness", own.stiffness.astype(complex)),
        put("load/static", np.arange(7.0), dtype=">f8"),
    )
    linear = read_scene(written(tmp_path, plain(), *changes)).linear[0]
    assert linear.mass.dtype == linear.damping.dtype == linear.load_static.dtype == np.float64
    for name in ("load_harmonic", "stiffness"):
        found, expected = getattr(linear, name), getattr(own, name)
        assert (found.dtype, found.tobytes()) == (expected.dtype, expected.tobytes())


def without_motion(matrix):
    """A symmetric matrix (7, 7) without entries for the motion (1, 1, 0, ...)."""
    keep = np.eye(7) - 0.5 * np.outer(*[[1, 1, 0, 0, 0, 0, 0]] * 2)
    free = keep @ matrix @ keep
    return (free + free.T) / 2


def test_what_is_unusual_but_possible_passes():
    model = plain()
    stiffness = model.linear[0].stiffness
    # a rigid body motion with mass that contact pairs can hold
    check_model(replace(model, linear={0: replace(model.linear[0], stiffness=without_motion(stiffness))}))
    # round-off in a symmetric matrix, and displacements in very different units
    scale = np.diag(10.0 ** np.arange(-6, 8, 2))
    noisy = scale @ stiffness @ scale * (1 + 1e-13 * np.random.default_rng(0).normal(size=(7, 7)))
    check_model(replace(model, linear={0: replace(model.linear[0], stiffness=noisy, mass=np.zeros((7, 7)))}))


def not_hermitian(file):
    file["nd/2/stiffness"][0, 1] = np.conj(file["nd/2/stiffness"][0, 1])


def rank_deficient(file):
    for key in ("stiffness", "mass"):
        file[key][...] = without_motion(file[key][()])


def short(file):
    put("response/dofs", np.array([0, 6]))(file)
    put("stiffness", np.eye(7)[:1])(file)


def soft(file):
    del file["mass"]
    file["mass"] = h5py.SoftLink("/stiffness")


NODES = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]])
MESH = SurfaceMesh(NODES, np.array([[0, 1, 2, 3], [1, 4, 5, 2]]), ("blade", "disk"))
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
    (plain, short, "stiffness"),
    (plain, soft, "mass"),
    (plain, attribute("nodal_diameter", 1), "nodal_diameter"),
    (sector, not_hermitian, "nd/2/stiffness"),
    (sector, drop("nd/2"), "nd/2"),
    (sector, put("nd/2/blade", np.ones((2, 6))), "nd/2/blade"),
    (sector, put("nd/0/blade", 1.0), "nd/0/blade"),
    (sector, put("nd/2/response/names", ["tip", "other"]), "nd/2/response/names"),
    (sector, put("nd/0/stiffness", COMPLEX), "nd/0/stiffness"),
    (sector, lambda file: file.copy("nd/2", "nd/4"), "nd/4"),
    (sector, attribute("n_sectors", None), "n_sectors"),
    (sector, attribute("nodal_diameter", 1), "nd/1"),
    (joined, put("contact/iwan/limit", [0.0, 0.0, 0.0]), "contact/iwan/limit"),
    (joined, put("contact/iwan/stiffness", [4.0]), "contact/iwan/stiffness"),
    (joined, put("contact/springs/linear", np.ones((3, 2))), "contact/springs/linear"),
    (joined, put("contact/springs/cubic", np.ones((3, 3))), "contact"),
    (joined, drop("contact/springs/cubic"), "contact/springs/cubic"),
    (joined, put("contact/springs/square", np.ones((3, 3))), "contact/springs/square"),
    (MESH, drop("mesh/y"), "mesh/y"),
    (MESH, poke("mesh/x", 1, np.nan), "mesh/x"),
    (MESH, put("mesh/quad", np.zeros((2, 3), dtype=int)), "mesh/quad"),
    (MESH, put("mesh/part", ["blade"]), "mesh/part"),
]


@pytest.mark.parametrize(("build", "change", "key"), WRONG)
def test_a_wrong_file_is_named_by_its_dataset(tmp_path, build, change, key):
    path, model, mesh = tmp_path / "scene.h5", plain() if build is MESH else build(), MESH if build is MESH else None
    write_scene(model, path, mesh)
    changed(path, change)
    with pytest.raises(SceneError) as caught:
        (read_scene if mesh is None else read_mesh)(path)
    assert caught.value.key == key
    assert "\n" not in str(caught.value)


def test_the_harmonics_say_which_nodal_diameters_are_needed(tmp_path):
    # nodal diameter 1 of 6 sectors: harmonics see 0, 1, 2, 3, 2, 1, 0, ...
    linear = linear_model(7, hermitian=True, seed=3)
    models = {0: linear_model(7, hermitian=False, seed=2), 1: linear, 2: linear}
    path = written(tmp_path, general_model(models, n_sectors=6, nodal_diameter=1))
    read_scene(path, 2)
    with pytest.raises(SceneError) as caught:
        read_scene(path, 3)
    assert caught.value.key == "nd/3"


def test_a_file_that_is_no_hdf5_or_damaged_is_said_so(tmp_path):
    path = written(tmp_path, plain())
    content = path.read_bytes()
    for wrong in (b"", b"[study]\nname = 1\n", content[: len(content) // 2]):
        path.write_bytes(wrong)
        with pytest.raises(SceneError, match=r"scene\.h5") as caught:
            read_scene(path)
        assert caught.value.key == "model"

"""Scene files: bitwise round trip and other writers' habits."""

from dataclasses import fields, replace

import h5py
import numpy as np
import pytest

from solver.model import ContactInterface, LinearModel
from studies.model_check import check_model
from studies.scene_error import SceneError
from studies.scene_file import read_scene, scene_datasets, write_scene
from tests.studies.scene_models import changed, drop, plain, put, sector


def assert_same_bits(one, other):
    assert (one.response_names, one.n_sectors, one.nodal_diameter) == (
        other.response_names,
        other.n_sectors,
        other.nodal_diameter,
    )
    assert one.contact.surface == other.contact.surface
    assert set(one.linear) == set(other.linear)
    pairs: list[tuple[object, object, str]] = [
        (one.contact, other.contact, name.name) for name in fields(ContactInterface) if name.name != "surface"
    ]
    pairs += [(one.linear[k], other.linear[k], name.name) for k in one.linear for name in fields(LinearModel)]
    for left, right, name in pairs:
        first, second = getattr(left, name), getattr(right, name)
        if name in ("friction_coefficient", "edge") and first is None:
            assert second is None
            continue
        assert first.dtype == second.dtype, name
        assert first.shape == second.shape, name
        assert first.tobytes() == second.tobytes(), name


def with_pairs(**values):
    model = plain()
    return replace(model, contact=replace(model.contact, **values))


MODELS = (
    plain(),
    sector(),
    with_pairs(friction_coefficient=np.array([0.0, 0.1 + 0.2, 1.5])),
    with_pairs(edge=np.array([False, True, True])),
)


@pytest.mark.parametrize("model", MODELS, ids=["plain", "sector", "rough", "open ended"])
def test_round_trip_is_bitwise(tmp_path, model):
    write_scene(model, tmp_path / "scene.h5")
    assert_same_bits(read_scene(tmp_path / "scene.h5", 5), model)
    assert [path.name for path in tmp_path.iterdir()] == ["scene.h5"]


def test_optional_datasets_have_defaults(tmp_path):
    def change(file):
        drop("damping", "contact/gap", "contact/position", "contact/surface", "contact/normal_load")(file)
        file["contact/dofs"][1, 0] = 6

    model = read_scene(changed(tmp_path, plain(), change))
    assert not model.linear[0].damping.any()
    assert not model.contact.gap.any()
    assert not model.contact.normal_load.any()
    assert np.isnan(model.contact.position).all()
    assert model.contact.surface == ("", "", "")


def by_hand(path, model, turned=False):
    """The file as a program with or without columns first writes it: all matrices are transposed, or none."""
    with h5py.File(path, "w") as file:
        for key, values in scene_datasets(model, None):
            kind = h5py.string_dtype() if values.dtype.kind == "U" else None
            values = values.astype(object) if kind else values
            file.create_dataset(key, data=values.T if turned else values, dtype=kind)


def of_three_pairs(response="matrix"):
    model = plain()
    contact = replace(model.contact, dofs=np.arange(9).reshape(3, 3))
    generator = np.random.default_rng(0)
    stiffness = generator.normal(size=(9, 9))
    stiffness = stiffness @ stiffness.T + np.eye(9)
    rows = np.eye(9)[: 9 if response == "square" else 2]
    linear = LinearModel(np.eye(9), np.eye(9), stiffness, np.ones(9), np.ones(9, dtype=complex), rows)
    names = tuple(f"u{n}" for n in range(len(rows)))
    return replace(model, contact=contact, linear={0: linear}, response_names=names)


def as_indices(path):
    with h5py.File(path, "r+") as file:
        put("response/dofs", np.array([0, 1]))(file)


def test_three_pairs_written_columns_first_are_refused(tmp_path):
    path = tmp_path / "scene.h5"
    by_hand(path, of_three_pairs(), turned=True)
    with pytest.raises(SceneError, match=r"response/dofs: shape \(9, 2\); give shape \(2, 9\): MATLAB and Fortran"):
        read_scene(path)
    for turned in (True, False):
        by_hand(path, of_three_pairs(), turned=turned)
        as_indices(path)
        with pytest.raises(SceneError, match=r'contact/dofs: 3 pairs, and nothing shows .* attribute rows = "pairs"'):
            read_scene(path)
    with h5py.File(path, "r+") as file:
        file["contact/dofs"].attrs["rows"] = "pairs"
    assert read_scene(path).contact.dofs.tolist() == np.arange(9).reshape(3, 3).tolist()
    by_hand(path, of_three_pairs())  # two responses of nine displacements show the order
    read_scene(path)


def test_responses_can_be_indices_and_damping_coefficients(tmp_path):
    def change(file):
        put("response/dofs", np.array([6, 2], dtype=np.int32))(file)
        put("damping", np.array([3.0, 1e-5]))(file)

    linear, own = read_scene(changed(tmp_path, plain(), change)).linear[0], plain().linear[0]
    assert linear.response.tolist() == np.eye(7)[[6, 2]].tolist()
    assert np.array_equal(linear.damping, 3.0 * own.mass + 1e-5 * own.stiffness)


def test_other_types_of_numbers_are_read(tmp_path):
    def change(file):
        put("contact/dofs", np.array([[0, 1, 2], [-1, 3, 4], [5, -1, -1]], dtype=np.float64))(file)
        put("mass", np.eye(7, dtype=np.float32))(file)
        put("damping", np.eye(7, dtype=np.int16))(file)
        put("load/harmonic", np.arange(7, dtype=np.uint8))(file)
        put("stiffness", file["stiffness"][()].astype(complex))(file)
        put("load/static", np.arange(7.0), dtype=">f8")(file)

    linear = read_scene(changed(tmp_path, plain(), change)).linear[0]
    assert linear.mass.dtype == linear.damping.dtype == linear.load_static.dtype == np.float64
    assert linear.load_harmonic.dtype == np.complex128
    assert linear.load_harmonic.tolist() == list(range(7))
    # Zero imaginary parts at nodal diameter 0 say nothing.
    assert linear.stiffness.dtype == np.float64
    assert linear.stiffness.tobytes() == plain().linear[0].stiffness.tobytes()


def test_complex_numbers_of_octave_are_read(tmp_path):
    values = plain().linear[0].load_harmonic
    compound = np.empty(7, dtype=[("real", "f8"), ("imag", "f8")])
    compound["real"], compound["imag"] = values.real, values.imag
    model = read_scene(changed(tmp_path, plain(), put("load/harmonic", compound)))
    assert model.linear[0].load_harmonic.tobytes() == values.tobytes()


def test_what_is_unusual_but_possible_passes():
    model = plain()
    # A rigid body motion with mass that contact pairs can hold.
    free = model.linear[0].stiffness.copy()
    motion = np.zeros(7)
    motion[:2] = np.sqrt(0.5)
    keep = np.eye(7) - np.outer(motion, motion)
    free = keep @ free @ keep
    check_model(replace(model, linear={0: replace(model.linear[0], stiffness=(free + free.T) / 2)}))
    # Round-off in a symmetric matrix, and displacements in very different units.
    scale = np.diag(10.0 ** np.arange(-6, 8, 2))
    noisy = scale @ model.linear[0].stiffness @ scale * (1 + 1e-13 * np.random.default_rng(0).normal(size=(7, 7)))
    check_model(replace(model, linear={0: replace(model.linear[0], stiffness=noisy, mass=np.zeros((7, 7)))}))

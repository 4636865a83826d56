"""Small random reduced models, and scene files made from them by changing single datasets."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

import h5py
import numpy as np

from solver.model import ContactInterface, LinearModel, ReducedModel
from studies.scene_file import write_scene
from tests.random_scenes import definite

Change = Callable[[h5py.File], object]


def linear_model(n: int, *, hermitian: bool, seed: int) -> LinearModel:
    """Random structure with a massless first displacement."""
    random = np.random.default_rng(seed)
    mass = np.zeros((n, n), dtype=complex if hermitian else float)
    mass[1:, 1:] = definite(random, n - 1, hermitian)
    response = random.normal(size=(2, n)) + (1j * random.normal(size=(2, n)) if hermitian else 0)
    load = random.normal(size=n), random.normal(size=n) + 1j * random.normal(size=n)
    damping, stiffness = (size * definite(random, n, hermitian) for size in (0.01, 1e6))
    return LinearModel(mass, damping, stiffness, *load, response)


def general_model(linear: dict[int, LinearModel], n_sectors: int = 0, nodal_diameter: int = 0) -> ReducedModel:
    """Three pairs: 3D, without normal direction, with a normal direction only."""
    contact = ContactInterface(
        dofs=np.array([[0, 1, 2], [-1, 3, 4], [5, -1, -1]]),
        area=np.array([1e-4, 2e-4, 0.1 + 0.2]),
        gap=np.array([0.0, 0.0, -1e-6]),
        normal_load=np.array([0.0, 12.5, 0.0]),
        position=np.array([[0.1, 0.2, 0.3], [np.nan] * 3, [1.0, 2.0, 3.0]]),
        surface=("intrados", "extrados", "Spitze ü"),
    )
    return ReducedModel(linear, contact, ("tip", "root"), n_sectors, nodal_diameter)


def plain() -> ReducedModel:
    return general_model({0: linear_model(7, hermitian=False, seed=1)})


def sector() -> ReducedModel:
    """6 sectors, nodal diameter 2: harmonics see 0 and 2."""
    models = {0: linear_model(8, hermitian=False, seed=2), 2: linear_model(7, hermitian=True, seed=3)}
    return general_model(models, n_sectors=6, nodal_diameter=2)


def bits(model: ReducedModel) -> list[object]:
    """All that a model holds, in a form that is equal only to the last bit and to the layout in memory."""
    values = [model.response_names, model.n_sectors, model.nodal_diameter, *model.linear]
    for part in (model.contact, *model.linear.values()):
        values += [getattr(part, each.name) for each in fields(part)]
    return [(v.dtype, v.shape, v.strides, v.tobytes()) if isinstance(v, np.ndarray) else v for v in values]


def changed(path: Path, *changes: Change) -> Path:
    """The scene file, after changes."""
    with h5py.File(path, "r+") as file:
        for change in changes:
            change(file)
    return path


def written(folder: Path, model: ReducedModel, *changes: Change) -> Path:
    """The scene file of a model, changed."""
    write_scene(model, folder / "scene.h5")
    return changed(folder / "scene.h5", *changes)


def put(key: str, values: object, **options: object) -> Change:
    """Replace a dataset."""
    return lambda file: (file.pop(key, None), file.create_dataset(key, data=values, **options))


def poke(key: str, index: object, value: object) -> Change:
    """Replace entries of a dataset."""
    return lambda file: file[key].__setitem__(index, value)


def drop(*keys: str) -> Change:
    return lambda file: [file.pop(key) for key in keys]


def attribute(name: str, value: object) -> Change:
    """Replace an attribute of the file, or remove it (None)."""
    return lambda file: file.attrs.pop(name, None) if value is None else file.attrs.__setitem__(name, value)

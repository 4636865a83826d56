"""Registry of the bundled scenes.

Every bundled scene is a module of this package with a pydantic class `Parameters`, whose first fields are
`friction_coefficient` and `contact_stiffness`, and a function `build(parameters, n_harmonics) -> ReducedModel`, which
leaves the contact stiffness to this registry. It may also have the functions

- `describe_mesh(parameters) -> SurfaceMesh`,
- `natural_frequencies(parameters) -> NaturalFrequencies`, where it knows more than its reduced model,
- `with_room_for_wear(parameters, expected) -> Parameters`, where its pairs end at an artificial edge,
- `FRICTION_IN_MODEL`, where the model depends on the friction coefficient,
- `exact_answer(parameters, asked) -> ExactAnswer` to a `WearQuestion`, with `EXACT_ANSWER_KNOWS`: all keys of a study
  on which the answer depends, as "scene.mass". Where any other key differs from its default there is no exact answer.

A module is imported when its scene is asked for, so that listing the scenes costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any, cast

from studies.scene_error import SceneError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from solver.model import ReducedModel
    from studies.scene_answers import ExactAnswer, NaturalFrequencies, SurfaceMesh, WearQuestion
    from studies.scenes.half_space import ExpectedWear

BUNDLED = (
    "cylinder_on_flat",
    "dovetail_sector",
    "sdof_slider",
    "shrouded_sector",
    "sphere_on_flat",
    "two_masses",
    "underplatform_damper",
    "vibro_impact",
)

AUTOMATIC_HARMONICS_OF_A_WAVE = 13
"""Harmonics whose nodal diameters a cyclic scene is built with where their number is automatic."""


def scene_parameters(model: str) -> type[BaseModel]:
    """Class of the parameters of a bundled scene: frozen, unknown keys forbidden, units in the descriptions.

    Raises SceneError where no bundled scene has this name.
    """
    return cast("type[BaseModel]", _scene_attribute(model, "Parameters"))


def build_scene(model: str, parameters: BaseModel, n_harmonics: int) -> ReducedModel:
    """Reduced model of a bundled scene, with all nodal diameters that the harmonics 0..n_harmonics see.

    Raises SceneError where no bundled scene has this name or where the parameters describe no possible structure;
    TypeError where `parameters` belong to another scene.
    """
    expected = scene_parameters(model)
    if not isinstance(parameters, expected):
        raise TypeError(f"scene {model} takes {expected.__module__}.Parameters, not {type(parameters).__qualname__}")
    # imported here: listing the scenes costs nothing
    from studies.contact_compliance import build_compliant

    build = cast("Callable[[BaseModel, int], ReducedModel]", _scene_attribute(model, "build"))
    key = f"{model} {n_harmonics} {parameters.model_dump_json(exclude={'contact_stiffness'})}"
    contact_stiffness = cast("float | None", dict(parameters)["contact_stiffness"])
    return build_compliant(key, contact_stiffness, lambda: build(parameters, n_harmonics))


def scene_has(model: str, name: str) -> bool:
    """Whether a bundled scene has the function `name`. Raises SceneError where no bundled scene has the first name."""
    return hasattr(_scene_module(model), name)


def scene_mesh(model: str, parameters: BaseModel) -> SurfaceMesh:
    """Outer faces of the mesh of a bundled scene that has one.

    Raises SceneError where the parameters describe no possible structure.
    """
    return cast("SurfaceMesh", _scene_attribute(model, "describe_mesh")(parameters))


def scene_frequencies(model: str, parameters: BaseModel) -> NaturalFrequencies:
    """Natural frequencies from a bundled scene that knows more than its reduced model; it may take some seconds.

    Raises SceneError where the parameters describe no possible structure.
    """
    return cast("NaturalFrequencies", _scene_attribute(model, "natural_frequencies")(parameters))


def scene_with_room(model: str, parameters: BaseModel, expected: ExpectedWear) -> BaseModel:
    """Parameters of a bundled scene whose pairs have room for what wears; as they are where it needs none."""
    if not scene_has(model, "with_room_for_wear"):
        return parameters
    return cast("BaseModel", _scene_attribute(model, "with_room_for_wear")(parameters, expected))


def scene_answer(model: str, parameters: BaseModel, asked: WearQuestion) -> ExactAnswer:
    """Exact answer of a bundled scene that has one; NaN where a key that its closed form does not know is changed."""
    known = cast("frozenset[str]", _scene_attribute(model, "EXACT_ANSWER_KNOWS"))
    if changed_keys(parameters, "scene") | asked.changed <= known:
        return cast("ExactAnswer", _scene_attribute(model, "exact_answer")(parameters, asked))
    # imported here: listing the scenes costs nothing
    from studies.scene_answers import unknown_answer

    return unknown_answer(asked, len(build_scene(model, parameters, 1).response_names))


def changed_keys(table: BaseModel, name: str) -> frozenset[str]:
    """Keys of a table of a study file that differ from their defaults, with the name of the table: "scene.mass"."""
    fields = type(table).model_fields.items()
    return frozenset(
        f"{name}.{key}"
        for key, field in fields
        if not field.exclude
        and (field.is_required() or getattr(table, key) != field.get_default(call_default_factory=True))
    )


def _scene_attribute(model: str, name: str) -> Any:
    return getattr(_scene_module(model), name)


def _scene_module(model: str) -> ModuleType:
    if model not in BUNDLED:
        remedy = f"give one of {', '.join(BUNDLED)}, or the path of a scene file or of a model (.inp, .msh, .cdb, .csv)"
        raise SceneError("model", f'no bundled scene is called "{model}"', remedy)
    return import_module(f"{__name__}.{model}")

"""Registry of the bundled scenes.

Every bundled scene is a module of this package with a pydantic class `Parameters`, whose first field is
`friction_coefficient`, and a function `build(parameters, n_harmonics) -> ReducedModel`. A module is imported when its
scene is asked for, so that listing the scenes costs nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from studies.scene_error import SceneError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from solver.model import ReducedModel

BUNDLED = ("dovetail_sector", "sdof_slider", "two_masses", "vibro_impact")


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
    build = cast("Callable[[BaseModel, int], ReducedModel]", _scene_attribute(model, "build"))
    return build(parameters, n_harmonics)


def _scene_attribute(model: str, name: str) -> Any:
    if model not in BUNDLED:
        remedy = f"give one of {', '.join(BUNDLED)} or the path of a scene file"
        raise SceneError("model", f'no bundled scene is called "{model}"', remedy)
    return getattr(import_module(f"{__name__}.{model}"), name)

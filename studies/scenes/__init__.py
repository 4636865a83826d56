"""Registry of the bundled scenes.

Each is a module of this package with a class `Parameters`, a `studies.scene.Scene`. A module is imported when its
scene is asked for, so that listing the scenes costs nothing.
"""

import inspect
import sys
from importlib import import_module
from typing import TYPE_CHECKING, cast

from studies.scene_error import SceneError

if TYPE_CHECKING:
    from pydantic import BaseModel

    from solver.model import ReducedModel
    from studies.scene import Scene

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

AUTOMATIC_HARMONICS_OF_A_WAVE = 39
"""Fewest harmonics whose nodal diameters a cyclic scene is built with: automatic ones, and those that show an error."""


def scene_parameters(model: str) -> "type[Scene]":
    """Class of the parameters of a bundled scene. Raises SceneError where no bundled scene has this name."""
    if model not in BUNDLED:
        remedy = f"give one of {', '.join(BUNDLED)}, or the path of a scene file or of a model (.inp, .msh, .cdb, .csv)"
        raise SceneError("model", f'no bundled scene is called "{model}"', remedy)
    return cast("type[Scene]", import_module(f"{__name__}.{model}").Parameters)


def build_scene(model: str, parameters: "BaseModel", n_harmonics: int) -> "ReducedModel":
    """Reduced model of a bundled scene, with all nodal diameters that the harmonics 0..n_harmonics see.

    Raises SceneError where the parameters describe no possible structure.
    """
    # imported here: listing the scenes costs nothing
    from studies.scene import as_scene, build_compliant

    scene = as_scene(parameters)
    key = f"{model} {n_harmonics} {scene.model_dump_json(exclude={'contact_stiffness'})}"
    return build_compliant(model, key, scene.contact_stiffness, lambda: scene.build(n_harmonics))


def scene_help(model: str) -> str:
    """Markdown: what a bundled scene is, and a list of its parameters with default, meaning and unit.

    Raises SceneError where no bundled scene has this name.
    """
    parameters = scene_parameters(model)
    from studies.scene import list_keys

    about = inspect.getdoc(sys.modules[parameters.__module__]), inspect.getdoc(parameters)
    return "\n\n".join((f"## `{model}`", *(each or "" for each in about), list_keys(parameters)))

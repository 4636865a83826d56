"""What a bundled scene is and what its parameters are, as text from the scene itself."""

from __future__ import annotations

import inspect
import sys

from pydantic import BaseModel

from studies.scenes import scene_parameters


def scene_help(model: str) -> str:
    """Markdown: what a bundled scene is, and a list of its parameters with default, meaning and unit.

    Raises SceneError where no bundled scene has this name.
    """
    parameters = scene_parameters(model)  # imports the scene
    about = inspect.getdoc(sys.modules[f"studies.scenes.{model}"])
    texts = (f"## `{model}`", about or "", inspect.getdoc(parameters) or "", list_keys(parameters))
    return "\n\n".join(texts)


def list_keys(parameters: type[BaseModel]) -> str:
    """Markdown: a list of keys of [scene] with default, meaning and unit."""
    lines = []
    for name, field in parameters.model_fields.items():
        default = "" if field.default is None or field.is_required() else f" = {_shown(field.default)}"
        meaning = str(field.description).removesuffix(", 1").removesuffix(", -")
        lines.append(f"- `{name}{default}`: {meaning}")
    return "\n".join(lines)


def _shown(default: object) -> str:
    return f"{default:g}" if isinstance(default, float) else str(default).lower()

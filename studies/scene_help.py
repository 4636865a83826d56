"""What a bundled scene is and what its parameters are, as text: from the scene itself, so that it is never out of date.

`python -m studies.scene_help` prints the page `SCENES.md` of all of them.
"""

from __future__ import annotations

import inspect
import sys

from studies.scenes import BUNDLED, scene_parameters

_PAGE = """# Bundled scenes

The bundled scenes with their parameters, which are keys of `[scene]` in a study file: name, default, meaning, unit. A
study may also name [a scene file or a finite-element model](OWN_MODEL.md). `run-study --scene-help dovetail_sector`
prints one section; `python -m studies.scene_help` prints this page. `contact_stiffness` is explained in
[rough joints](ROUGH_JOINTS.md)."""


def scene_help(model: str) -> str:
    """Markdown: what a bundled scene is, and a list of its parameters with default, meaning and unit.

    Raises SceneError where no bundled scene has this name.
    """
    parameters = scene_parameters(model)
    whole = inspect.getdoc(sys.modules[f"studies.scenes.{model}"]) or ""
    lines = [f"## `{model}`", "", whole, "", inspect.getdoc(parameters) or "", ""]
    for name, field in parameters.model_fields.items():
        default = "" if field.default is None else f" = {_shown(field.default)}"
        lines.append(f"- `{name}{default}`: {str(field.description).removesuffix(', 1').removesuffix(', -')}")
    return "\n".join(lines)


def _shown(default: object) -> str:
    return f"{default:g}" if isinstance(default, float) else str(default).lower()


def all_scenes() -> str:
    """The page of all bundled scenes, Markdown."""
    return "\n\n".join([_PAGE, *(scene_help(model) for model in BUNDLED)]) + "\n"


if __name__ == "__main__":
    print(all_scenes(), end="")

"""What a bundled scene is and what its parameters are, as text: from the scene itself, so that it is never out of date.

`python -m studies.scene_help` prints the page `SCENES.md` of all of them.
"""

from __future__ import annotations

import inspect
import sys

from pydantic.fields import FieldInfo

from studies.scenes import BUNDLED, scene_parameters

_PAGE = """# Bundled scenes

The bundled scenes with their parameters, which are keys of `[scene]` in a study file. A study may also name
[a scene file or a finite-element model](OWN_MODEL.md). `run-study --scene-help dovetail_sector` prints the section of
one scene; `python -m studies.scene_help` prints this page."""


def scene_help(model: str) -> str:
    """Markdown: what a bundled scene is, and a table of its parameters with default and meaning.

    Raises SceneError where no bundled scene has this name.
    """
    parameters = scene_parameters(model)
    whole = inspect.getdoc(sys.modules[f"studies.scenes.{model}"]) or ""
    lines = [f"## `{model}`", "", whole, "", inspect.getdoc(parameters) or "", ""]
    lines += ["| parameter | default | meaning, unit |", "|---|---|---|"]
    for name, field in parameters.model_fields.items():
        lines.append(f"| `{name}` | {_default(field)} | {(field.description or '').replace('|', '/')} |")
    return "\n".join(lines)


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    if field.default is None:
        return "-"
    return f"{field.default:g}" if isinstance(field.default, float) else str(field.default).lower()


def all_scenes() -> str:
    """The page of all bundled scenes, Markdown."""
    return "\n\n".join([_PAGE, *(scene_help(model) for model in BUNDLED)]) + "\n"


if __name__ == "__main__":
    print(all_scenes(), end="")

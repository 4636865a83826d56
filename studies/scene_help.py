"""What a bundled scene is and what its parameters are, as text: from the scene itself, so that it is never out of date.

`python -m studies.scene_help` prints the page `SCENES.md` of all of them.
"""

from __future__ import annotations

import inspect
import sys

from studies.scenes import BUNDLED, scene_parameters

_PAGE = """# Bundled scenes

The keys in each section are those of `[scene]` in a study file; `run-study --scene-help dovetail_sector` prints what
each of them means, and its unit. A study may also name [a scene file or a finite-element model](OWN_MODEL.md).
`contact_stiffness` is explained in [rough joints](ROUGH_JOINTS.md), `python -m studies.scene_help` prints this page."""


def scene_help(model: str) -> str:
    """Markdown: what a bundled scene is, and a list of its parameters with default, meaning and unit.

    Raises SceneError where no bundled scene has this name.
    """
    lines = [*_head(model), inspect.getdoc(scene_parameters(model)) or "", ""]
    for key, meaning in _keys(model):
        lines.append(f"- `{key}`: {meaning.removesuffix(', 1').removesuffix(', -')}")
    return "\n".join(lines)


def all_scenes() -> str:
    """The page of all bundled scenes, Markdown."""
    sections = (
        "\n".join([*_head(model), ", ".join(f"`{key.replace(' ', '')}`" for key, _ in _keys(model))])
        for model in BUNDLED
    )
    return "\n\n".join([_PAGE, *sections]) + "\n"


def _head(model: str) -> list[str]:
    scene_parameters(model)  # imports the scene
    return [f"## `{model}`", "", inspect.getdoc(sys.modules[f"studies.scenes.{model}"]) or "", ""]


def _keys(model: str) -> list[tuple[str, str]]:
    """Each key with its default, and its meaning."""
    fields = scene_parameters(model).model_fields.items()
    return [
        (name + ("" if field.default is None else f" = {_shown(field.default)}"), str(field.description))
        for name, field in fields
    ]


def _shown(default: object) -> str:
    return f"{default:g}" if isinstance(default, float) else str(default).lower()


if __name__ == "__main__":
    print(all_scenes(), end="")

"""What is studied: scenes, scene files and the bundled studies. Imports the solver, and is imported by the runner.

For use in Python, from this package itself:

- `build_scene`: the reduced model of a bundled scene, by its name and parameters;
- `read_scene`: that of a scene file;
- `SceneError`: what both raise, in one sentence.

`scenes` makes reduced models, one file a scene, and `scene` is what all of them have; `scene_file` reads and writes
scene files (`model_check` what they must obey, `hdf5` how datasets are read). The `.toml` files are the bundled
studies, `notebooks` read their results.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studies.reduced_models import build_scene
    from studies.scene_error import SceneError
    from studies.scene_file import read_scene

__all__ = ["SceneError", "build_scene", "read_scene"]

# Loaded when first asked for: the commands import this package before numpy may be loaded.
_PLACES = {"SceneError": "scene_error", "build_scene": "reduced_models", "read_scene": "scene_file"}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

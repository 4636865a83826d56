"""What is studied: scenes, scene files and the bundled studies. Imports the solver, and is imported by the runner.

For use in Python, from this package itself:

- `build_scene`: the reduced model of a bundled scene, by its name and parameters;
- `read_scene`: that of a scene file;
- `SceneError`: what both raise, in one sentence.

`scenes` makes reduced models, one file a scene, and `scene` is what all of them have; `scene_file` reads and writes
scene files (`model_check` what they must obey, `hdf5` how datasets are read). The `.toml` files are the bundled
studies, `notebooks` read their results.
"""

from typing import TYPE_CHECKING

from studies.scene_error import SceneError, remedy_of
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE as OF_A_WAVE

if TYPE_CHECKING:
    from solver.model import ReducedModel
    from studies.scene_file import read_scene

__all__ = ["SceneError", "build_scene", "read_scene"]

# What is heavy is imported where it is used: the commands import this package before numpy may be loaded.


def build_scene(name: str, /, *, n_harmonics: int = OF_A_WAVE, **parameters: object) -> "ReducedModel":
    """Reduced model of a bundled scene, as a study with the same parameters has it.

    name: one of `studies.scenes.BUNDLED`, such as "dovetail_sector" or "sdof_slider". n_harmonics: a sector under a
    travelling wave holds the nodal diameters of so many harmonics; without influence on others. parameters: as in the
    table [scene] of a study, but for the friction coefficient, which is no part of the model: it is given to
    `solver.frequency_response` and `solver.march_wear`.

    Raises SceneError where there is no such scene or parameter, or the parameters describe no possible structure.
    """
    import numpy as np
    from pydantic import ValidationError

    from studies import scenes

    kind = scenes.scene_parameters(name)
    given = {key: value.item() if isinstance(value, np.generic) else value for key, value in parameters.items()}
    if "friction_coefficient" in given:
        remedy = "give it to the solver: it is no part of the model"
        raise SceneError("friction_coefficient", str(given["friction_coefficient"]), remedy)
    try:
        checked = kind.model_validate(given, strict=True)
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
        if isinstance(inner := wrong.get("ctx", {}).get("error"), SceneError):
            raise inner from None
        key = ".".join(str(part) for part in wrong["loc"])
        if wrong["type"] == "extra_forbidden":
            known = ", ".join(each for each in kind.model_fields if each != "friction_coefficient")
            raise SceneError(key, "unknown parameter", f"give one of {known}") from None
        raise SceneError(key or "parameters", str(wrong["input"]), remedy_of(wrong)) from None
    return scenes.build_scene(name, checked, n_harmonics)


def __getattr__(name: str) -> object:
    if name != "read_scene":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from studies.scene_file import read_scene

    return read_scene


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

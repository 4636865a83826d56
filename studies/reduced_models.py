"""The reduced model of a bundled scene by its name, in Python."""

from __future__ import annotations

import numpy as np
from pydantic import ValidationError

from solver.model import ReducedModel
from studies import scenes
from studies.scene_error import SceneError, remedy_of
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE as OF_A_WAVE


def build_scene(name: str, /, *, n_harmonics: int = OF_A_WAVE, **parameters: object) -> ReducedModel:
    """Reduced model of a bundled scene, as a study with the same parameters has it.

    name: one of `studies.scenes.BUNDLED`, such as "dovetail_sector" or "sdof_slider". n_harmonics: a sector under a
    travelling wave holds the nodal diameters of so many harmonics; without influence on others. parameters: as in the
    table [scene] of a study, but for the friction coefficient, which is no part of the model: it is given to
    `solver.frequency_response` and `solver.march_wear`.

    Raises SceneError where there is no such scene or parameter, or the parameters describe no possible structure.
    """
    kind = scenes.scene_parameters(name)
    given = {key: value.item() if isinstance(value, np.generic) else value for key, value in parameters.items()}
    if "friction_coefficient" in given:
        remedy = "give it to the solver: it is no part of the model"
        raise SceneError("friction_coefficient", str(given["friction_coefficient"]), remedy)
    try:
        checked = kind.model_validate(given, strict=True)
    except ValidationError as error:
        wrong = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in wrong["loc"])
        if wrong["type"] == "extra_forbidden":
            known = ", ".join(each for each in kind.model_fields if each != "friction_coefficient")
            raise SceneError(key, "unknown parameter", f"give one of {known}") from None
        raise SceneError(key or "parameters", str(wrong["input"]), remedy_of(wrong)) from None
    # far from what can be, numbers overflow; what is wrong with them is found by the checks of the model
    with np.errstate(all="ignore"):
        try:
            return scenes.build_scene(name, checked, n_harmonics)
        except SceneError:
            raise
        except (ArithmeticError, ValueError, MemoryError) as error:
            remedy = "give parameters of a possible structure"
            raise SceneError("model", f"{name} cannot be built: {error}", remedy) from None

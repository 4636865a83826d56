"""The scene of a study: builds or reads the reduced model, and tells what the runner has to know of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError
from studies.scenes import build_scene
from studyrunner.study import Study
from studyrunner.user_error import UserError, Verbatim

if TYPE_CHECKING:
    from solver.model import ReducedModel


@dataclass(frozen=True)
class SceneFacts:
    """What the plan and the result file say of a scene with n_contact pairs.

    n_displacements: relative displacements of all pairs, the unknowns of one harmonic coefficient.
    position (n_contact, 3), m; area (n_contact,), m2; surface: label of each pair; response_names: n_response texts.
    digest: SHA-256 over all arrays and names of the reduced model, hexadecimal.
    """

    n_displacements: int
    position: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: tuple[str, ...]
    response_names: tuple[str, ...]
    digest: str


def build_study_scene(study: Study) -> ReducedModel:
    """Reduced model of the study's scene, for the largest number of harmonics in the study.

    Raises UserError where the parameters or the scene file are wrong.
    """
    n_harmonics = int(max(study.solver_values("harmonics")))
    place, prefix = (str(study.scene_path), "") if study.scene.is_file else (study.source, "scene.")
    try:
        if not study.scene.is_file:
            return build_scene(study.scene.model, study.scene.parameters, n_harmonics)
        # h5py is loaded for scene files only: the bundled scenes do without it.
        from studies.scene_file import read_scene

        return read_scene(study.scene_path, n_harmonics)
    except SceneError as error:
        raise UserError(place, prefix + error.key, Verbatim(error.value), error.remedy) from None
    except OSError as error:
        raise UserError(place, "the scene file", None, f"give a file that can be read: {error.strerror}") from None


def write_study_scene(study: Study, path: Path) -> None:
    """Writes the scene of a study as a scene file, whole or not at all. Raises UserError where the scene is wrong."""
    from studies.scene_file import write_scene

    write_scene(build_study_scene(study), path)


def describe_scene(model: ReducedModel) -> SceneFacts:
    """Facts of a reduced model."""
    contact = model.contact
    return SceneFacts(
        n_displacements=int(np.count_nonzero(np.asarray(contact.dofs) >= 0)),
        position=contact.position,
        area=contact.area,
        surface=contact.surface,
        response_names=model.response_names,
        digest=_digest(model),
    )


def _digest(model: ReducedModel) -> str:
    digest = hashlib.sha256()
    for name, value in _parts(model):
        array = np.ascontiguousarray(value)
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _parts(model: ReducedModel) -> Iterator[tuple[str, object]]:
    """Everything that a reduced model holds, in an order that does not depend on how it was made."""
    for nodal_diameter, linear in sorted(model.linear.items()):
        for name in ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response"):
            yield f"{nodal_diameter} {name}", getattr(linear, name)
    for name in ("dofs", "area", "gap", "normal_load", "position"):
        yield name, getattr(model.contact, name)
    texts = "\n".join((*model.contact.surface, "", *model.response_names))
    yield "texts", np.frombuffer(texts.encode(), dtype=np.uint8)
    yield "sectors", np.array([model.n_sectors, model.nodal_diameter], dtype=np.int64)

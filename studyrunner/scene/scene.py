"""The scene of a study: builds or reads the reduced model and describes the scene for the runner."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import surface_factors
from studies.fe_models.files import file_digest
from studies.scene import as_scene, make_compliant, stuck_frequencies
from studies.scene_error import SceneError
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE, build_scene
from studyrunner.scene.edge_pairs import edge_pairs
from studyrunner.study.mistakes import raise_wrong, scene_errors
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.machine import package_digest
from studyrunner.values import Wrong
from studyrunner.variables import LOOP_COMPONENTS, LOOP_PHASES, LOOPS

if TYPE_CHECKING:
    from solver.model import ReducedModel
    from studies.scene import SurfaceMesh

_LARGEST_HISTORY = 1e9  # bytes: a result is one message between ranks


@dataclass(frozen=True)
class SceneFacts:
    """Facts of a scene with n_contact pairs, for the plan and the result file.

    n_displacements: number of relative displacements, the unknowns of one harmonic coefficient.
    position (n_contact, 3): m. area (n_contact,): m2. surface: label of each pair. response_names: n_response texts.
    digest: SHA-256 of all arrays and names of the reduced model, hexadecimal.
    largest_harmonics: largest number of harmonics for this scene; None without limit.
    stuck_frequency: Hz, first natural frequency with the joint stuck; NaN where there is none.
    edge (n_contact,): whether a pair is at the edge of the contact (`edge_pairs`); False where unknown.
    gap, friction_coefficient (n_contact,): m and 1, of each pair; friction None where the study gives one for all.
    """

    n_displacements: int
    position: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: tuple[str, ...]
    response_names: tuple[str, ...]
    digest: str
    largest_harmonics: int | None = None
    stuck_frequency: float = math.nan
    edge: NDArray[np.bool_] | None = None
    gap: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    friction_coefficient: NDArray[np.float64] | None = None

    @cached_property
    def pairs(self) -> Hashable:
        """Where and how large the contact pairs are; equal for scenes with the same pairs."""
        return self.surface, self.position.tobytes(), self.area.tobytes()


def _silent(_: str) -> None: ...


def build_study_scene(
    study: Study, progress: Callable[[str], None] = _silent, known: ReducedModel | None = None
) -> ReducedModel:
    """Reduced model of the scene for the largest number of harmonics of the study and those that show the error.

    With automatic harmonics a bundled scene is built for at least AUTOMATIC_HARMONICS_OF_A_WAVE; a scene file may hold
    fewer, see `largest_harmonics`. progress: takes a line on the next step, where a step may take long. known: the
    model from an earlier run. Raises UserError where the parameters or the scene file are wrong, or the scene lacks
    what the study asks for.
    """
    scene = study.scene
    # far from what can be, numbers overflow; what is wrong with them is found by the checks of the model
    with scene_errors(study.source, scene.path), np.errstate(all="ignore"):
        if known is not None:
            model = known
        elif scene.path is None:
            model = _build_here(study, progress)
        else:
            # h5py is loaded for scene files only: the bundled scenes do without it.
            from studies.scene_file import read_scene

            model = read_scene(scene.path, max(study.given_harmonics, default=1), scene.group)
            # a scene in a result file is the one that was computed with
            if not scene.group:
                model = make_compliant(model, dict(scene.parameters)["contact_stiffness"])
    raise_wrong(study.source, _wrong_beside(study, model))
    if "natural_frequency" in study.scene_variables:
        with scene_errors(study.source, None):
            stuck_frequencies(model)
    return model


def harmonics_to_build(study: Study) -> int:
    """Number of harmonics that a scene is built for, those that show the error of a given number included."""
    # two levels up: 1, 3, 5, 7, 9, 13, 19, 27...
    shown = 2 * max(study.given_harmonics, default=0) + 3
    return max(shown, AUTOMATIC_HARMONICS_OF_A_WAVE) if AUTO in study.solver.harmonics else shown


def model_key(study: Study) -> str:
    """Hash under which the model of a scene is kept: of its parameters and files, and of the source of the scenes."""
    sources = [package_digest(package) for package in ("studies", "solver")]
    content = None if study.scene.path is None else file_digest(study.scene.path)
    own = study.scene.model, study.scene.of_model, describe_origin(study), content, harmonics_to_build(study)
    return hashlib.sha256(json.dumps((sources, own), sort_keys=True).encode()).hexdigest()[:32]


def describe_origin(study: Study) -> dict[str, str]:
    """Attributes on the files of a finite-element model; none for other scenes. Raises OSError, SceneError."""
    # imported where they are used: most studies have no such model
    if study.scene.files is not None:
        from studies.fe_models.from_files.model import describe_origin as describe_files

        return describe_files(study.scene.files, study.scene.parameters)
    if study.scene.path is None:
        return {}
    from studies.scene_file import read_origin

    return read_origin(study.scene.path)


def _build_here(study: Study, progress: Callable[[str], None]) -> ReducedModel:
    scene, n_harmonics = study.scene, harmonics_to_build(study)
    try:
        if scene.files is None:
            return build_scene(scene.model, scene.parameters, n_harmonics)
        from studies.fe_models.from_files.model import build

        return build(scene.files, scene.parameters, n_harmonics, progress)
    except SceneError:
        raise
    except (ArithmeticError, ValueError, MemoryError) as error:
        # what a parameter alone does not show: LinAlgError is a ValueError, too
        what = f"{study.scene.model} cannot be built: {error}"
        raise SceneError("model", what, "give parameters of a possible structure") from None


def _wrong_beside(study: Study, model: ReducedModel) -> Iterator[Wrong]:
    """What of a study does not fit to the pairs of its scene."""
    contact, friction, loops = model.contact, study.friction_coefficient, study.outputs.loops
    given = contact.friction_coefficient is not None
    if study.scene.path is not None and given == (friction is not None):
        file = "contact/friction_coefficient in the scene file"
        remedy = f"leave it out: {file} gives each pair its own" if given else f"missing: give it, or {file}"
        yield Wrong("scene.friction_coefficient", friction, remedy)
    if study.wear.surfaces is not None:
        try:
            surface_factors(contact.surface, study.wear.as_law.surfaces)
        except ValueError as error:
            yield Wrong("wear.surfaces", study.wear.surfaces, str(error))
    if loops and max(loops) >= contact.n_contact:
        remedy = f"give indices from 0 to {contact.n_contact - 1}, the contact pairs of the scene"
        yield Wrong("outputs.loops", max(loops), remedy)
    facts = SceneFacts(0, contact.position, contact.area, contact.surface, model.response_names, "")
    if (size := 8.0 * values_of_point(study, facts)) > _LARGEST_HISTORY:
        key, value = ("outputs.loops", list(loops)) if loops else ("slow_time.outputs", len(study.output_counts))
        yield Wrong(key, value, f"give fewer, or fewer slow_time.outputs: one point would take {1e-9 * size:.1f} GB")


def variable_sizes(study: Study, facts: SceneFacts) -> dict[str, int]:
    """Lengths of the dimensions after the axes."""
    counted = {study.kind.counted: len(study.output_counts)} if study.kind.counted else {}
    blocks = {"block": len(study.mission)} if study.mission else {}
    loops = {"phase": LOOP_PHASES, "component": len(LOOP_COMPONENTS)} if study.outputs.loops else {}
    return {**counted, **blocks, "contact": len(facts.area), "response": len(facts.response_names), **loops}


def record_fields(study: Study, facts: SceneFacts) -> list[tuple[str, str, tuple[int, ...]]]:
    """Name, data type and shape of each value of a result."""
    sizes, fields = variable_sizes(study, facts), []
    for name, entry in {**study.kind.always, **study.recorded}.items():
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return fields


def values_of_point(study: Study, facts: SceneFacts) -> int:
    """Number of values in a result."""
    return sum(math.prod(shape) for _, _, shape in record_fields(study, facts))


def build_mesh(study: Study) -> SurfaceMesh | None:
    """Mesh of the study's scene, None where it has none. Raises SceneError."""
    scene = study.scene
    if "mesh" not in scene.offers:
        return None
    if scene.files is not None:
        from studies.fe_models.from_files.model import describe_model_mesh

        return describe_model_mesh(scene.files, scene.parameters)
    if scene.path is None:
        return as_scene(scene.parameters).describe_mesh()
    from studies.scene_file import read_mesh

    return read_mesh(scene.path, scene.group)


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
        largest_harmonics=largest_harmonics(model),
        edge=edge_pairs(contact),
        gap=contact.gap,
        friction_coefficient=contact.friction_coefficient,
        stuck_frequency=_stuck_frequency(model),
    )


def _stuck_frequency(model: ReducedModel) -> float:
    """First natural frequency, Hz, with the joint stuck; NaN where nothing moves or holds."""
    try:
        found = stuck_frequencies(model)
    except SceneError:
        return math.nan
    # of a wave that travels backwards, those of its image
    return float(found[min(model.nodal_diameter, abs(model.n_sectors - model.nodal_diameter))][0])


def largest_harmonics(model: ReducedModel) -> int | None:
    """Largest number of harmonics for which the model has all nodal diameters; None without limit."""
    # After n_sectors harmonics the nodal diameters come again.
    for harmonic in range(1, model.n_sectors):
        try:
            model.harmonic_structure(harmonic)
        except KeyError:
            return harmonic - 1
    return None


def _digest(model: ReducedModel) -> str:
    digest = hashlib.sha256()
    for name, value in _parts(model):
        array = np.ascontiguousarray(value)
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _parts(model: ReducedModel) -> Iterator[tuple[str, object]]:
    """All arrays and names of a reduced model, in a fixed order."""
    for nodal_diameter, linear in sorted(model.linear.items()):
        for name in ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response"):
            yield f"{nodal_diameter} {name}", getattr(linear, name)
    for name in ("dofs", "area", "gap", "normal_load", "position"):
        yield name, getattr(model.contact, name)
    for name in ("friction_coefficient", "edge"):
        if getattr(model.contact, name) is not None:
            yield name, getattr(model.contact, name)
    texts = "\n".join((*model.contact.surface, "", *model.response_names))
    yield "texts", np.frombuffer(texts.encode(), dtype=np.uint8)
    yield "sectors", np.array([model.n_sectors, model.nodal_diameter], dtype=np.int64)

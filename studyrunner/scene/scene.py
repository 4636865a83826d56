"""The scene of a study: builds or reads the reduced model and describes the scene for the runner."""

import contextlib
import hashlib
import json
import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import surface_factors
from solver.model import ContactInterface, ReducedModel
from studies.scene import Progress, silent, stuck_frequencies
from studies.scene_error import SceneError
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE
from studies.sectors import ring_of
from studyrunner.kinds.wear.kind import LOOP_COMPONENTS, LOOP_PHASES, LOOPS
from studyrunner.study.mistakes import raise_wrong, scene_errors
from studyrunner.study.study import Study
from studyrunner.system.machine import package_digest
from studyrunner.system.progress import count
from studyrunner.user_error import UserError, Verbatim
from studyrunner.values import Wrong

_LARGEST_HISTORY = 1e9  # bytes: a result is one message between ranks


_OTHER_UNIT = 100.0
"""Ratio of a value to its default from which its unit is asked about: of mm and GPa it is at least 1000."""


@dataclass(frozen=True)
class SceneFacts:
    """Facts of a scene, for the plan and the result file.

    n_displacements: number of relative displacements, the unknowns of one harmonic coefficient. contact: its pairs.
    response_names: n_response texts. digest: SHA-256 of all arrays and names of the reduced model. largest_harmonics:
    None without limit. stuck_frequency: Hz, first natural frequency with the joint stuck; NaN where there is none.
    edge (n_contact,): see `edge_pairs`. n_ring: sectors, of a ring of which pairs and responses are; else 1. differ:
    whether its blades may differ.
    """

    n_displacements: int
    contact: ContactInterface
    response_names: tuple[str, ...]
    digest: str
    largest_harmonics: int | None = None
    stuck_frequency: float = math.nan
    edge: NDArray[np.int8] | None = None
    n_ring: int = 1
    differ: bool = False

    @cached_property
    def pairs(self) -> Hashable:
        """Where and how large the contact pairs are; equal for scenes with the same pairs."""
        return self.contact.surface, self.contact.position.tobytes(), self.contact.area.tobytes()


def build_study_scene(study: Study, progress: Progress = silent, known: ReducedModel | None = None) -> ReducedModel:
    """Reduced model of the scene of a study, for `harmonics_to_build`; a scene file may hold fewer.

    known: the model from an earlier run. Raises UserError where the parameters or the scene file are wrong, or the
    scene lacks what the study asks for.
    """
    source, own = study.scene.source, study.scene.parameters
    least = max(study.given_harmonics, default=1)
    with scene_errors(study.source, source.path), np.errstate(all="ignore"):
        try:
            model = source.build(own, least, harmonics_to_build(study), progress) if known is None else known
        except SceneError as error:
            key, value, default = farthest_from_default(study)
            if key in ("", error.key):
                raise
            remedy = f"check its unit, its default is {default:g}; else see {error.key}, {error.value}: {error.remedy}"
            raise SceneError(key, f"{value:g}", remedy) from error
    raise_wrong(study.source, _wrong_beside(study, _ring_of(study, model)))
    if "natural_frequency" in study.scene_variables:
        with scene_errors(study.source, None):
            stuck_frequencies(model)
    return model


def _ring_of(study: Study, model: ReducedModel) -> ReducedModel:
    """The ring that a study computes, of a sector; the model itself where it computes none. Raises UserError."""
    ring = study.scene.ring
    if ring is None:
        return model
    with scene_errors(study.source, None):
        whole = ring_of(model)
    if model.nodal_diameter and study.scene.forced_sector is not None:
        remedy = "give a scene of nodal diameter 0, or leave it out: the travelling wave excites all sectors"
        raise UserError(study.source, "scene.forced_sector", study.scene.forced_sector, remedy)
    place, n = str(study.folder / ring.file) if ring.file else study.source, model.n_sectors
    for name, n_pairs in (("frequency", 1), ("friction", 1), ("wear_depth", model.contact.n_contact)):
        given = len(getattr(ring, name))
        if given in (0, n, n_pairs * n):
            continue
        key = "column sector" if ring.file else f"scene.sectors.{name}"
        found, remedy = count(given, "sector"), f"give each of the {n} sectors of the scene, 0 to {n - 1}, once"
        if name == "wear_depth" and given % n == 0:
            key = "column result" if ring.file else key
            found, remedy = count(given // n, "pair"), f"give results of one sector, which has {count(n_pairs, 'pair')}"
        raise UserError(place, key, Verbatim(found), remedy)
    return whole


def farthest_from_default(study: Study) -> tuple[str, float, float]:
    """Key, value and usual value of the number of a scene that is farthest, `_OTHER_UNIT` times at least, from what is
    usual; else "", 0, 0.
    """
    distance, found = math.log(_OTHER_UNIT), ("", 0.0, 0.0)
    for name, usual in study.scene.source.usual.items():
        value = getattr(study.scene.parameters, name)
        is_number = isinstance(value, float) and value > 0.0
        if is_number and (far := abs(math.log(value / usual))) > distance:
            distance, found = far, (name, value, usual)
    return found


def harmonics_to_build(study: Study) -> int:
    """Number of harmonics that a scene is built for: the largest of the study, and those that show its error."""
    # two levels up: 1, 3, 5, 7, 9, 13, 19, 27...
    return max(2 * max(study.given_harmonics, default=0) + 3, AUTOMATIC_HARMONICS_OF_A_WAVE)


def model_key(study: Study) -> str:
    """Hash under which the model of a scene is stored: of its parameters and files, and of the source of the scenes.

    Raises UserError where a file cannot be read.
    """
    sources = [package_digest(package) for package in ("studies", "solver")]
    with scene_errors(study.source, study.scene.source.path):
        own = *study.scene.source.key(study.scene.parameters), harmonics_to_build(study)
    return hashlib.sha256(json.dumps((sources, own), sort_keys=True).encode()).hexdigest()[:32]


def _wrong_beside(study: Study, model: ReducedModel) -> Iterator[Wrong]:
    """What of a study does not fit to the pairs of its scene."""
    contact, friction, loops = model.contact, study.friction_coefficient, study.outputs.loops
    given = contact.friction_coefficient is not None
    ring, file = study.scene.ring, "contact/friction_coefficient in the scene file"
    own = "friction_coefficient" in study.evolving or bool(ring and ring.friction)
    if study.scene.source.path is not None and own and given:
        remedy = f"leave it out: {file} gives each pair its own"
        yield Wrong("scene.sectors" if ring and ring.friction else "wear.evolution.friction_coefficient", None, remedy)
    elif study.scene.source.path is not None and given == (friction is not None) and not own:
        remedy = f"leave it out: {file} gives each pair its own" if given else f"missing: give it, or {file}"
        yield Wrong("scene.friction_coefficient", friction, remedy)
    if study.wear.surfaces is not None:
        try:
            surface_factors(contact.surface, study.wear.as_law.surfaces)
        except ValueError as error:
            yield Wrong("wear.surfaces", study.wear.surfaces, str(error))
    for name, tables in study.evolving.items():
        labels = [*dict.fromkeys(contact.surface)]
        if "" not in tables and {*tables} != {*labels}:
            remedy = f"give a list to each of the surfaces {', '.join(labels)}, and to no other"
            yield Wrong(f"wear.evolution.{name}", [*tables], remedy)
    if loops and max(loops) >= contact.n_contact:
        remedy = f"give indices from 0 to {contact.n_contact - 1}, the contact pairs of the scene"
        yield Wrong("outputs.loops", max(loops), remedy)
    if (size := 8.0 * values_of_point(study, SceneFacts(0, contact, model.response_names, ""))) > _LARGEST_HISTORY:
        key, value = ("outputs.loops", list(loops)) if loops else ("slow_time.outputs", len(study.output_counts))
        yield Wrong(key, value, f"give fewer, or fewer slow_time.outputs: one point would take {1e-9 * size:.1f} GB")


def dimensions_behind(study: Study, facts: SceneFacts) -> dict[str, Sequence[object] | NDArray[np.generic]]:
    """The dimensions after the axes, with their values."""
    kind, found = study.kind, dict[str, Sequence[object] | NDArray[np.generic]]()
    if kind.counted:
        found[kind.counted] = np.array(study.output_counts, dtype=int if kind.whole else float)
    found |= {**kind.dimensions(study), "contact": range(facts.contact.n_contact), "response": facts.response_names}
    if study.scene.ring is not None:
        found["sector"] = range(facts.n_ring)
    if study.outputs.loops:
        found |= {"phase": 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES, "component": LOOP_COMPONENTS}
    return found


def record_fields(study: Study, facts: SceneFacts) -> list[tuple[str, str, tuple[int, ...]]]:
    """Name, data type and shape of each value of a result."""
    sizes, fields = {name: len(values) for name, values in dimensions_behind(study, facts).items()}, []
    for name, entry in {**study.kind.always, **study.recorded}.items():
        # of all pairs, only those asked for have a loop
        lengths = {**sizes, "contact": len(study.outputs.loops)} if name in LOOPS else sizes
        fields.append((name, entry.dtype, tuple(lengths[dimension] for dimension in entry.dimensions)))
    return fields


def values_of_point(study: Study, facts: SceneFacts) -> int:
    """Number of values in a result."""
    return sum(math.prod(shape) for _, _, shape in record_fields(study, facts))


def describe_study_scene(study: Study, model: ReducedModel) -> SceneFacts:
    """Facts of the scene of a study; of a ring those of all its sectors. model: of a ring that of one sector."""
    facts = describe_scene(model)
    if study.scene.ring is None:
        return facts
    whole, n = _ring_of(study, model), model.n_sectors
    return replace(
        facts,
        n_displacements=n * facts.n_displacements,
        contact=whole.contact,
        response_names=whole.response_names,
        edge=None if facts.edge is None else np.tile(facts.edge, n),
        n_ring=n,
        differ=all(each.blade is not None for each in model.linear.values()),
    )


def describe_scene(model: ReducedModel) -> SceneFacts:
    """Facts of a reduced model."""
    contact, digest, stuck = model.contact, hashlib.sha256(), math.nan
    # NaN where nothing moves, or nothing holds the structure
    with contextlib.suppress(SceneError):
        # of a wave that travels backwards, those of its image
        nodal_diameter = min(model.nodal_diameter, abs(model.n_sectors - model.nodal_diameter))
        stuck = float(stuck_frequencies(model)[nodal_diameter][0])
    for name, value in _parts(model):
        array = np.ascontiguousarray(value)
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode() + array.tobytes())
    return SceneFacts(
        n_displacements=int(np.count_nonzero(np.asarray(contact.dofs) >= 0)),
        contact=contact,
        response_names=model.response_names,
        digest=digest.hexdigest(),
        largest_harmonics=largest_harmonics(model),
        stuck_frequency=stuck,
        edge=edge_pairs(contact),
    )


def largest_harmonics(model: ReducedModel) -> int | None:
    """Largest number of harmonics for which the model has all nodal diameters; None without limit."""
    # After n_sectors harmonics the nodal diameters come again.
    for harmonic in range(1, model.n_sectors):
        if not model.has_harmonics(harmonic):
            return harmonic - 1
    return None


def _parts(model: ReducedModel) -> Iterator[tuple[str, object]]:
    """All arrays and names of a reduced model, in a fixed order."""
    for nodal_diameter, linear in sorted(model.linear.items()):
        for name in ("mass", "damping", "stiffness", "load_static", "load_harmonic", "response"):
            yield f"{nodal_diameter} {name}", getattr(linear, name)
        if linear.blade is not None:
            yield f"{nodal_diameter} blade", linear.blade
    for name in ("dofs", "area", "gap", "normal_load", "position"):
        yield name, getattr(model.contact, name)
    for name in ("friction_coefficient", "edge"):
        if getattr(model.contact, name) is not None:
            yield name, getattr(model.contact, name)
    texts = "\n".join((*model.contact.surface, "", *model.response_names))
    yield "texts", np.frombuffer(texts.encode(), dtype=np.uint8)
    yield "sectors", np.array([model.n_sectors, model.nodal_diameter], dtype=np.int64)


# --- pairs at the edge of their surface ---
# A pair is inside where its neighbours surround it. Neighbours are those of a Delaunay triangulation in the plane of
# the surface, which a structured mesh of any side ratio and an unstructured one have alike. By hand: libraries of alpha
# shapes ask for a length, which cells that are long and thin do not have.

_FLAT = 0.1
"""Of its smaller extent in the plane: a surface that is less flat, as one that closes on itself, is not looked at."""
_SAME_PLACE = 1e-6
"""Of the extent of the surface: what is less is round-off."""
_WIDEST_GAP = 0.75 * np.pi
"""Angle between one neighbour and the next, from which on a pair is at the edge. Measured inside: pi / 2 on meshes of
rows and columns with side ratios of 0.05 to 20, at most 2.13 on random points that keep a distance; rows 20 times as
dense as their shift, or such cells moved at random by a tenth, are taken for edge. At a straight edge it is pi."""
_NOT_KNOWN = 2
_LONGEST = 2.5
"""Over the median distance to its neighbours: what is farther is across a hole or a notch."""


def edge_pairs(contact: ContactInterface) -> NDArray[np.int8]:
    """Whether pairs (n_contact,) are at the edge of their surface, 1 or 0: those that the scene names, else by their
    positions.

    2, not known, of a surface that has nothing but edge, whose positions are not known, or which is not flat.
    """
    if contact.edge is not None:
        return np.array(contact.edge, np.int8)
    found, labels = np.zeros(contact.n_contact, np.int8), np.array(contact.surface)
    for surface in np.unique(labels):
        own = np.flatnonzero(labels == surface)
        edge = _edge(np.asarray(contact.position)[own])
        found[own] = _NOT_KNOWN if edge is None or edge.all() else edge
    return found


def _edge(position: NDArray[np.float64]) -> NDArray[np.bool_] | None:
    """Of one surface, positions (n, 3), m; None where it cannot be found."""
    if len(position) < 3 or not np.isfinite(position).all():
        return None
    centred = position - position.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2].T
    extent = np.ptp(along, axis=0)
    if extent[0] == 0.0 or extent[2] > max(_FLAT * extent[1], _SAME_PLACE * extent[0]):
        return None
    if extent[1] <= _SAME_PLACE * extent[0]:
        ends = np.abs(along[:, 0, None] - [along[:, 0].min(), along[:, 0].max()])
        return np.asarray((ends <= _SAME_PLACE * extent[0]).any(axis=1))
    from scipy.spatial import Delaunay, QhullError  # where it is used: it takes a while to load

    plane = along[:, :2]
    try:
        mesh = Delaunay(plane)
    except QhullError:
        return None
    first, neighbours = mesh.vertex_neighbor_vertices
    found = np.array([_is_edge(plane[neighbours[first[i] : first[i + 1]]] - plane[i]) for i in range(len(plane))])
    # of several pairs at one place a single one is a corner of the triangulation
    found[mesh.coplanar[:, 0]] = found[mesh.coplanar[:, 2]]
    return found


def _is_edge(away: NDArray[np.float64]) -> bool:
    """Whether neighbours, (n, 2) from the pair, leave a side open."""
    distance = np.linalg.norm(away, axis=1)
    near = away[distance <= _LONGEST * np.median(distance)] if len(away) else away
    angles = np.sort(np.arctan2(near[:, 1], near[:, 0]))
    return angles.size < 3 or bool(np.diff(angles, append=angles[0] + 2.0 * np.pi).max() > _WIDEST_GAP)

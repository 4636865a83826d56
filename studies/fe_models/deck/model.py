"""What a deck says beside its mesh, while it is read and put together once all of it is read."""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from studies.fe_models.deck.contents import NODES_OF_KIND, Deck, Material, RigidMotion, SurfacePair
from studies.fe_models.deck.keywords import Block
from studies.fe_models.deck.mesh import Draft, Mesh, Records
from studies.fe_models.deck.sets import NONE, Numbers
from studies.fe_models.files import FloatArray, IntArray, Place, shown
from studies.scene_error import SceneError

_SAME_AXIS = 1e-6  # distance of two axes over the distance of the points that give them


@dataclass
class MaterialRows:
    """A material: rows of *ELASTIC and *DENSITY, the temperature last, by keyword, and where they stand."""

    rows: dict[str, list[list[float]]] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)
    problem: str = ""


@dataclass
class Step:
    """A step. before: the fields before it. writes: whether it writes matrices. fresh: without centrifugal load yet."""

    before: dict[str, dict[Hashable, list[Any]]]
    kind: str = ""
    writes: bool = False
    fresh: bool = True

    @property
    def loads_count(self) -> bool:
        """Whether its loads are static ones."""
        return self.kind in ("", "STATIC", "VISCO")


@dataclass
class Model:
    """All that was read so far.

    fields: entries of the fields of the deck in the order of the file, by a key for those that may be replaced.
    interactions: by name what they say of a `SurfacePair`, by its fields. interaction, material: those that the next
    keywords are about. thermal: where temperatures and expansion stand. coupling: a *COUPLING that does not say yet
    what it couples.
    """

    mesh: Mesh
    fields: dict[str, dict[Hashable, list[Any]]] = field(default_factory=dict)
    interactions: dict[str, dict[str, Any]] = field(default_factory=dict)
    interaction: dict[str, Any] | None = None
    materials: dict[str, MaterialRows] = field(default_factory=dict)
    material: MaterialRows | None = None
    thermal: dict[str, Place] = field(default_factory=dict)
    coupling: Block | None = None
    step: Step | None = None
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, name: str, *items: Any, key: Hashable = None) -> None:
        """Adds entries of a field of the deck; those of the same key, which is not None, are replaced."""
        entries = self.fields.setdefault(name, {})
        entries[len(entries) if key is None else key] = list(items)

    def get(self, name: str) -> list[Any]:
        """Entries of a field."""
        return [item for items in self.fields.get(name, {}).values() for item in items]

    def check_coupling(self) -> None:
        """Raises SceneError where a coupling does not say what it couples."""
        if self.coupling is not None:
            found = "no *KINEMATIC or *DISTRIBUTING below it"
            raise self.coupling.place.wrong(found, "write it there, or remove the coupling")

    def end_step(self) -> None:
        """Of a step that writes matrices nothing stays, of one that is not static no load."""
        step, self.step = self.step, None
        if step is None:
            return
        for name in list(self.fields):
            if step.writes or (name in ("forces", "pressures", "gravity") and not step.loads_count):
                self.fields[name] = step.before.get(name, {})

    def follow(self, place: Place, nodes: IntArray, dofs: tuple[int, ...], reference: int, rotation: int = 0) -> None:
        """Nodes that follow a reference node; rotation: -1 where they do not turn with it, else as in `RigidMotion`."""
        nodes = nodes[(nodes != reference) & (nodes != rotation)]
        if not nodes.size:
            raise place.wrong("no node follows the reference node", "give the nodes that are rigid")
        self.add("rigid_motions", RigidMotion(str(place), nodes, dofs, reference, max(rotation, 0), rotation >= 0))

    def deck(self) -> Deck:
        """The deck. Raises SceneError where names are missing or do not fit."""
        self.check_coupling()
        mesh, gone = self.mesh, NONE
        for removed, elements, _ in self.get("removed"):
            gone = np.union1d(gone, elements) if removed else np.setdiff1d(gone, elements)
        solid = [(block, ~np.isin(block.numbers, gone)) for block in mesh.solid_blocks]
        faces = {name: (surface, ~np.isin(surface.elements, gone)) for name, surface in mesh.surfaces.items()}
        kept = np.setdiff1d(np.concatenate([NONE, *(block.numbers for block in mesh.solid_blocks)]), gone)
        names = ("boundaries", "transforms", "equations", "rigid_motions", "mean_motions", "forces", "pressures")
        fields: dict[str, Any] = {name: tuple(self.get(name)) for name in names}
        loads = [load for load in self.get("centrifugal") if np.isin(load.elements, kept).any() or not kept.size]
        changes = [text for taken, _, text in (*self.get("removed"), *self.get("apart")) if taken]
        for section, place in self.get("sections"):
            if section.material not in self.materials:
                raise place.wrong(f"there is no material {shown(section.material)}", "define it with *MATERIAL")
        ties, named = self.get("ties"), [name for _, name, *_ in self.get("cyclic") if name]
        cut = [pair for name, cyclic, pair in ties if cyclic and (not named or name in named)]
        return Deck(
            path=mesh.draft.name,
            node_numbers=mesh.numbers,
            coordinates=mesh.coordinates,
            blocks=tuple(
                replace(block, numbers=block.numbers[own], nodes=block.nodes[own]) for block, own in solid if own.any()
            ),
            node_sets=mesh.node_sets,
            element_sets={name: np.intersect1d(members, kept) for name, members in mesh.element_sets.items()},
            surfaces={
                name: replace(each, elements=each.elements[own], faces=each.faces[own])
                for name, (each, own) in faces.items()
            },
            ties=tuple(pair for _, cyclic, pair in ties if not cyclic),
            contact_pairs=tuple(self._contact_pairs()),
            cyclic=self._cyclic(),
            cut_faces=tuple((pair.dependent, pair.independent) for pair in cut),
            materials={name: self._material(each) for name, each in self.materials.items()},
            sections=tuple(section for section, _ in self.get("sections")),
            centrifugal=tuple(loads),
            gravity=self._gravity(kept),
            n_instances=len(mesh.draft.placed),
            unassembled=tuple(text for text, _ in self.get("unassembled")),
            skipped=(*self.skipped, *self._idle()),
            notes=(*mesh.notes, *self.notes, *changes),
            included=tuple(mesh.draft.included),
            **fields,
        )

    def _idle(self) -> Iterator[str]:
        """Elements that are not read, and carry nothing as no section has them."""
        carry = np.concatenate([NONE, *(own for _, own in self.get("unassembled"))])
        for each in self.mesh.draft.elements:
            own = each.numbers + self.mesh.offsets[each.scope]
            if each.kind not in NODES_OF_KIND and not np.isin(own, carry).all():
                yield f"{each.place} of type {each.kind} without a section"

    def _gravity(self, kept: IntArray) -> FloatArray | None:
        total = None
        for elements, acceleration, place in self.get("gravity"):
            if not np.isin(kept, elements).all():
                raise place.wrong("GRAV on a part of the elements", "give it to all of them")
            total = acceleration + (0.0 if total is None else total)
        return total

    def _material(self, material: MaterialRows) -> Material:
        """Values at the temperature of all nodes; of several temperatures without one they are a problem."""
        given, thermal = self.get("temperatures"), self.thermal
        if thermal.keys() >= {"TEMPERATURE", "EXPANSION"}:
            raise thermal["TEMPERATURE"].wrong("it strains materials with *EXPANSION", "remove one of them")
        warm = np.concatenate([NONE, *(nodes for nodes, _ in given)])
        everywhere = "TEMPERATURE" not in thermal and all(np.isin(b.nodes, warm).all() for b in self.mesh.solid_blocks)
        values = {value for _, value in given} if everywhere else set()
        problem, found = material.problem, list[float | None]()
        for name, column, n_values in (("ELASTIC", 0, 2), ("ELASTIC", 1, 2), ("DENSITY", 0, 1)):
            own = {(row[n_values] if len(row) > n_values else 0.0): row[column] for row in material.rows.get(name, ())}
            if len(set(own.values())) > 1 and len(values) != 1:
                problem = problem or f"{material.places[name]} at several temperatures, of which none is given"
            at = sorted(own)
            value = np.interp(min(values, default=0.0), at, [own[each] for each in at]) if own else None
            found.append(None if value is None else float(value))
        young, poisson, density = found
        return Material(young, poisson, density, problem)

    def _contact_pairs(self) -> Iterator[SurfacePair]:
        """Contact pairs with laws and clearances, without those that *MODEL CHANGE takes away."""
        apart: set[frozenset[str]] = set()
        for removed, names, _ in self.get("apart"):
            apart = apart | {frozenset(names)} if removed else apart - {frozenset(names)}
        pairs = self.get("contact_pairs")
        fits: dict[frozenset[str], tuple[str, float | None]] = {}
        for names, value, place in self.get("fits"):
            if frozenset(names) not in {frozenset(each) for each, *_ in pairs}:
                raise place.wrong(f"no contact pair of {names[0]} and {names[1]}", "give those of a *CONTACT PAIR")
            fits[frozenset(names)] = str(place) + ("" if value is None else f" of {value:g}"), value
        for names, interaction, glued, adjusted, place in pairs:
            if interaction and interaction not in self.interactions:
                raise place.wrong(f"there is no interaction {shown(interaction)}", "define *SURFACE INTERACTION")
            if frozenset(names) not in apart:
                (one, other), (fitted, clearance) = names, fits.get(frozenset(names), ("", None))
                pair = SurfacePair(one, other, fitted=fitted, clearance=clearance, adjusted=adjusted)
                law = self.interactions.get(interaction, {})
                yield replace(pair, **law | ({"glued": glued} if glued else {}))

    def _cyclic(self) -> tuple[int, FloatArray] | None:
        """Cyclic symmetry of one number of sectors and one axis, whose cut faces may be several ties."""
        ties = [name for name, cyclic, _ in self.get("ties") if cyclic]
        first: tuple[int, FloatArray] | None = None
        for number, name, axis, place in self.get("cyclic"):
            if name and name not in ties:
                raise place.wrong(f"there is no tie {shown(name)} of cut faces", "give *TIE, CYCLIC SYMMETRY this name")
            first = first or (number, axis)
            n_sectors, (start, end) = first
            own = (end - start) / np.linalg.norm(end - start)
            apart = np.cross(axis - start, own) / np.linalg.norm(axis[1] - axis[0])
            if number != n_sectors or np.abs(apart).max() > _SAME_AXIS or (axis[1] - axis[0]) @ own < 0:
                what = f"{number} sectors, another one has {n_sectors}, or about other axes"
                raise place.wrong(what, "give all of them one N and one axis: several stages are not supported")
        return first


def deck_of_arrays(
    name: str,
    nodes: tuple[IntArray, FloatArray],
    blocks: Sequence[tuple[str, IntArray, IntArray]],
    node_sets: Iterable[tuple[str, IntArray]],
    element_sets: Iterable[tuple[str, IntArray]],
) -> Deck:
    """A deck of node numbers (n,) with coordinates (n, 3), kind, numbers and nodes of elements, and parts of sets.

    Raises SceneError where numbers do not fit, or there are no elements.
    """
    place = Place(name, 1)
    if not blocks or not np.isfinite(nodes[1]).all():
        raise SceneError("model", f"{name} has no solid elements, or coordinates that are infinite", "write it again")
    draft = Draft(name, [Records("", *nodes, place)])
    draft.elements += [Records("", numbers, own, place, kind) for kind, numbers, own in blocks]
    for sets, given in ((draft.node_sets, node_sets), (draft.element_sets, element_sets)):
        for key, members in given:
            sets.add(("", key.strip().upper()), Numbers("", np.asarray(members, dtype=np.int64)))
    return Model(Mesh(draft)).deck()

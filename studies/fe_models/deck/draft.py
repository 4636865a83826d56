"""A deck while it is read: what its keywords say, with names that are not looked up yet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from studies.fe_models.deck.mesh import FloatArray, IntArray
from studies.fe_models.deck.sets import PART, Reference, SetDefinitions
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.read_errors import Place


@dataclass(frozen=True)
class DraftFace:
    """Faces S1 to S6 of elements: which ones."""

    elements: Reference
    face: int


@dataclass
class DraftSurface:
    """A surface: faces, or references to nodes and sets of nodes."""

    place: Place
    faces: list[DraftFace] = field(default_factory=list)
    nodes: list[Reference] = field(default_factory=list)


@dataclass(frozen=True)
class DraftPair:
    """Two surfaces, the dependent one first. name: of the tie, or of the interaction of a contact pair."""

    dependent: Reference
    independent: Reference
    name: str
    place: Place
    tolerance: float | None = None
    cyclic: bool = False


@dataclass(frozen=True)
class DraftBoundary:
    """Displacements that are prescribed, from the first to the last dof."""

    nodes: Reference
    first_dof: int
    last_dof: int
    value: float


@dataclass(frozen=True)
class DraftLoad:
    """A rotation of elements."""

    elements: Reference
    omega_squared: float
    point: FloatArray
    axis: FloatArray


@dataclass
class DraftMaterial:
    """A material, its values as far as they were read."""

    young: float | None = None
    poisson: float | None = None
    density: float | None = None


@dataclass
class DraftStep:
    """A step. replaced: its boundary conditions take the place of all before."""

    place: Place
    parameters: Mapping[str, str]
    kind: str = ""
    kind_parameters: Mapping[str, str] = field(default_factory=dict)
    boundaries: list[DraftBoundary] = field(default_factory=list)
    replaced: bool = False
    centrifugal: list[DraftLoad] = field(default_factory=list)
    equations_removed: bool = False
    contact_removed: list[tuple[str, str]] = field(default_factory=list)


@dataclass
class Draft:
    """All that was read so far.

    scope: PART inside of *PART and *INSTANCE, else "".
    instance: name of the only instance, "" before it.
    in_parts: whether the deck has parts.
    step: the step that is being read; None outside of steps.
    included: files, relative to the folder of the deck.
    """

    nodes: list[tuple[IntArray, FloatArray, Place]] = field(default_factory=list)
    elements: list[tuple[str, IntArray, Place]] = field(default_factory=list)
    node_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("nodes"))
    element_sets: SetDefinitions = field(default_factory=lambda: SetDefinitions("elements"))
    surfaces: dict[tuple[str, str], DraftSurface] = field(default_factory=dict)
    ties: list[DraftPair] = field(default_factory=list)
    contact_pairs: list[DraftPair] = field(default_factory=list)
    frictions: dict[str, float] = field(default_factory=dict)
    interaction: str = ""
    cyclic: tuple[int, str, FloatArray, Place] | None = None
    boundaries: list[DraftBoundary] = field(default_factory=list)
    materials: dict[str, DraftMaterial] = field(default_factory=dict)
    material: DraftMaterial | None = None
    sections: list[tuple[Reference, str]] = field(default_factory=list)
    steps: list[DraftStep] = field(default_factory=list)
    step: DraftStep | None = None
    skipped: dict[str, str] = field(default_factory=dict)
    scope: str = ""
    instance: str = ""
    in_parts: bool = False
    shift: tuple[FloatArray, FloatArray] | None = None
    included: list[str] = field(default_factory=list)

    def skip(self, block: Block, what: str = "") -> None:
        """Notes a keyword, or a part of one, that is not read."""
        text = f"*{block.written}{what}"
        if len(self.skipped) < 1000:
            self.skipped.setdefault(text, f"{block.place}: {text}")

    def numbers_are_local(self, block: Block) -> bool:
        """Whether plain numbers below a keyword are those of the mesh; else of reference points of the assembly."""
        return not self.in_parts or self.scope == PART or "INSTANCE" in block.parameters

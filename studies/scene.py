"""What a scene is: its parameters, its reduced model, and what it can tell beside the model."""

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic.fields import FieldInfo

from solver.compliant_contact import LARGEST_CONTACT_STIFFNESS, with_contact_stiffness
from solver.compliant_contact import LARGEST_FRICTION as LARGEST_FRICTION
from solver.model import FloatArray, IntArray, ReducedModel
from studies.scene_error import SceneError

N_MODES = 6
"""Number of natural frequencies that are given for each nodal diameter."""

Progress = Callable[[str], None]
"""Takes a line on the next step, where a step may take long, or one on the model that begins with `WARNING`."""

WARNING = "warning: "


def silent(_: str) -> None:
    """Prints nothing."""


@dataclass(frozen=True)
class SurfaceMesh:
    """Outer faces of a finite-element mesh, for pictures.

    nodes (n_nodes, 3): m. quads (n_quads, 4): nodes of each face, anticlockwise as seen from outside. parts: label of
    the part that each face belongs to, e.g. "blade".
    """

    nodes: FloatArray
    quads: IntArray
    parts: tuple[str, ...]


@dataclass(frozen=True)
class ExpectedWear:
    """What a study wears at most.

    amplitude: largest excitation amplitude. per_slip_work: largest `k_w N`, m3/J: volume worn over slip work of a
    cycle; inf where cycles have no end. volume, m3, and depth, m: at which the wear ends, inf where they end nothing.
    """

    amplitude: float
    per_slip_work: float
    volume: float = math.inf
    depth: float = math.inf


def stuck_frequencies(model: ReducedModel) -> dict[int, FloatArray]:
    """Lowest frequencies (N_MODES,), Hz, ascending, of each nodal diameter of a model with its joint stuck, undamped.

    No relative displacement moves; NaN where there are fewer modes. Raises SceneError where nothing else moves, or
    nothing holds the stuck structure.
    """
    from scipy.linalg import LinAlgError, eigh  # where it is used: it takes a while to load

    dofs, frequencies = model.contact.dofs, {}
    for k, linear in sorted(model.linear.items()):
        free = np.setdiff1d(np.arange(len(linear.stiffness)), dofs[dofs >= 0])
        if len(free) == 0:
            raise SceneError("variables", "natural_frequency", "leave it out: nothing moves where the joint sticks")
        held = np.ix_(free, free)
        try:
            # M x = K x / w^2: a displacement without mass has no frequency, which is 0 here
            inverse = eigh(linear.mass[held], linear.stiffness[held], eigvals_only=True)[::-1]
        except LinAlgError:
            remedy = f"leave it out: nothing holds the stuck structure at nodal diameter {k}"
            raise SceneError("variables", "natural_frequency", remedy) from None
        moving = inverse[inverse > np.finfo(np.float64).eps * len(free) * inverse[0]]
        frequencies[k] = lowest(1.0 / (2.0 * np.pi * np.sqrt(moving)))
    return frequencies


def lowest(frequencies: FloatArray) -> FloatArray:
    """The first N_MODES of ascending frequencies, NaN where there are fewer."""
    return np.append(frequencies, np.full(N_MODES, np.nan))[:N_MODES]


class Unit(str):
    """Metadata of a key: the unit of its values, as a result has it."""


class Remark(str):
    """Metadata of a key: what else a reader has to know, as what is taken where the key is not given."""


Metre = Annotated[float, Unit("m")]
SquareMetre = Annotated[float, Unit("m2")]
Degree = Annotated[float, Unit("degree")]
Rpm = Annotated[float, Unit("rpm")]
Kilogram = Annotated[float, Unit("kg")]
Density = Annotated[float, Unit("kg/m3")]
Newton = Annotated[float, Unit("N")]
NewtonPerMetre = Annotated[float, Unit("N/m")]
Damping = Annotated[float, Unit("N s/m")]
Pascal = Annotated[float, Unit("Pa")]
ContactStiffness = Annotated[
    float | None,
    Field(gt=0, le=LARGEST_CONTACT_STIFFNESS, description="normal stiffness per area of rough surfaces"),
    Unit("N/m3"),
    Remark("rigid if not given"),
]


def said_of(field: FieldInfo, kind: type[Unit] | type[Remark]) -> str:
    """Unit or remark of a key, also of one that takes other kinds of values as well; empty where it has none."""

    def among(part: object) -> Iterator[str]:
        if isinstance(part, kind):
            yield str(part)
        for inner in get_args(part):
            yield from among(inner)

    return next((found for part in (*field.metadata, field.annotation) for found in among(part)), "")


def describe_field(field: FieldInfo) -> str:
    """Meaning of a key, its unit, and what else is said of it."""
    meaning = ", ".join(filter(None, (field.description, said_of(field, Unit))))
    return "; ".join(filter(None, (meaning, said_of(field, Remark))))


class Table(BaseModel):
    """A table: frozen, unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Scene(Table):
    """Parameters of a bundled scene, and what follows from them. Units are metadata of the keys.

    FRICTION_IN_MODEL: whether the reduced model depends on the friction coefficient. OFFERS: what a study may ask for
    among `outputs.variables` that not every scene knows: "mesh", "exact" (a method `exact_answer`). DESCRIPTION: of the
    contact for pictures, see `scene_file.DESCRIPTION`.
    """

    FRICTION_IN_MODEL: ClassVar[bool] = False
    OFFERS: ClassVar[tuple[str, ...]] = ()
    DESCRIPTION: ClassVar[Mapping[str, str]] = {}

    friction_coefficient: float = Field(0.5, ge=0, description="Coulomb friction coefficient")
    contact_stiffness: ContactStiffness = None

    def build(self, n_harmonics: int, /) -> ReducedModel:
        """Reduced model without its contact stiffness, with all nodal diameters that the harmonics 0..n_harmonics see.

        Raises SceneError where the parameters describe no possible structure.
        """
        raise NotImplementedError

    def natural_frequencies(self, model: ReducedModel) -> dict[int, FloatArray]:
        """As `stuck_frequencies`, of all nodal diameters that the scene knows; model: its reduced model."""
        return stuck_frequencies(model)

    def describe_mesh(self) -> SurfaceMesh:
        """Outer faces of its mesh, of a scene that offers one. Raises SceneError."""
        raise NotImplementedError

    def with_room_for_wear(self, expected: ExpectedWear) -> Self:
        """The scene with room for what it wears, where its pairs end at an artificial edge; else as it is."""
        del expected
        return self


def as_scene(parameters: BaseModel) -> Scene:
    """Parameters of a bundled scene; TypeError where they belong to another one."""
    if not isinstance(parameters, Scene):
        raise TypeError(f"{type(parameters).__qualname__} is no bundled scene")
    return parameters


def make_compliant(model: ReducedModel, contact_stiffness: float | None) -> ReducedModel:
    """A model with a contact stiffness, N/m3; as it is without one."""
    return model if contact_stiffness is None else with_contact_stiffness(model, contact_stiffness)


_last_rigid: dict[str, ReducedModel] = {}


def build_compliant(
    name: str, key: str, contact_stiffness: float | None, build: Callable[[], ReducedModel]
) -> ReducedModel:
    """A model with its contact stiffness, N/m3. name: for messages.

    build: gives the model without it. The last of these models is kept under the key, which names all that the model
    depends on: a study with many contact stiffnesses reduces its finite-element model once. Raises SceneError where the
    model cannot be.
    """
    # far from what can be, numbers overflow
    with np.errstate(all="ignore"):
        try:
            rigid = _last_rigid.get(key) or build()
            if contact_stiffness is not None and key not in _last_rigid:
                _last_rigid.clear()
                _last_rigid[key] = rigid
            return make_compliant(rigid, contact_stiffness)
        except SceneError:
            raise
        except (ArithmeticError, ValueError, IndexError, MemoryError) as error:
            # what a parameter alone does not show: LinAlgError is a ValueError, too
            remedy = "give parameters of a possible structure"
            raise SceneError("model", f"{name} cannot be built: {error}", remedy) from None


def list_keys(parameters: type[BaseModel]) -> str:
    """Markdown: a list of keys of [scene] with default, meaning and unit."""
    lines = []
    for name, field in parameters.model_fields.items():
        shown = f"{field.default:g}" if isinstance(field.default, float) else str(field.default).lower()
        default = "" if field.default is None or field.is_required() else f" = {shown}"
        lines.append(f"- `{name}{default}`: {describe_field(field)}")
    return "\n".join(lines)

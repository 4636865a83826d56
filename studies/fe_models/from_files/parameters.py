"""What a study says of a finite-element model, in SI units whatever units its files have."""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from studies.scene import ContactStiffness, Density, Metre, Newton, NewtonPerMetre, Pascal, Remark, Rpm, Table, Unit
from studies.sectors import OfRing


def _as_tuple(value: object) -> object:
    """TOML has lists; what is frozen has none."""
    return tuple(value) if isinstance(value, list) else value


def _with_length(value: tuple[float, float, float]) -> tuple[float, float, float]:
    if not math.sqrt(sum(part * part for part in value)) > 0.0:
        raise ValueError("give a direction that is not 0")
    return value


Vector = Annotated[tuple[float, float, float], BeforeValidator(_as_tuple)]
Direction = Annotated[Vector, AfterValidator(_with_length)]
Pair = Annotated[tuple[str, str], BeforeValidator(_as_tuple)]
Pairs = Annotated[tuple[Pair, ...], BeforeValidator(_as_tuple)]
Names = Annotated[tuple[str, ...], BeforeValidator(_as_tuple)]


class SetDirection(Table):
    """Mean displacement of a set of nodes along a direction, or a force of 1 N that is shared evenly."""

    set: str = Field(description="set of nodes or surface")
    direction: Direction = Field(description="three numbers, of any length")


class Preload(SetDirection):
    """A constant force on a set of nodes, shared evenly."""

    force: Newton


class AxisTable(Table):
    """The axis of rotation, and of a cyclic structure."""

    point: Annotated[Vector, Unit("m")] = Field((0.0, 0.0, 0.0), description="on the axis")
    direction: Direction = Field(description="three numbers, of any length")


class MaterialTable(Table):
    """An isotropic elastic material."""

    young_modulus: Pascal = Field(gt=0)
    poisson_ratio: float = Field(ge=0, lt=0.5)
    density: Density = Field(gt=0)


class Parameters(OfRing):
    """[scene] of a finite-element model. What is not given comes from the deck."""

    friction_coefficient: Annotated[float | dict[str, float] | None, Remark("default: the deck's")] = Field(
        None, description="Coulomb's, of all pairs or by the name of a surface of each contact"
    )
    contact_stiffness: ContactStiffness = None
    matrices: Annotated[str | None, Remark("without it they are assembled here")] = Field(
        None, description="name that the files with the matrices have in common"
    )
    units: Literal["SI", "mm-t-s"] = Field(description='of the files, "SI" or "mm-t-s"')
    contact: Pairs | None = Field(
        None,
        description="pairs of surfaces or sets of nodes, [[name, name]]; default: the deck's CONTACT PAIR, or its TIE",
    )
    next_sector: bool | Names = Field(
        False,
        description="contacts whose second surface belongs to the neighbouring sector: true for all, or [name], a"
        " surface of each; which side the neighbour is on is found",
    )
    load: SetDirection = Field(description="where the harmonic load of 1 N acts: {set, direction}")
    response: Annotated[dict[str, SetDirection], Field(min_length=1)] | None = Field(
        None, description="mean displacements by name: {name = {set, direction}}; default: that of the load"
    )
    recovery: str | None = Field(
        None,
        description="table with the columns node, dof and one for each further response, over the rows of the"
        " matrices; a name as root stress [MPa] has a unit, one without is a displacement",
    )
    preload: Annotated[tuple[Preload, ...], BeforeValidator(_as_tuple)] = Field(
        (),
        description="constant forces beside the centrifugal one, no part of the prestress: [{set, direction, force}];"
        " default: CLOAD and pressures of the deck's static steps",
    )
    nodal_diameter: int = Field(0, ge=0, description="nodal diameter of the travelling wave that excites")
    loss_factor: float = Field(1e-3, ge=0, description="loss factor of the material, exact at the first frequency")
    stuck_modes: int = Field(20, ge=1, le=200, description="modes of the glued structure kept in the reduction")
    retention_stiffness: NewtonPerMetre = Field(
        0.0, ge=0, description="stiffness of the retainer on the mean relative displacement of all pairs"
    )
    retention_direction: Direction | None = Field(None, description="of the retainer; default: that of the axis")
    tolerance: Annotated[Metre | None, Remark("default: that of the TIE, or 5 % of a facet")] = Field(
        None, gt=0, description="largest distance of a node that is paired"
    )
    gaps: bool = Field(False, description="whether distances of the surfaces in the mesh are gaps of the joint")
    clamp: Names | None = Field(
        None, description="sets of nodes or surfaces that are held, [name]; default: the deck's BOUNDARY"
    )
    read_as: dict[str, str] | None = Field(
        None, description='kinds of elements in place of others with as many nodes, {C3D8R = "C3D8I"}'
    )
    suspension: Annotated[float, Unit("Hz")] = Field(
        0.0, ge=0, description="frequency of the rigid motions of a free structure, on soft springs to the ground"
    )
    material: MaterialTable | dict[str, MaterialTable] | None = Field(
        None, description="of all elements, or by the name of a set of elements"
    )
    rotation_speed: Annotated[Rpm | None, Remark("default: that of the deck's CENTRIF")] = Field(None, ge=0)
    stress_stiffening: bool = Field(True, description="stress stiffening and spin softening by the rotation")
    axis: AxisTable | None = Field(None, description="{point, direction}; default: the deck's")
    n_sectors: Annotated[int | None, Remark("default: the deck's")] = Field(
        None, ge=2, description="sectors of the whole"
    )
    cut_faces: Pair | None = Field(
        None, description="two sets of nodes or surfaces, [name, name]; default: the deck's, or found"
    )

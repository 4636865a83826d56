"""Keys of scenes that are one sector of a ring: whether all its sectors are computed, and how these differ."""

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from solver.model import ReducedModel
from solver.structure.ring import LARGEST_DEVIATION as LARGEST_DEVIATION
from solver.structure.ring import build_ring
from studies.scene import Remark, Table, Unit
from studies.scene_error import SceneError

_Deviation = Annotated[float, Field(ge=-LARGEST_DEVIATION, le=LARGEST_DEVIATION)]
_NotNegative = Annotated[float, Field(ge=0)]
_TUPLE = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)


class Sectors(Table):
    """How the sectors of a ring differ: lists with a number for each, from sector 0 on; () where they do not differ.

    file: that the numbers are from. wear_depth: of each sector, or of each pair of all sectors.
    """

    file: str = Field("", description="CSV file beside the study file with the columns sector, frequency, ...")
    frequency: Annotated[tuple[_Deviation, ...], _TUPLE] = Field(
        (), description="relative deviation of the blade-alone frequency"
    )
    friction: Annotated[tuple[_NotNegative, ...], _TUPLE] = Field(
        (), description="friction coefficient of all pairs of the sector"
    )
    wear_depth: Annotated[tuple[_NotNegative, ...], _TUPLE, Unit("m")] = Field(
        (), description="wear before the history begins, of all pairs of a sector, or of each pair, sector by sector"
    )


class OfRing(Table):
    """Keys of scenes that may be one sector of a ring."""

    sectors: Annotated[Literal["all"] | Sectors | None, Remark("one stands for all if not given")] = Field(
        None, description='all sectors of the ring, "all" equal ones, or {file = "blades.csv"} with their differences'
    )
    forced_sector: Annotated[int | None, Remark("all, by a travelling wave, if not given")] = Field(
        None, ge=0, description="the only sector of the ring that is excited, at nodal diameter 0"
    )

    @property
    def ring(self) -> Sectors | None:
        """How sectors differ; None where one of them stands for all."""
        return Sectors() if self.sectors == "all" else self.sectors


def ring_of(model: ReducedModel) -> ReducedModel:
    """The ring of equal sectors, of the model of one. Raises SceneError where the model is no such sector."""
    n = model.n_sectors
    if n < 2:
        raise SceneError("sectors", "the scene is no cyclic sector", "leave it out, or give a scene with n_sectors")
    if lacking := [k for k in range(n // 2 + 1) if k not in model.linear]:
        found = f"the scene has no nodal diameters {', '.join(map(str, lacking))}"
        raise SceneError("sectors", found, f"give the scene file the groups nd/0 to nd/{n // 2}")
    return build_ring(model)

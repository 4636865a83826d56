"""[wear] of a study file: the wear law, and what each law takes."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, TypeAdapter, model_validator

from solver.contact.wear_law import LAWS, WearLaw, WearTable
from studyrunner.study.values import NotNegative, Number, Section, read, words
from studyrunner.system.progress import count
from studyrunner.user_error import WrongValueError

_NUMBER = TypeAdapter(Number)
_NOT_NEGATIVE = TypeAdapter(NotNegative)
_MOST_KNOTS = 1000
_OF_SURFACE = "surfaces_"

_TAKEN = {"threshold": ("threshold",), "table": ("pressure", "depth", "factor")}
"""Keys of the laws that take any, beside `surfaces`, which all take."""


def _read_knots(value: object) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or not 1 <= len(value) <= _MOST_KNOTS:
        raise WrongValueError(value, f"give a list of 1 to {_MOST_KNOTS} ascending numbers")
    knots = tuple(read(_NUMBER, item) for item in value)
    if any(later <= earlier for earlier, later in pairwise(knots)):
        raise WrongValueError(value, "give ascending numbers")
    return knots


def _read_factor(value: object) -> tuple[tuple[float, ...], ...]:
    if not isinstance(value, list | tuple) or not all(isinstance(row, list | tuple) for row in value):
        raise WrongValueError(value, "give a list of rows, one for each pressure, with a number for each depth")
    return tuple(tuple(read(_NOT_NEGATIVE, item) for item in row) for row in value)


def _read_surfaces(value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        raise WrongValueError(value, "give a factor for each surface, as {flat = 1.0, cylinder = 0.5}")
    return {str(name): read(_NOT_NEGATIVE, item) for name, item in value.items()}


class WearSection(Section):
    """[wear]: which law, what it takes, and how surfaces differ."""

    law: Annotated[Literal["archard", "energy", "threshold", "table"], words(*LAWS)] = Field(
        "archard", description="what of the slip work wears"
    )
    threshold: NotNegative | None = Field(
        None, description="J/m2, slip work per area in a cycle below which nothing wears"
    )
    pressure: Annotated[tuple[float, ...] | None, BeforeValidator(_read_knots)] = Field(
        None, description="Pa, mean over a period, of the rows of the table"
    )
    depth: Annotated[tuple[float, ...] | None, BeforeValidator(_read_knots)] = Field(
        None, description="m, worn depth, of the columns of the table"
    )
    factor: Annotated[tuple[tuple[float, ...], ...] | None, BeforeValidator(_read_factor)] = Field(
        None, description="of wear_coefficient, rows of the table"
    )
    surfaces: Annotated[dict[str, float] | None, BeforeValidator(_read_surfaces)] = Field(
        None, description="factor of wear_coefficient on each surface of the scene"
    )

    @model_validator(mode="after")
    def _check_keys(self) -> WearSection:
        for law, keys in _TAKEN.items():
            for key in keys:
                value = getattr(self, key)
                if law == self.law and value is None:
                    raise WrongValueError(law, f"give wear.{key} beside it", "wear.law")
                if law != self.law and value is not None:
                    raise WrongValueError(value, f'leave it out: only the law "{law}" takes it', f"wear.{key}")
        return self

    @model_validator(mode="after")
    def _check_table(self) -> WearSection:
        if self.pressure is not None and self.depth is not None and self.factor is not None:
            n_rows, n_columns = len(self.pressure), len(self.depth)
            if len(self.factor) != n_rows or any(len(row) != n_columns for row in self.factor):
                columns = count(n_columns, "number")
                remedy = f"give {count(n_rows, 'row')} for the pressures, each of {columns} for the depths"
                raise WrongValueError(self.factor, remedy, "wear.factor")
        return self

    @property
    def numbers(self) -> dict[str, float]:
        """Numbers that may scatter, named as dimensions: the threshold, and `surfaces_flat` of a surface flat."""
        own = {} if self.threshold is None else {"threshold": self.threshold}
        factors = {f"{_OF_SURFACE}{label}": factor for label, factor in (self.surfaces or {}).items()}
        return own | {name: factor for name, factor in factors.items() if name.isidentifier()}

    def with_numbers(self, values: Mapping[str, float]) -> WearSection:
        """With other values of `numbers`."""
        table = {f"{_OF_SURFACE}{label}": (label, factor) for label, factor in (self.surfaces or {}).items()}
        surfaces = {label: values.get(name, factor) for name, (label, factor) in table.items()} or None
        return self.model_copy(update={"threshold": values.get("threshold", self.threshold), "surfaces": surfaces})

    @property
    def wear_law(self) -> WearLaw:
        """As the solver takes it."""
        table = None
        if self.pressure is not None and self.depth is not None and self.factor is not None:
            table = WearTable(self.pressure, self.depth, self.factor)
        surfaces = () if self.surfaces is None else tuple(self.surfaces.items())
        return WearLaw(self.law, self.threshold or 0.0, table, surfaces)

"""The tables of a study file but [scene] and [scatter]: their keys, what each key takes, its default."""

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, cast

from pydantic import AfterValidator, Field

from solver.contact.wear_law import PowerTerms, WearLaw, WearTable
from solver.settings import TARGETS, Followed
from studies.scene import LARGEST_FRICTION, Unit
from studyrunner.measured import MeasuredSection
from studyrunner.scatter import ScatterSection
from studyrunner.values import Axis, Fraction, Listed, NotNegative, Positive, Section, Whole, Wrong, ascending, once

IDLE_FREQUENCY = 1.0
"""Hz, where no point has a frequency of the axis."""

AUTO: Final = "auto"
"""In place of a number of harmonics or samples: as many as each state needs for `rtol`."""

ALLOWABLE: Final = "allowable"
"""In place of excitation amplitudes."""

DEFAULT: Final = "default"
"""In a list of variables: those that cost little, which is what a study without such a list asks for."""

SOLVER_AXES = ("harmonics", "samples", "tolerance", "rtol")
"""Keys of [solver] that may stand under [axes]."""

_OF_SURFACE = "surfaces_"
_MOST_KNOTS = 1000


def _check_name(value: str) -> str:
    if not value.strip() or value.startswith(".") or not value.isprintable() or {*"/\\"} & {*value} or len(value) > 100:
        raise ValueError("give a name of at most 100 characters that can be a file name, without a slash")
    return value


def _check_target(value: dict[str, float]) -> dict[str, float]:
    if len(value) != 1 or next(iter(value)) not in TARGETS:
        raise ValueError("give one of " + ", ".join(f"{{{name} = ...}}" for name in TARGETS))
    return value


_Scheme = Literal["implicit", "explicit", "adaptive", "final"]
_Samples = Annotated[Whole, Field(ge=4, le=100_000)]
_Number = Annotated[Whole, Field(ge=1, le=1000)]
_Knots = Annotated[Listed[float], Field(min_length=1, max_length=_MOST_KNOTS), AfterValidator(ascending)]

if TYPE_CHECKING:
    _Frequencies = tuple[float, ...]  # of a complete study
    _Amplitudes = tuple[float, ...]
else:
    _Frequencies, _Amplitudes = Axis[Positive | Followed] | None, Axis[Positive | Literal["allowable"]]


class StudySection(Section):
    """[study]: name and title of the study."""

    name: Annotated[str, AfterValidator(_check_name)] = Field(description="of the study and of its result file")
    title: str = Field("", description="of the result")


class AxesSection(Section):
    """[axes]: every axis becomes a dimension of the result, in the order of the values given here."""

    frequency: _Frequencies = Field(
        cast("Any", None),
        description="Hz; with a word the excitation follows this resonance in the range of [loading]; a study of wear"
        " has frequency or frequency_ratio",
    )
    frequency_ratio: Axis[Positive] | None = Field(
        None, description="in place of frequency: over the first natural frequency of the same scene, all pairs stuck"
    )
    wear_coefficient: Axis[NotNegative] = Field(
        (1.1e-11,), description="1/Pa, of the law of [wear]; Ti-6Al-4V with friction 0.5 has 2e-13"
    )
    excitation_amplitude: _Amplitudes = Field(
        (1.0,),
        description="N, factor of the harmonic load of the scene; with the word the one at which the wear just meets"
        " slow_time.until after all cycles is found",
    )
    step: Axis[Positive] = Field((1000.0,), description="h, cycles: length of implicit and explicit steps")
    scheme: Axis[_Scheme] = Field(("adaptive",), description="how wear is integrated over the cycles")
    sweep: Axis[Literal["up", "down", "ramp"]] = Field(
        ("up",), description="to the unworn state the frequency rises, or falls, or the excitation rises"
    )
    modal_amplitude: Axis[Positive] | None = Field(
        None, description="m sqrt(kg), of nonlinear modes, in place of a frequency"
    )
    mode: Axis[_Number] = Field((1,), description="number of the nonlinear mode, by frequency, from 1 on")


_Table = Annotated[Listed[Positive], Field(min_length=2, max_length=_MOST_KNOTS)]
_Tables = _Table | Annotated[dict[str, _Table], Field(min_length=1)]


class EvolutionSection(Section):
    """[wear.evolution]: what changes with the energy that friction dissipates at a pair, over its area."""

    energy: Annotated[Listed[NotNegative], Field(min_length=2, max_length=_MOST_KNOTS), AfterValidator(ascending)] = (
        Field(description="J/m2, ascending from 0; between them all is linear, beyond the last one constant")
    )
    friction_coefficient: _Tables | None = Field(
        None,
        description="one at each energy, or a table of lists, one for each surface of the scene; in place of"
        " scene.friction_coefficient",
    )
    contact_stiffness: _Tables | None = Field(
        None, description="N/m3, in the same way; in place of scene.contact_stiffness"
    )
    wear_factor: _Tables | None = Field(None, description="factors of wear_coefficient, in the same way")

    @property
    def tables(self) -> dict[str, dict[str, tuple[float, ...]]]:
        """What changes, by name: numbers at each energy by the surface, "" for all surfaces."""
        given = {name: getattr(self, name) for name in ("friction_coefficient", "contact_stiffness", "wear_factor")}
        whole = {name: each if isinstance(each, dict) else {"": each} for name, each in given.items() if each}
        return {name: {label: tuple(values) for label, values in each.items()} for name, each in whole.items()}

    def rules(self) -> Iterator[Wrong]:
        """At least one table, with a number in its range for each energy."""
        if self.energy[0] != 0.0:
            yield Wrong("energy", self.energy[0], "begin with 0, the unworn joint")
        if not self.tables:
            yield Wrong("", None, "give friction_coefficient, contact_stiffness or wear_factor, one at each energy")
        for name, by_surface in self.tables.items():
            for label, values in by_surface.items():
                key = ".".join(filter(None, (name, label)))
                if len(values) != len(self.energy):
                    yield Wrong(key, list(values), f"give {len(self.energy)} numbers, one for each energy")
                if name == "friction_coefficient" and max(values) > LARGEST_FRICTION:
                    yield Wrong(key, max(values), f"give at most {LARGEST_FRICTION:g}: dry metals have less than 1.5")
                if name == "contact_stiffness" and min(values) < values[0]:
                    yield Wrong(key, min(values), "give none below the first one, that of the unworn joint")


class WearSection(Section):
    """[wear]: which law, what it takes, and how surfaces differ."""

    AXES: ClassVar = ("threshold", "adhesive", "decay", "surfaces")
    TAKEN: ClassVar = {
        "threshold": ("threshold",),
        "table": ("pressure", "depth", "factor"),
        "power": ("adhesive", "decay"),
    }
    """Keys of the laws that take any, beside `surfaces`, which all take."""
    _NUMBERS: ClassVar = ("threshold", "adhesive", "decay")

    law: Literal["archard", "energy", "threshold", "table", "power"] = Field("archard", description="what wears")
    threshold: Annotated[NotNegative | None, Unit("J/m2")] = Field(
        None, description="slip work per area in a cycle below which nothing wears"
    )
    adhesive: Annotated[NotNegative | None, Unit("1/Pa")] = Field(
        None,
        description="energy wear coefficient at much friction power, Ti-6Al-4V: 5.5e-14; wear_coefficient at none",
    )
    decay: Annotated[NotNegative | None, Unit("m2/W")] = Field(
        None, description="with which it falls with the power density of friction, of Ti-6Al-4V 1.1e-5"
    )
    pressure: _Knots | None = Field(None, description="Pa, ascending: mean over a period, of the rows of factor")
    depth: _Knots | None = Field(None, description="m, ascending: worn depth, of the columns of factor")
    factor: Listed[Listed[NotNegative]] | None = Field(
        None, description="of wear_coefficient, for the law table: a list of rows, one for each pressure"
    )
    surfaces: dict[str, NotNegative] | None = Field(
        None, description="factor of wear_coefficient on each surface of the scene, as {flat = 1.0, cylinder = 0.5}"
    )

    evolution: EvolutionSection | None = Field(
        None, description="friction, contact stiffness and wear coefficient that change while the joint rubs"
    )

    def rules(self) -> Iterator[Wrong]:
        """Each law takes its own keys, and a table has a factor for each pressure and depth."""
        for law, keys in self.TAKEN.items():
            for key in keys:
                if (law == self.law) != ((value := getattr(self, key)) is not None):
                    yield Wrong(key, value, f'give it with the law "{law}", and with no other law')
        n_rows, n_columns = len(self.pressure or ()), len(self.depth or ())
        if self.factor is not None and [len(row) for row in self.factor] != [n_columns] * n_rows:
            remedy = f"give a row for each of {n_rows} pressures, with a number for each of {n_columns} depths"
            yield Wrong("factor", self.factor, remedy)

    @property
    def numbers(self) -> dict[str, float]:
        """Numbers that may scatter, named as dimensions: those of the law, and `surfaces_flat` of a surface flat."""
        given = {name: getattr(self, name) for name in self._NUMBERS}
        own = {name: float(value) for name, value in given.items() if value is not None}
        factors = {f"{_OF_SURFACE}{label}": factor for label, factor in (self.surfaces or {}).items()}
        return own | {name: factor for name, factor in factors.items() if name.isidentifier()}

    def with_numbers(self, values: Mapping[str, float]) -> "WearSection":
        """With other values of `numbers`."""
        own = {label: values.get(f"{_OF_SURFACE}{label}", factor) for label, factor in (self.surfaces or {}).items()}
        numbers = {name: values.get(name, getattr(self, name)) for name in self._NUMBERS}
        return self.model_copy(update={**numbers, "surfaces": own or None})

    @property
    def as_law(self) -> WearLaw:
        """As the solver takes it."""
        # all three, or both, or none
        table: WearTable | PowerTerms | None = None
        if self.factor is not None:
            table = WearTable(self.pressure or (), self.depth or (), self.factor)
        elif self.adhesive is not None and self.decay is not None:
            table = PowerTerms(self.adhesive, self.decay)
        return WearLaw(self.law, self.threshold or 0.0, table, tuple((self.surfaces or {}).items()))


class SlowTimeSection(Section):
    """[slow_time]: end of the histories, and cycle counts of the output."""

    cycles: Annotated[float, Field(ge=0, allow_inf_nan=True)] = Field(
        100_000.0, description="of vibration; 0: the unworn states only, inf: until nothing wears any more"
    )
    missions: Annotated[Whole, Field(ge=1, le=10_000_000)] | None = Field(
        None, description="repetitions of the blocks under [[mission]], in place of cycles"
    )
    final_share: Fraction = Field(
        1e-4, description="of its largest wear rate, below which a pair wears no more with cycles = inf"
    )
    outputs: (
        Annotated[Whole, Field(ge=1, le=1_000_000)]
        | Annotated[Listed[NotNegative], Field(min_length=1), AfterValidator(ascending)]
    ) = Field(101, description="number of equally spaced cycle counts with 0 and the last, or a list")
    until: Annotated[dict[str, Positive], AfterValidator(_check_target)] | None = Field(
        None,
        description="end of a point: {wear_depth = 1e-5}, m, of the deepest pair, {worn_volume = 1e-9}, m3,"
        " or {frequency_shift = 0.01}, relative",
    )
    largest_depth: Positive | None = Field(
        None, description="m, that a pair wears in an explicit step, Eq. (22); in place of step"
    )

    def rules(self) -> Iterator[Wrong]:
        """The outputs lie on the way to the end."""
        missions, cycles, outputs = self.missions, self.cycles, self.outputs
        counts = outputs if isinstance(outputs, tuple) else ()
        if counts and missions is None and cycles == math.inf:
            remedy = "give their number: with slow_time.cycles = inf they are spaced evenly in worn volume and cycles"
            yield Wrong("outputs", outputs, remedy)
        if counts and (counts[-1] > (missions or cycles) or (missions and any(each != round(each) for each in counts))):
            remedy = "give cycle counts of at most slow_time.cycles, or whole numbers of at most slow_time.missions"
            yield Wrong("outputs", outputs, remedy)
        if outputs == 1 and missions is None and cycles > 0.0:
            yield Wrong("outputs", outputs, "give at least 2: cycle 0 and the last one")


class SolverSection(Section):
    """[solver]: resolution and accuracy. Several values of the first keys are an axis, as under [axes]."""

    harmonics: Axis[_Number | Literal["auto"]] = Field((AUTO,), description="harmonics above the static one")
    samples: Axis[_Samples | Literal["auto"]] = Field(
        (AUTO,), description="time samples in a period, more than twice the harmonics"
    )
    tolerance: Axis[Fraction] = Field(
        (1e-8,), description="of the scaled residual, in adaptive histories at least rtol / 1000"
    )
    rtol: Axis[Fraction] = Field((1e-2,), description="aim for the relative error of worn volume and response")
    shortcuts: bool = Field(True, description="whether points with the same history share one")
    time_limit: Positive | None = Field(None, description="s, CPU time that a start state or a wear history may take")


class OutputsSection(Section):
    """[outputs]: variables of the result; `outcome` and the totals of a point are always there."""

    variables: Annotated[Listed[str], AfterValidator(once)] = Field(
        (DEFAULT,), description="list of names; default: those that cost little"
    )
    loops: Annotated[
        Listed[Annotated[Whole, Field(ge=0, le=1_000_000)]], AfterValidator(lambda loops: tuple(sorted(once(loops))))
    ] = Field((), description="list of the contact pairs, from 0 on, whose fretting loops are stored")
    scene: bool = Field(False, description="whether the result holds the reduced model of a bundled scene")


class LoadingSection(Section):
    """[loading]: range of a frequency that is followed."""

    between: Annotated[tuple[Positive, Positive], Field(strict=False), AfterValidator(ascending)] = Field(
        description='Hz, [lowest, highest], with axes.frequency = "resonance" or "peak"'
    )


SECTIONS: dict[str, type[Section]] = {
    "study": StudySection,
    "axes": AxesSection,
    "wear": WearSection,
    "slow_time": SlowTimeSection,
    "solver": SolverSection,
    "outputs": OutputsSection,
    "scatter": ScatterSection,
    "loading": LoadingSection,
    "measured": MeasuredSection,
}

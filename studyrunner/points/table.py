"""The table of points: the only walk through axes, rows of a design, and samples; tasks are groups of its points."""

import math
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from studyrunner.coordinates import POINT, SAMPLE
from studyrunner.points.draw import samples_of
from studyrunner.study.design import CODE, Codes, as_they_come, group_rows
from studyrunner.study.sections import SOLVER_AXES, AxesSection
from studyrunner.study.study import Study


@dataclass(frozen=True)
class Column:
    """What each point has of one thing.

    along: dimensions along which it varies. codes: array over these, places in `values`, which differ.
    """

    along: tuple[str, ...]
    codes: Codes
    values: Sequence[Any]


def column(along: Sequence[str], codes: Codes, objects: Iterable[Hashable]) -> Column:
    """The column in which equal objects are one value. codes: places in `objects`, over all of `along`."""
    known: dict[Hashable, int] = {}
    first = np.array([known.setdefault(each, len(known)) for each in objects], CODE)
    codes, kept = first[codes], list[str]()
    for place, name in reversed(list(enumerate(along))):
        if (codes == codes.take([0], axis=place)).all():
            codes = np.asarray(codes.take(0, axis=place))
        else:
            kept.insert(0, name)
    return Column(tuple(kept), codes, tuple(known))


@dataclass(frozen=True, eq=False)
class Combinations:
    """Combinations of values of columns, each made when it is asked for: there may be as many as points.

    values: of each column. places: of each column those of the combinations among its values (n,).
    """

    values: tuple[Sequence[Any], ...]
    places: tuple[Codes, ...]

    def __len__(self) -> int:
        return len(self.places[0])

    def __getitem__(self, number: int) -> tuple[Any, ...]:
        return tuple([own[at[number]] for own, at in zip(self.values, self.places, strict=True)])

    def __iter__(self) -> Iterator[tuple[Any, ...]]:
        columns = zip(self.values, self.places, strict=True)
        return zip(*([own[place] for place in at.tolist()] for own, at in columns), strict=True)

    def taken(self, numbers: Codes) -> "Combinations":
        """Some of them. A column with one value takes no memory."""
        pairs = zip(self.values, self.places, strict=True)
        alike = np.broadcast_to(CODE(0), len(numbers))
        return Combinations(self.values, tuple(at[numbers] if len(own) > 1 else alike for own, at in pairs))

    def codes(self, *which: int) -> tuple[Codes, Codes]:
        """As `group_rows`, of the combinations by some of the columns."""
        return group_rows((self.places[place], len(self.values[place])) for place in which)

    def each(self, make: Callable[..., Any], *which: int) -> NDArray[Any]:
        """What is made of the values of some of the columns, (n,): once of equal ones."""
        first, rows = self.codes(*which)
        made = [make(*(self.values[place][self.places[place][row]] for place in which)) for row in first.tolist()]
        return np.array(made)[rows]


@dataclass(frozen=True)
class Points:
    """The points of a study.

    dims: lengths of the dimensions of the result, in their order. own: those of them that tasks walk through last.
    columns: by name; those of axes hold the place of the value in the table of the study. studies: for each value of
    the column "study" a study with one scene and one sample.
    """

    dims: Mapping[str, int]
    own: tuple[str, ...]
    columns: Mapping[str, Column]
    studies: tuple[Study, ...]

    @property
    def n(self) -> int:
        """Number of points."""
        return math.prod(self.dims.values())

    def over(self, found: Column, dims: Iterable[str]) -> Codes:
        """Codes of a column over dimensions, all those of the column among them, in any order."""
        names = tuple(dims)
        codes = found.codes.transpose([found.along.index(each) for each in names if each in found.along])
        codes = codes.reshape([self.dims[each] if each in found.along else 1 for each in names])
        return np.broadcast_to(codes, [self.dims[each] for each in names])

    def array(self, found: Column, keep: Sequence[str] = ()) -> tuple[tuple[str, ...], NDArray[Any]]:
        """Dimensions and values of a column along those where they vary, and along `keep` in any case."""
        names = tuple(each for each in self.dims if each in found.along or each in keep)
        return names, np.array(found.values)[self.over(found, names)]

    def at(self, found: Column, point: Mapping[str, int]) -> Any:
        """The value of a column at the indices of a point."""
        return found.values[found.codes[tuple(point[each] for each in found.along)]]

    def grouped(self, *columns: Column) -> tuple[tuple[str, ...], Codes, Combinations]:
        """The dimensions of several columns, over them numbers of the combinations of values that there are, and these
        combinations.
        """
        names = tuple(each for each in self.dims if any(each in one.along for one in columns))
        codes = [self.over(one, names).ravel() for one in columns]
        first, numbers = group_rows((own, len(one.values)) for one, own in zip(columns, codes, strict=True))
        of_all = Combinations(tuple(one.values for one in columns), tuple(codes))
        return names, numbers.reshape([self.dims[each] for each in names]), of_all.taken(first)

    def combined(self, make: Callable[..., Hashable], *columns: Column) -> Column:
        """The column of what is made of the values of other columns."""
        names, codes, combinations = self.grouped(*columns)
        return column(names, codes, [make(*each) for each in combinations])

    def of_studies(self, objects: Sequence[Hashable]) -> Column:
        """The column of what belongs to each of the studies."""
        own = self.columns["study"]
        return column(own.along, own.codes, objects)

    def along(self, arrays: Sequence[NDArray[Any]], keep: Sequence[str] = ()) -> tuple[tuple[str, ...], NDArray[Any]]:
        """Dimensions along which arrays of the studies differ, or that are kept, and these arrays along them."""
        first: dict[bytes, int] = {}
        alike = [first.setdefault(each.tobytes(), number) for number, each in enumerate(arrays)]
        names, places = self.array(self.of_studies(alike), keep)
        return names, np.stack(arrays)[places]

    def axis(self, name: str) -> Column:
        """The column of values of an axis."""
        places = self.columns[name]
        if name in SOLVER_AXES:
            return Column(places.along, places.codes, getattr(self.studies[0].solver, name))
        tables = [getattr(each.axes, name) for each in self.studies]
        if all(each is tables[0] or each == tables[0] for each in tables):
            return Column(places.along, places.codes, tables[0])
        return self.combined(lambda number, place: tables[number][place], self.columns["study"], places)

    @property
    def _walk(self) -> list[str]:
        return sorted(self.dims, key=lambda name: name in self.own)

    @property
    def numbers(self) -> Codes:
        """Numbers (n,) of the points in the order of the result, as tasks walk through them: scene after scene."""
        whole = np.arange(self.n, dtype=CODE).reshape(tuple(self.dims.values()))
        return whole.transpose([list(self.dims).index(name) for name in self._walk]).ravel()

    def walked(self, *columns: Column) -> tuple[Codes, Combinations]:
        """For each point, in the order of `numbers`, the number (n,) of its combination of values of columns; and these
        combinations, in the order in which they come first.
        """
        names, codes, found = self.grouped(*columns)
        first, rows = group_rows([(self.over(Column(names, codes, ()), self._walk).ravel(), len(found))])
        _, rows, order = as_they_come(first, rows)
        return rows, found.taken(order)

    def values_walked(self, found: Column) -> NDArray[Any]:
        """The value (n,) of a column at each point, in the order of `numbers`."""
        return np.array(found.values)[self.over(found, self._walk).ravel()]

    def groups(self, *columns: Column) -> Iterator[tuple[tuple[Any, ...], list[int]]]:
        """Combinations of values of columns, as they come first, each with the numbers of its points."""
        codes, combinations = self.walked(*columns)
        numbers = self.numbers[np.argsort(codes, kind="stable")]
        for each, alike in zip(combinations, np.split(numbers, np.cumsum(np.bincount(codes))[:-1]), strict=True):
            yield each, alike.tolist()


def points_of(study: Study) -> Points:
    """The points of a study. Values that differ between contact pairs are not in them.

    Raises UserError where a sample draws a value that is none.
    """
    dims = {name: len(values) for name, values in study.dimensions.items()}
    of_scenes = [axis.name for axis in study.scene_axes if axis.name in dims]
    own = tuple(name for name in dims if name not in (POINT, *of_scenes, SAMPLE))
    columns = {}
    for name in (*AxesSection.model_fields, *SOLVER_AXES):
        values = getattr(study.solver if name in SOLVER_AXES else study.axes, name) or ()
        dim = "frequency_ratio" if name == "frequency" and study.axes.frequency_ratio is not None else name
        if study.design is not None and dim in study.design.columns:
            columns[name] = Column((POINT,), study.design.columns[dim].codes, range(len(values)))
        elif values:
            names, places = [each for each in (dim,) if each in dims], range(len(values))
            columns[name] = column(names, np.array(places).reshape([len(places)] * len(names)), places)
    variants = study.variants or (study,)
    whole = np.arange(len(variants)).reshape(-1, *(dims[name] for name in of_scenes))
    along, codes = of_scenes, whole[0]
    if study.design is not None:
        rows = study.design.groups([axis.name for axis in study.scene_axes if axis.name not in dims])[1]
        along, codes = [POINT, *along], whole[rows]
    studies = variants
    if study.scatter is not None:
        studies = tuple(each for variant in variants for each in samples_of(variant))
        along, codes = [*along, SAMPLE], codes[..., None] * study.scatter.n_rows + np.arange(study.scatter.n_rows)
    columns["study"] = column(along, codes, range(len(studies)))
    return Points(dims, own, columns, studies)

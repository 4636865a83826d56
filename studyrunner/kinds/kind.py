"""What a kind of study is: all that differs between kinds, as values, and the files of its folder with functions."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from studyrunner.values import Wrong
from studyrunner.variables import Variable


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of study.

    - name: of its folder, and attribute `kind` of a result. words: what its points are.
    - about: what a result holds, of a {scene}. time: how well the time of a run is known.
    - marker: what only studies of this kind have, a table or a key of [axes]; empty of the kind of all others.
    - axes: those of the result that are neither keys of the solver, of [scene] and [wear], nor samples, in their order.
      last_axes: of those the ones behind all others. other_axes: that stand in place of some of them, or are none.
    - numbers: axes that hold numbers of the joint and of its excitation, which may scatter.
    - no_columns: axes that no column of a design gives.
    - reads: keys that it reads of tables which not every kind reads as a whole. why: another one is to be left out.
    - rules: what it asks of the tables of a study; those of a kind with a table of its own are in its file "rules".
    - asked, always, more: variables that `outputs.variables` may name, that every result holds, and that other keys ask
      for; in the order of the file. of_rings: of studies of all sectors of a ring. usual, of_samples: those where the
      study names none, and where samples are drawn.
    - scene: what `outputs.variables` may ask of the scene, names of `coordinates.SCENE`.
    - counted: what the slow time counts; empty without a slow time: `cycle` is then an axis, of the wear before.
    - whole: whether these counts are whole numbers.
    - follows: whether the frequency of the excitation can follow a resonance.
    - dimensions: further ones of its variables, of a study. coordinates: that mean another thing than in other kinds.
    """

    name: str
    words: str
    about: str
    time: str
    marker: str = ""
    axes: tuple[str, ...]
    last_axes: tuple[str, ...] = ()
    other_axes: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    no_columns: tuple[str, ...] = ()
    reads: Mapping[str, tuple[str, ...]]
    why: str = ""
    rules: Callable[[Any], Iterator[Wrong]] | None = None
    asked: Mapping[str, Variable]
    always: Mapping[str, Variable]
    more: Mapping[str, Variable] = field(default_factory=dict)
    of_rings: Mapping[str, Variable] = field(default_factory=dict)
    usual: tuple[str, ...]
    of_samples: tuple[str, ...]
    scene: tuple[str, ...] = ("mesh", "natural_frequency")
    counted: str = ""
    whole: bool = False
    follows: bool = False
    dimensions: Callable[[Any], Mapping[str, Sequence[str]]] = lambda _: {}
    coordinates: Mapping[str, Variable] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Callable[[str], "Kind"], tuple[str]]:
        """A study that goes to another rank has there the same kind."""
        return _named, (self.name,)

    @property
    def table(self) -> str:
        """Name of the table that marks it; empty where a key does."""
        return self.marker.strip("[]") if self.marker.startswith("[") else ""

    @property
    def wear_states(self) -> str:
        """Name of the coordinate along which its results are worn, be it an axis or the slow time."""
        return self.counted or "cycle"

    @property
    def variables(self) -> Mapping[str, Variable]:
        """All that its tasks compute."""
        return {**self.asked, **self.always, **self.more, **self.of_rings}

    def is_in(self, tables: Mapping[str, Any]) -> bool:
        """Whether the tables of a study file have what marks it."""
        table, _, key = self.marker.strip("[]").partition(".")
        return table in tables and (not key or key in tables[table])

    def is_read(self, table: str, key: str) -> bool:
        """Whether it reads a key of a study."""
        axes = (*self.axes, *self.last_axes, *self.other_axes)
        return key in {**self.reads, "axes": axes}.get(table, (key,))

    def broken_rules(self, study: Any) -> Iterator[Wrong]:
        """What is wrong in a study whose tables are right by themselves."""
        found: Iterator[Wrong] = (self.rules or self.part("rules").broken_rules)(study)
        return found

    def part(self, name: str) -> Any:
        """A file of its folder, loaded where it is used: studies are read without tasks, and results without studies.

        - "rules", of a kind with a table: `broken_rules(study)`, `TABLE`, its class, `read_table` and `complete`;
        - "tasks": `build_tasks(study, points, n_displacements)`, `plan_rows(study)`, and `WAYS`, what n tasks with m
          results do, in words;
        - "findings": `what_came_out(result, stuck)`, `errors_of(result, wore)`;
        - "figures": `FIGURES`, in the order of the page.
        """
        return import_module(f"{__package__}.{self.name}.{name}")


def _named(name: str) -> Kind:
    found: Kind = import_module(f"{__package__}.table").KINDS[name]
    return found

"""Hashes by which results are found again: hashes of all inputs of a result, the solver included.

A changed study uses the results with unchanged hashes. A start state depends on its own frequency and on its sweep, not
on the other frequencies of the study, as the steps of a sweep follow from the joint. A wear history depends on its
start state.

By hand: `joblib.hash` hashes pickled bytes, which change with the versions of Python and numpy.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, astuple, replace
from functools import cache

from solver.settings import SolverSettings
from studyrunner.plan.sharing import ScaledHistory
from studyrunner.plan.tasks import BranchTask, Joint, MarchTask
from studyrunner.system.source_digest import package_digest

_NO_JOINT = Joint(0, None)


class Identities:
    """Hashes of the tasks of a study.

    scene_digests: hash of the model of each scene, see SceneFacts; one text for a study with one scene.
    kind: description of the record of a result. Results with other variables or other numbers of outputs have other
        hashes.
    """

    def __init__(self, scene_digests: str | Sequence[str], kind: str) -> None:
        self._kind = kind
        self._digests = (scene_digests,) if isinstance(scene_digests, str) else tuple(scene_digests)
        self._lines: dict[int, tuple[str, ...]] = {}
        self._kept: dict[tuple[object, ...], str] = {}

    def of_starts(self, branch: BranchTask) -> tuple[str, ...]:
        """Hashes of the start states at all frequencies of a branch, (n_frequencies,)."""
        if branch.number not in self._lines:
            settings = _settings(branch.settings)
            follow = None if branch.follow is None else astuple(branch.follow)
            mode = () if branch.mode is None else ("mode", branch.mode)
            line = (branch.excitation_amplitude, branch.sweep, settings, follow, *mode)
            key = _digest("line", self._joint(branch.joint), line)
            self._lines[branch.number] = tuple(_digest("start", key, frequency) for frequency in branch.frequencies)
        return self._lines[branch.number]

    def of_histories(self, branch: BranchTask, march: MarchTask) -> tuple[str, ...]:
        """Hashes of the histories of a task."""
        start = self._of_blocks(march) if march.blocks else self.of_starts(branch)[march.position]
        own = (*self._wear(march, march.histories[0]), march.scheme if not march.held else "", march.held)
        ends = [None if each is None else astuple(each) for each in (march.until, march.to_the_end)]
        kept = march.cycles, march.loops, tuple(ends)
        if kept not in self._kept:
            self._kept[kept] = _digest(self._kind, kept)
        base = ("history", start, self._kept[kept], own, march.largest_depth, asdict(march.law))
        wear = (self._wear(march, scaled) for scaled in march.histories)
        return tuple(_digest(*base, place > 0, each) for place, each in enumerate(wear))

    def _of_blocks(self, march: MarchTask) -> str:
        """Hash of the blocks of a mission with their scenes."""
        blocks = [(self._joint(block.joint), astuple(replace(block, joint=_NO_JOINT))) for block in march.blocks]
        return _digest("mission", blocks, march.sweep, _settings(march.settings))

    def _joint(self, joint: Joint) -> tuple[object, ...]:
        """Scene and friction, and the solver."""
        return (self._digests[joint.scene], joint.friction_coefficient, *joint.contact, solver_digest())

    @staticmethod
    def of_march(histories: tuple[str, ...]) -> str:
        """Hash of the progress of a task with these histories. The progress depends on the counts of all histories."""
        return _digest("march", histories)

    def of_branch(self, branch: BranchTask) -> str:
        """Hash of the progress of a branch."""
        return _digest("branch", self.of_starts(branch))

    @staticmethod
    def _wear(march: MarchTask, scaled: ScaledHistory) -> tuple[float, float | None]:
        """Wear coefficient, and step where the step matters."""
        of_its_own = march.held or march.scheme in ("adaptive", "final")
        of_its_own = of_its_own or (march.scheme == "explicit" and march.largest_depth is not None)
        return scaled.wear_coefficient, None if of_its_own else scaled.step


def _settings(settings: SolverSettings) -> list[tuple[str, object]]:
    """Settings; a time limit decides whether there is a result, not the values of the result."""
    return [item for item in asdict(settings).items() if item[0] != "time_limit"]


@cache
def solver_digest() -> str:
    """Hash of the source of the solver and of the versions of the packages that it uses."""
    return package_digest("solver")


def _digest(*values: object) -> str:
    """Hash of values; numbers enter with all bits."""
    text = json.dumps(values, allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def hash_of_kind(fields: Sequence[object]) -> str:
    """Hash of the description of a record."""
    return hashlib.sha256(repr(fields).encode()).hexdigest()[:32]

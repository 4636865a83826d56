"""What takes long and is the same in each run of a study: the reduced model of the scene, its natural frequencies."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeVar

from solver.packed_model import pack_model, unpack_model
from solver.packing import Packed, pack, unpack
from studies.scene_answers import NaturalFrequencies
from studyrunner.study.study import Study
from studyrunner.system.source_digest import package_digest

if TYPE_CHECKING:
    from solver.model import ReducedModel

LEAST_SECONDS = 2.0
"""Time, s, above which a value is kept. Shorter times are not worth the space in the file."""

T = TypeVar("T")


class Computed(Protocol):
    """Where values are kept for later runs of a study, by hash of their inputs."""

    def keep_computed(self, key: str, value: Packed) -> None:
        """Keeps a value."""

    def read_computed(self, key: str) -> Packed | None:
        """What `keep_computed` has kept, in this run or an earlier one; None where there is nothing."""


class InMemory(dict[str, Packed]):
    """A `Computed` without a file, for commands that leave nothing behind."""

    def keep_computed(self, key: str, value: Packed) -> None:
        """Keeps a value."""
        self[key] = value

    def read_computed(self, key: str) -> Packed | None:
        """What was kept; None where there is nothing."""
        return self.get(key)


def model_once(study: Study, n_harmonics: int, computed: Computed, build: Callable[[], ReducedModel]) -> ReducedModel:
    """The reduced model of a scene that is not read from a scene file, built or from an earlier run.

    Both are equal to the last bit, and so are all results (`solver.packed_model`).
    """
    key = _key("model", study, n_harmonics)
    return _once(key, computed, build, pack_model, unpack_model)


def frequencies_once(study: Study, computed: Computed, find: Callable[[], NaturalFrequencies]) -> NaturalFrequencies:
    """Natural frequencies of a bundled scene, computed or from an earlier run."""
    return _once(
        _key("natural frequencies", study),
        computed,
        find,
        lambda found: pack((found.nodal_diameters, found.frequencies)),
        lambda packed: NaturalFrequencies(*unpack(packed)),
    )


def _once(
    key: str,
    computed: Computed,
    compute: Callable[[], T],
    packed: Callable[[T], Packed | None],
    unpacked: Callable[[Packed], T],
) -> T:
    known = computed.read_computed(key)
    if known is not None:
        # what another version has kept under this name, or what is damaged, is computed again
        with contextlib.suppress(ValueError, KeyError, TypeError, IndexError, AttributeError):
            return unpacked(known)
    began = time.monotonic()
    found = compute()
    if time.monotonic() > began + LEAST_SECONDS and (value := packed(found)) is not None:
        computed.keep_computed(key, value)
    return found


def _key(what: str, study: Study, *more: object) -> str:
    """Hash of a value of the scene of a study: its model, parameters and files, and the source of the scenes."""
    # imported here: most studies have no finite-element model
    origin: dict[str, str] = {}
    if study.scene.files is not None:
        from studies.fe_models.from_files.scene import describe_origin

        origin = describe_origin(study.scene.files, study.scene.parameters)
    sources = [package_digest(package) for package in ("studies", "solver")]
    given = study.scene.model, study.scene.parameters.model_dump(mode="json"), origin, more
    text = json.dumps((what, sources, given), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]

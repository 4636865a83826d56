"""What takes long and is the same in each run of a study: the reduced model of the scene, its natural frequencies."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeVar

from solver.packing import Packed, pack, pack_model, unpack, unpack_model
from studies.scene_answers import NaturalFrequencies
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE, scene_frequencies, scene_has
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.machine import package_digest

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

    keep_computed = dict.__setitem__
    read_computed = dict.get


def harmonics_to_build(study: Study) -> int:
    """Number of harmonics that a scene is built for, those that show the error of a given number included."""
    # two levels up: 1, 3, 5, 7, 9, 13, 19, 27...
    shown = 2 * max(study.given_harmonics, default=0) + 3
    return max(shown, AUTOMATIC_HARMONICS_OF_A_WAVE) if AUTO in study.harmonics else shown


def model_once(study: Study, computed: Computed, build: Callable[[], ReducedModel]) -> ReducedModel:
    """The reduced model of a scene that is not read from a scene file, built or from an earlier run.

    Both are equal to the last bit, and so are all results (`solver.packing`).
    """
    return _once(model_key(study), computed, build, pack_model, unpack_model)


def model_key(study: Study) -> str:
    """Hash under which the model of a scene is kept."""
    return _key("model", study, harmonics_to_build(study))


def keep_model(study: Study, model: ReducedModel, computed: Computed) -> None:
    """Keeps a model, however long it has taken. Raises ValueError where the model cannot be kept."""
    packed = pack_model(model)
    if packed is None:
        raise ValueError(f"the matrices of {study.scene.model} are not stored by rows")
    computed.keep_computed(model_key(study), packed)


def read_model(study: Study, computed: Computed) -> ReducedModel:
    """A model that `keep_model` has kept. Raises RuntimeError where it is no longer there."""
    packed = computed.read_computed(model_key(study))
    if packed is None:
        raise RuntimeError(f"the model of {study.scene.model} has gone")
    return unpack_model(packed)


def frequencies_once(study: Study, computed: Computed) -> NaturalFrequencies:
    """Natural frequencies of a bundled scene, computed or from an earlier run."""
    return _once(
        _key("natural frequencies", study),
        computed,
        lambda: scene_frequencies(study.scene.model, study.scene.parameters),
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
        # what is damaged, or of another version, is computed again
        with contextlib.suppress(ValueError, KeyError, TypeError, IndexError, AttributeError):
            return unpacked(known)
    began = time.monotonic()
    found = compute()
    if time.monotonic() > began + LEAST_SECONDS and (value := packed(found)) is not None:
        computed.keep_computed(key, value)
    return found


def scene_parameters_of(study: Study) -> dict[str, object]:
    """Parameters that the model of a scene depends on: without one friction coefficient for all pairs, on which most
    scenes do not depend.
    """
    given: dict[str, object] = study.scene.parameters.model_dump(mode="json")
    depends = study.scene.is_bundled and scene_has(study.scene.model, "FRICTION_IN_MODEL")
    if not depends and not isinstance(given["friction_coefficient"], dict):
        del given["friction_coefficient"]
    return given


def describe_origin(study: Study) -> dict[str, str]:
    """Attributes on the files of a finite-element model; none for other scenes. Raises OSError, SceneError."""
    # imported where they are used: most studies have no such model
    if study.scene.files is not None:
        from studies.fe_models.from_files.scene import describe_origin as describe_files

        return describe_files(study.scene.files, study.scene.parameters)
    if study.scene.path is None:
        return {}
    from studies.scene_file import read_origin

    return read_origin(study.scene.path)


def _key(what: str, study: Study, *more: object) -> str:
    """Hash of a value of a scene that is built: its model, parameters and files, and the source of the scenes."""
    sources = [package_digest(package) for package in ("studies", "solver")]
    given = study.scene.model, scene_parameters_of(study), describe_origin(study), more
    text = json.dumps((what, sources, given), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]

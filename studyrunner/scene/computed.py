"""The reduced model of a scene, which may take long and is the same in each run of a study: kept for later runs."""

from __future__ import annotations

import contextlib
import hashlib
import json
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from solver.packing import Packed, pack_model, unpack_model
from studies.fe_models.model_files import file_digest
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE, scene_has
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.machine import package_digest

if TYPE_CHECKING:
    from solver.model import ReducedModel

LEAST_SECONDS = 2.0
"""Time, s, above which a model is kept. Shorter times are not worth the space in the file."""


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
    return max(shown, AUTOMATIC_HARMONICS_OF_A_WAVE) if AUTO in study.solver.harmonics else shown


def model_once(study: Study, computed: Computed, build: Callable[[], ReducedModel]) -> ReducedModel:
    """The reduced model of a scene that is not read from a scene file, built or from an earlier run.

    Both are equal to the last bit, and so are all results (`solver.packing`).
    """
    key = model_key(study)
    if (known := computed.read_computed(key)) is not None:
        # what is damaged, or of another version, is built again
        with contextlib.suppress(ValueError, KeyError, TypeError, IndexError, AttributeError):
            return unpack_model(known)
    began = time.monotonic()
    model = build()
    if time.monotonic() > began + LEAST_SECONDS and (packed := pack_model(model)) is not None:
        computed.keep_computed(key, packed)
    return model


def model_key(study: Study) -> str:
    """Hash under which the model of a scene is kept: of its parameters and files, and of the source of the scenes."""
    sources = [package_digest(package) for package in ("studies", "solver")]
    content = None if study.scene.path is None else file_digest(study.scene.path)
    own = study.scene.model, scene_parameters_of(study), describe_origin(study), content, harmonics_to_build(study)
    return hashlib.sha256(json.dumps((sources, own), sort_keys=True).encode()).hexdigest()[:32]


def scene_parameters_of(study: Study) -> dict[str, object]:
    """Parameters that the model of a scene depends on: mostly without one friction coefficient for all pairs."""
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

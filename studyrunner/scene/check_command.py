"""What is said of the finite-element model of a study: remarks on its files, and the lines and picture of `--check`."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from studyrunner.scene.scene import harmonics_to_build
from studyrunner.study.mistakes import scene_errors
from studyrunner.study.study import Study
from studyrunner.user_error import UserError, show_text


def remarks_of_study(study: Study) -> tuple[tuple[str, str], ...]:
    """Label and text of each line on what was skipped in files, or read in one of two ways."""
    if study.scene.files is None:
        return ()
    from studies.fe_models.mesh_files import read_mesh_file

    return read_mesh_file(study.scene.files.mesh).remarks


def check_study_model(study: Study, picture: Path, progress: Callable[[str], None]) -> str:
    """Lines on the model of a study; the picture shows the contact pairs.

    Raises UserError where the study has no finite-element model, the model is wrong, or the picture cannot be written.
    """
    files = study.scene.files
    if files is None:
        remedy = f"give a study of a finite-element model: {study.scene.model} is none; --plan tells what is computed"
        raise UserError("command line", "--check", study.source, remedy)
    # what reads and reduces it is loaded where there is one
    from studies.fe_models.from_files.check import describe_model
    from studies.fe_models.from_files.model import load_model
    from studies.fe_models.from_files.picture import draw_pairs
    from studies.fe_models.from_files.scene import checked, describe_origin, reduce_model

    parameters = checked(study.scene.parameters)
    with scene_errors(study.source, None), np.errstate(all="ignore"):
        loaded = load_model(files, parameters, progress)
        scene = reduce_model(loaded, parameters, harmonics_to_build(study), progress)
        rows = describe_model(loaded, scene, parameters, progress)
        rows.insert(0, ("files", describe_origin(files, parameters)["model_files"]))
    try:
        draw_pairs(loaded, scene, picture)
    except OSError as error:
        remedy = f"give a folder that can be written to: {error.strerror or error}"
        raise UserError("command line", "--check", str(picture), remedy) from None
    return "\n".join(f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows)

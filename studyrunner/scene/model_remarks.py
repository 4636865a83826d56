"""What is to be said of the files of a finite-element model: what was skipped, and what was read in one of two ways."""

from __future__ import annotations

from studyrunner.study.study import Study


def remarks_of_study(study: Study) -> tuple[tuple[str, str], ...]:
    """Label and text of each line, the same for `--check`, `--plan` and a run; none without a finite-element model."""
    if study.scene.files is None:
        return ()
    from studies.fe_models.mesh_files import read_mesh_file

    return read_mesh_file(study.scene.files.mesh).remarks

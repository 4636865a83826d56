"""The table at the end of a run, by what the study computes."""

from __future__ import annotations

from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.summary.certificates import CertificateTable
from studyrunner.summary.mission_table import MissionTable
from studyrunner.summary.mode_table import ModeTable


def table_of(study: Study, facts: SceneFacts) -> CertificateTable | MissionTable | ModeTable:
    """The table that collects the records of a study."""
    if study.has_modes:
        return ModeTable(study)
    return MissionTable(study, facts) if study.has_missions else CertificateTable(study, facts)

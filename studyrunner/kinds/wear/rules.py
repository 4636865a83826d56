"""What wear histories ask of the tables of a study."""

from collections.abc import Iterator

from studyrunner.study.study import Study
from studyrunner.values import Wrong


def broken_rules(study: Study) -> Iterator[Wrong]:
    """The excitation has a frequency."""
    if not study.axes.model_fields_set & {"frequency", "frequency_ratio"}:
        yield Wrong("axes.frequency", None, "give either it, in Hz, or frequency_ratio")

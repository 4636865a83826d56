"""The record of a history: all that its result says, and what stands there without one."""

from dataclasses import replace

import numpy as np

from studyrunner.checkpoint.records import empty_record, pack_record, record_of, record_type, values_in
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import failed_result
from studyrunner.study.study_file import read_study
from tests.studyrunner.fakes import FACTS

OVERRIDES = (
    "axes.frequency=[160, 150]",
    "slow_time.outputs=3",
    "axes.sweep=['up', 'down']",
    "axes.scheme=adaptive",
    "axes.wear_coefficient=[1e-12, 1e-11]",
)


def test_of_a_point_that_failed_the_record_has_no_numbers_but_says_why():
    study = read_study("sdof_slider", OVERRIDES)
    kind = record_type(study, FACTS)
    task = build_tasks(study, FACTS.n_displacements).marches[0][0]
    failed = failed_result(task, 1, 11, "what went wrong")
    assert (failed.points, failed.place) == (task.histories[1].points, 1)
    (record,) = record_of(kind, failed)
    assert (record["outcome"], record["message"]) == (11, "what went wrong")
    (nothing,) = empty_record(kind)
    for found in (record, nothing):
        for name in set(kind.names or ()) - {"outcome", "message"}:
            there = found[name]
            assert np.all(np.isnan(there) if there.dtype.kind == "f" else there == 0), name


def test_a_record_of_another_study_is_none_of_this():
    study, other = (read_study("sdof_slider", (*OVERRIDES, f"slow_time.outputs={n}")) for n in (3, 4))
    kind = record_type(study, FACTS)
    packed = pack_record(empty_record(kind))
    wrong = [replace(packed, arrays=arrays) for arrays in ((), (np.zeros(3),), (np.zeros(kind.itemsize),))]
    for odd in (pack_record(empty_record(record_type(other, FACTS))), replace(packed, text=""), *wrong):
        assert values_in(odd, kind) is None
    assert values_in(None, kind) is None
    assert values_in(packed, kind) is not None

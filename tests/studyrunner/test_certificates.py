"""The table of the worst certificates: against a plain loop over all points and cycles, and its wording."""

import itertools

import numpy as np
import pytest

from studyrunner.plan.planning import build_tasks
from studyrunner.study.study_file import read_study
from studyrunner.summary.certificates import CertificateTable
from studyrunner.variables import CERTIFICATE
from tests.studyrunner.fakes import FACTS, changed, fake_histories, without_values
from tests.studyrunner.results_of import told

GRID = (
    "axes.frequency=[160, 150, 155]",
    "axes.wear_coefficient=[0, 1e-11]",
    "axes.step=[100, 1000]",
    "axes.scheme=['implicit', 'explicit']",
    "axes.sweep=['up', 'down']",
    "axes.harmonics=['auto', 3]",
    "slow_time.outputs=[0, 100, 1000]",
)


def study_with_results(overrides=GRID):
    """Random certificates, some of them not estimated."""
    study = read_study("sdof_slider", overrides)
    plan = build_tasks(study, FACTS.n_displacements)
    rng = np.random.default_rng(7)
    results = []
    for _, result in fake_histories(plan):
        drawn = {name: rng.random(len(study.cycles_kept)).round(1) for name in CERTIFICATE}
        for values in drawn.values():
            values[rng.random(values.size) < 0.3] = np.nan
        stable = np.ones(len(study.cycles_kept), dtype=np.int8)
        results.append(changed(result, **drawn, stable=stable))
    return study, results


def table_of(study, results):
    lines = told(CertificateTable.format, lambda: CertificateTable(study, FACTS), study, results).splitlines()
    width = len(lines[0]) - len(lines[0].split("  ")[-1].lstrip())
    return {line[:width].strip(): line[width:].strip() for line in lines}


def worst_by_plain_loop(study, results, name):
    """Walks through the points in the order of the file, then through the cycles; the first of equal values counts."""
    by_point = {point: result for result in results for point in result.points}
    best, where = -1.0, ""
    for point in itertools.product(*(range(len(values)) for values in study.dimensions.values())):
        result = by_point[point]
        if result.outcome != 0:
            continue
        for cycle, value in zip(study.cycles_kept, result.values[name].tolist(), strict=True):
            if value > best:
                frequency, wear, _, step, scheme, sweep, harmonics = (
                    values[place] for place, values in zip(point, study.dimensions.values(), strict=True)
                )
                best = value
                where = (
                    f"frequency {frequency:g} Hz, wear_coefficient {wear:g} 1/Pa, step {step:g}, scheme {scheme},"
                    f" sweep {sweep}, harmonics {harmonics}, cycle {cycle:g}"
                )
    return f"{best:.1e} at {where}"


@pytest.mark.parametrize("name", CERTIFICATE)
def test_worst_of_all_converged_points_and_where(name):
    study, results = study_with_results()
    place = next(index for index, result in enumerate(results) if np.nanmax(result.values[name]) > 0.8)
    results[place] = without_values(results[place], 4)
    assert table_of(study, results)[CERTIFICATE[name]] == worst_by_plain_loop(study, results, name)


def test_jumps_and_unstable_states_are_counted():
    study, results = study_with_results(("axes.frequency=[150, 160]", "axes.scheme=implicit", "slow_time.outputs=3"))
    results[0] = changed(results[0], jump_cycle=900.0)
    results[1] = changed(results[1], jump_cycle=800.0)
    table = table_of(study, results)
    assert table["jumps while wearing"] == "2, the first at cycle 800 at frequency 160 Hz"
    results[0] = changed(results[0], stable=np.array([1, 0, 1], dtype=np.int8))
    assert table_of(study, results)["unstable states"].startswith("1, the first at frequency 150 Hz")


def test_explicit_steps_beyond_their_limit_are_counted():
    overrides = ("axes.frequency=150", "axes.step=[100, 1000, 1e6]", "axes.scheme=['implicit', 'explicit']")
    study, results = study_with_results((*overrides, "slow_time.cycles=5000"))
    limited = [changed(result, step_limit=500.0) for result in results]
    found = table_of(study, limited)["explicit steps too long"]
    assert found == "2, the first at step 1000, scheme explicit: longer than step_limit"
    # No step is longer than all cycles.
    limited = [changed(result, step_limit=5000.0) for result in results]
    assert table_of(study, limited)["explicit steps too long"] == "none"
    study, results = study_with_results((*overrides, "slow_time.largest_depth=1e-6"))
    limited = [changed(result, step_limit=500.0) for result in results]
    assert table_of(study, limited)["explicit steps too long"] == "none"

"""Benchmarks for other programs: each is a study, and comes out within its tolerance."""

from pathlib import Path

import pytest

from studyrunner import read_study
from tests.benchmarks.validation import FILES, read_targets, run_case
from tests.benchmarks.validation import __file__ as validation

PAGE = Path(validation).parents[2] / "solver" / "VALIDATION.md"
TARGETS = {row["case"]: row for row in read_targets()}


def test_the_page_has_all_targets():
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    assert len(rows) == len(TARGETS) == len(list((FILES / "cases").glob("*.toml")))
    for row, (name, given) in zip(rows, TARGETS.items(), strict=True):
        read_study(FILES / "cases" / f"{name}.toml")
        factor, unit = given["unit"].split()
        for word in (
            f"`{name}.toml`",
            f"{given['target']}{factor[1:]} {unit}",
            f"{100.0 * float(given['tolerance']):g} %",
        ):
            assert word in row


# partial slip is that of the half-space scenes, at twice their size
@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*TARGETS} - {"partial_slip"}))
def test_a_case_comes_out_within_its_tolerance(name, tmp_path):
    computed, error = run_case(TARGETS[name], tmp_path)
    target, tolerance = float(TARGETS[name]["target"]), float(TARGETS[name]["tolerance"])
    assert computed == pytest.approx(target, rel=tolerance)
    assert error < tolerance

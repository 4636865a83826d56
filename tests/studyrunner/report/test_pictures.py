"""The pictures of the bundled study, and the numbers written down with them, are those of this solver and study."""

import hashlib
import json
import tomllib

import pytest

from studyrunner import read_study, run_study
from studyrunner.study.study_file import format_study
from tests.benchmarks.pictures import FOLDER, NAMES, NUMBERS

RECOMPUTED = 211.0  # Hz; beside the resonance, which takes longer


@pytest.fixture(scope="module")
def stored():
    return dict(json.loads((FOLDER / NUMBERS).read_text(encoding="utf-8")))


def test_figures_of_the_bundled_study_are_all_written_down(stored):
    assert set(stored["figures"]) == set(NAMES)
    for name, digest in stored["pictures"].items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


def test_pictures_are_of_the_bundled_study_as_it_is(stored):
    """What a study has been given since, with a default, changes nothing; outputs are not what is computed."""
    now, then = tomllib.loads(format_study(read_study("dovetail"))), tomllib.loads(stored["study"])
    for table in set(then) - {"outputs"}:
        assert {key: now[table].get(key) for key in then[table]} == then[table], f"run {NUMBERS} again: {table} differs"


@pytest.mark.slow
def test_a_point_computed_anew_agrees_within_the_errors(stored, tmp_path):
    changes = {
        "axes.frequency": [RECOMPUTED],
        "axes.scheme": "adaptive",
        "outputs.variables": ["worn_volume", "response_amplitude", "response_error"],
        "outputs.loops": [],
    }
    with run_study("dovetail", tmp_path / "again.nc", overrides=changes, progress=False) as result:
        point = result.squeeze(drop=True).load()
    final, unworn = (stored["figures"][name]["panels"][0] for name in ("final_worn_volume", "frequency_response"))
    # the new joint stands first
    lines = final["lines"]["adaptive scheme"], next(iter(unworn["lines"].values()))
    worn, amplitude = (dict(zip(x, y, strict=True))[RECOMPUTED] for x, y in lines)
    # of the bars at this frequency, that of the scheme is in the middle of its volume
    (own,) = [
        0.5 * (high - low)
        for at, low, high in final["bars"]
        if at == RECOMPUTED and low < worn < high and abs(0.5 * (low + high) - worn) < 1e-5 * worn
    ]
    volume, moved = 1e9 * point.worn_volume[-1].item(), 1e3 * point.response_amplitude[0].item()
    assert abs(volume - worn) <= own + volume * point.error_estimate.item()
    assert abs(moved - amplitude) <= 2.0 * point.response_error[0].item() * moved

"""The pictures of the bundled study are those of this solver, this study and this report.

Which numbers the artists of a figure hold is compared with the file in `test_figures.py`; here what
`tests.benchmarks.pictures` writes down of them, and that this is not old.
"""

import hashlib
import json
import tomllib

import pytest

from studyrunner import read_study, run_study
from studyrunner.study.study_file import format_study
from tests.benchmarks.pictures import FOLDER, NAMES, NUMBERS

RECOMPUTED = (211.0,)  # Hz; beside the resonance, which takes longer


@pytest.fixture(scope="module")
def stored():
    return dict(json.loads((FOLDER / NUMBERS).read_text(encoding="utf-8")))


def line_of(stored, figure, label):
    """Values over the frequency."""
    x, y = stored["figures"][figure]["panels"][0]["lines"][label]
    return dict(zip(x, y, strict=True))


def test_figures_of_the_bundled_study_are_all_written_down(stored):
    assert set(stored["figures"]) == set(NAMES)
    final = stored["figures"]["final_worn_volume"]["panels"][0]
    schemes = read_study("dovetail").axes.scheme
    assert {f"{scheme} scheme" for scheme in schemes} <= set(final["lines"])
    assert len(final["bars"]) > len(schemes)


def test_pictures_are_of_the_bundled_study_as_it_is(stored):
    """What a study has been given since, with a default, changes nothing; outputs are not what is computed."""
    now, then = tomllib.loads(format_study(read_study("dovetail"))), tomllib.loads(stored["study"])
    for table in set(then) - {"outputs"}:
        assert {key: now[table].get(key) for key in then[table]} == then[table], f"run {NUMBERS} again: {table} differs"


def test_pictures_are_those_that_were_written_with_the_numbers(stored):
    for name, digest in stored["pictures"].items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


@pytest.mark.slow
def test_points_computed_anew_agree_within_the_errors(stored, tmp_path):
    changes = {
        "axes.frequency": list(RECOMPUTED),
        "axes.scheme": "adaptive",
        "outputs.variables": ["worn_volume", "response_amplitude", "response_error"],
        "outputs.loops": [],
    }
    with run_study("dovetail", tmp_path / "again.nc", overrides=changes, progress=False) as result:
        varied = {"frequency", "cycle", "response", "contact"}
        again = result.squeeze([name for name in result.outcome.dims if name not in varied], drop=True).load()
    worn = line_of(stored, "final_worn_volume", "adaptive scheme")
    bars = stored["figures"]["final_worn_volume"]["panels"][0]["bars"]
    # the new joint stands first
    new = next(iter(stored["figures"]["frequency_response"]["panels"][0]["lines"]))
    unworn = line_of(stored, "frequency_response", new)
    for frequency in RECOMPUTED:
        point = again.sel(frequency=frequency)
        volume = 1e9 * point.worn_volume.isel(cycle=-1).item()
        # of the bars at this frequency, that of the scheme is in the middle of its volume
        (own,) = [
            0.5 * (high - low)
            for at, low, high in bars
            if at == frequency and low < worn[at] < high and abs(0.5 * (low + high) - worn[at]) < 1e-5 * worn[at]
        ]
        assert abs(volume - worn[frequency]) <= own + volume * point.error_estimate.item()
        amplitude = 1e3 * point.response_amplitude.isel(cycle=0).item()
        error = point.response_error.isel(cycle=0).item()
        assert abs(amplitude - unworn[frequency]) <= 2.0 * error * amplitude

"""The pictures of the bundled study are those of this solver, this study and this report.

Which numbers the artists of a figure hold is compared with the file in `test_figures_values.py`,
`test_known_volumes.py` and `test_figures_pairs.py`; here, of the root; and what `tests.benchmarks.pictures` writes down
of them, and that this is not old.
"""

import hashlib
import json
import tomllib

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from studyrunner import read_study, run_study
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.views import find_views
from studyrunner.study.study_file import format_study
from tests.benchmarks.pictures import FOLDER, NAMES, NUMBERS
from tests.studyrunner.report.figure_numbers import draw_figure
from tests.studyrunner.report.page_cases import as_result
from tests.studyrunner.report.root_cases import dovetail_file

RECOMPUTED = (211.0,)  # Hz; beside the resonance, which takes longer


@pytest.fixture(scope="module")
def stored():
    return dict(json.loads((FOLDER / NUMBERS).read_text(encoding="utf-8")))


def line_of(stored, figure, label):
    """Values over the frequency."""
    x, y = stored["figures"][figure]["panels"][0]["lines"][label]
    return dict(zip(x, y, strict=True))


def test_the_root_is_coloured_by_the_wear_depth_of_its_pairs(tmp_path):
    """Shares of red, green and blue: the light on a face, which differs, makes all of them larger or smaller."""

    def shares(colours):
        return np.asarray(colours[..., :3] / colours[..., :3].sum(axis=-1, keepdims=True))

    def of_faces(name, surface):
        """Of a variable of pairs: a face has four of them at its corners."""
        pairs = shown.fretwear.flank(name, surface).values
        return np.asarray(0.25 * (pairs[1:, 1:] + pairs[1:, :-1] + pairs[:-1, 1:] + pairs[:-1, :-1])).ravel()

    result = as_result(dovetail_file(), tmp_path / "dovetail.nc")
    root = read_root(result)
    assert root is not None
    views = {view.title: view.frame for view in find_views(result, root)}
    shown = result.dataset.isel(result.shown_point()).isel(cycle=-1)
    panels = draw_figure(result, "worn_root").figure.axes[1:3]
    for panel, surface in zip(panels, shown.fretwear.surfaces, strict=True):
        assert surface in panel.get_title()
        faces = next(item for item in panel.collections if isinstance(item, PolyCollection))
        drawn = shares(np.asarray(faces.get_facecolors()))
        wanted = shares(mpl.colormaps["cividis"](of_faces("wear_depth", surface) / float(shown.wear_depth.max())))
        centres = np.stack([of_faces(f"contact_{axis}", surface) for axis in "xyz"], axis=1)
        right, up, _ = views[panel.get_title()]
        for colour, centre in zip(wanted, centres, strict=True):
            alike = np.flatnonzero(np.abs(drawn - colour).max(axis=1) < 1e-3)
            places = np.array([faces.get_paths()[each].vertices[:4].mean(axis=0) for each in alike])
            # in mm; the worn shape is moved by some of them, and faces are 13 mm long
            assert np.linalg.norm(places - 1e3 * np.array([centre @ right, centre @ up]), axis=1).min() < 5.0


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
    unworn = line_of(stored, "frequency_response", "0 cycles")
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

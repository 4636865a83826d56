"""The pictures of the bundled study are those of this solver, this study and this report.

Which numbers the artists of a figure hold is compared with the file in `test_figures_values.py`,
`test_known_volumes.py` and `test_figures_pairs.py`; here, of the root; and what `tests.benchmarks.pictures` writes down
of them, and that this is not old.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from studyrunner import read_study, run_study
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.views import find_views
from studyrunner.study.study_file import format_study
from tests.benchmarks.pictures import FOLDER, NAMES, NUMBERS, as_text, make_pictures, read_figure
from tests.studyrunner.report.figure_cases import make_result, with_sector
from tests.studyrunner.report.figure_numbers import draw_figure, values_of
from tests.studyrunner.report.page_cases import as_result
from tests.studyrunner.report.root_cases import dovetail_file

RECOMPUTED = (212.0, 212.5)  # Hz; they take half a minute


@pytest.fixture(scope="module")
def stored() -> dict[str, Any]:
    return dict(json.loads((FOLDER / NUMBERS).read_text(encoding="utf-8")))


def line_of(stored: dict[str, Any], figure: str, label: str) -> dict[float, float]:
    """Values over the frequency."""
    x, y = stored["figures"][figure]["panels"][0]["lines"][label]
    return dict(zip(x, y, strict=True))


def test_final_volumes_are_written_down_with_their_errors() -> None:
    result = make_result()
    panel = read_figure(draw_figure(result, "final_worn_volume"))["panels"][0]
    assert panel["x"] == "excitation frequency (Hz)"
    assert panel["y"].endswith("(mm³)")
    expected = []
    for number, label in enumerate(("implicit scheme", "explicit scheme")):
        worn = 1e9 * values_of(result, "worn_volume", cycle=-1, scheme=number)
        wrong = values_of(result, "error_estimate", scheme=number) * worn
        at = result.dataset["frequency"].values
        np.testing.assert_allclose(panel["lines"][label], [at, worn], rtol=1e-5)
        expected += np.stack([at, worn - wrong, worn + wrong], axis=1).tolist()
    np.testing.assert_allclose(sorted(panel["bars"]), sorted(expected), rtol=1e-5)


@pytest.mark.slow
def test_the_root_is_coloured_by_the_wear_depth_of_its_pairs(tmp_path: Path) -> None:
    """Shares of red, green and blue: the light on a face, which differs, makes all of them larger or smaller."""

    def shares(colours: np.ndarray) -> np.ndarray:
        return np.asarray(colours[..., :3] / colours[..., :3].sum(axis=-1, keepdims=True))

    def of_faces(name: str, surface: str) -> np.ndarray:
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


def test_maps_and_long_lines_are_written_down_by_their_ranges() -> None:
    result = make_result()
    maps = [panel["maps"] for panel in read_figure(draw_figure(result, "worn_volume_map"))["panels"]]
    worn = [1e9 * values_of(result, "worn_volume", scheme=number) for number in (0, 1)]
    np.testing.assert_allclose(maps, [[[each.min(), each.max()]] for each in worn], rtol=1e-5)
    many = make_result(frequency=np.linspace(200.0, 204.0, 41).tolist())
    x, y = read_figure(draw_figure(many, "final_worn_volume"))["panels"][0]["lines"]["implicit scheme"]
    assert x == [200.0, 204.0]
    last = 1e9 * values_of(many, "worn_volume", cycle=-1, scheme=0)
    assert y == pytest.approx([last.min(), last.max()], rel=1e-5)


def test_gaps_are_null_in_the_text() -> None:
    figure = read_figure(draw_figure(make_result(failed=[2]), "final_worn_volume"))
    again = json.loads(as_text(figure))
    assert again == figure
    assert again["panels"][0]["lines"]["implicit scheme"][1][1] is None


def test_a_file_without_what_a_picture_needs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(KeyError, match="fretting_loops"):
        make_pictures(with_sector(make_result()), tmp_path)


def test_figures_of_the_bundled_study_are_all_written_down(stored: dict[str, Any]) -> None:
    assert set(stored["figures"]) == set(NAMES)
    final = stored["figures"]["final_worn_volume"]["panels"][0]
    schemes = read_study("dovetail").axes.scheme
    assert {f"{scheme} scheme" for scheme in schemes} <= set(final["lines"])
    assert len(final["bars"]) > len(schemes)


def test_pictures_are_of_the_bundled_study_as_it_is(stored: dict[str, Any]) -> None:
    """What a study has been given since, with a default, changes nothing; outputs are not what is computed."""
    now, then = tomllib.loads(format_study(read_study("dovetail"))), tomllib.loads(stored["study"])
    for table in set(then) - {"outputs"}:
        assert {key: now[table].get(key) for key in then[table]} == then[table], f"run {NUMBERS} again: {table} differs"


def test_pictures_are_those_that_were_written_with_the_numbers(stored: dict[str, Any]) -> None:
    for name, digest in stored["pictures"].items():
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, name


@pytest.mark.slow
def test_points_computed_anew_agree_within_the_errors(stored: dict[str, Any], tmp_path: Path) -> None:
    changes = {
        "axes.frequency": list(RECOMPUTED),
        "axes.scheme": "adaptive",
        "outputs.variables": ["worn_volume", "response_amplitude", "response_error"],
        "outputs.loops": [],
    }
    with run_study("dovetail", tmp_path / "again.nc", overrides=changes, progress=False) as result:
        again = result.squeeze(drop=True).load()
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

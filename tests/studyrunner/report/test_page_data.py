"""The numbers on the page are those of the file, and there are never too many of them."""

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.report.page import kept as page_kept
from studyrunner.report.page.data import COURSES, build_page_data
from studyrunner.report.page.maps import LOOPS, MAPS
from studyrunner.report.page.panels import MOST_PANELS, build_panels
from studyrunner.report.reading.result import Result
from studyrunner.report.root.surface import read_root
from studyrunner.report.root.views import find_views
from tests.studyrunner.report.page_cases import SENTENCES, build_file, flank_positions
from tests.studyrunner.report.root_cases import dovetail_file

PLENTY = 4e6


def result_of(dataset):
    return Result(Path("some.nc"), dataset)


def decode(entry, *shape):
    return np.frombuffer(base64.b64decode(entry["data"]), dtype="<f4").reshape(shape)


def content_of(data):
    """As the browser reads it: through strict JSON."""
    found: dict[str, Any] = json.loads(json.dumps(data.content, allow_nan=False))
    return found


def test_the_page_holds_the_numbers_of_the_file():
    dataset = build_file(failed=[3, 8], loops=[2, 5], responses=["tip", "root"])
    data = build_page_data(result_of(dataset), PLENTY)
    content = content_of(data)
    n_points = dataset["outcome"].size
    assert data.notes == ()
    assert content["cycles"] == dataset["cycle"].values.tolist()
    assert content["outcome"] == dataset["outcome"].values.ravel().tolist()
    assert content["endings"] == {str(number): sentence for number, sentence in enumerate(SENTENCES)}
    assert set(content["courses"]) == set(COURSES) & set(dataset.data_vars)
    for name, entry in content["courses"].items():
        expected = dataset[name].values.reshape(n_points, -1).astype("f4")
        np.testing.assert_array_equal(decode(entry, n_points, -1), expected)
    good = np.flatnonzero(dataset["outcome"].values.ravel() == 0)
    assert content["maps"]["points"] == content["loops"]["points"] == good.tolist()
    assert set(content["maps"]["variables"]) == set(MAPS)
    for name in MAPS:
        expected = dataset[name].values.reshape(n_points, 5, -1)[good].astype("f4")
        np.testing.assert_array_equal(decode(content["maps"]["variables"][name], *expected.shape), expected)
    assert content["loops"]["contacts"] == [2, 5]
    for name in LOOPS:
        expected = dataset[name].values.reshape(n_points, 5, 24, 16, 3)[good][:, :, [2, 5]].astype("f4")
        assert np.isfinite(expected).all()
        np.testing.assert_array_equal(decode(content["loops"]["variables"][name], *expected.shape), expected)


def test_the_root_is_there_with_a_quarter_of_the_room_at_most():
    dataset = dovetail_file(density=4)
    result = Result(Path("some.nc"), dataset)
    surface = read_root(result)
    data = build_page_data(result, PLENTY)
    root = content_of(data)["root"]
    np.testing.assert_array_equal(decode({"data": root["nodes"]}, -1, 3), surface.nodes.astype("f4"))
    np.testing.assert_array_equal(decode({"data": root["faces"]}, -1, 4), surface.faces)
    np.testing.assert_array_equal(decode({"data": root["contact"]["pairs"]}, -1, 1), surface.contact.pairs)
    assert [view["title"] for view in root["views"]] == [view.title for view in find_views(result, surface)]
    assert not any("faces" in note for note in data.notes)
    limit = 1e6
    data = build_page_data(result, limit)
    root = content_of(data)["root"]
    assert len(json.dumps(root)) < 0.35 * limit
    assert any(f"of its {len(surface.faces)} faces" in note for note in data.notes)
    assert content_of(data)["maps"] is not None


def test_cycles_of_pairs_are_thinned_out_first_then_points_lose_their_maps():
    dataset = build_file(cycles=np.linspace(0.0, 1e4, 101), failed=[2])
    n_points, n_good, n_pairs = dataset["outcome"].size, dataset["outcome"].size - 1, dataset.sizes["contact"]
    whole = build_page_data(result_of(dataset), PLENTY)
    size = len(json.dumps(whole.content))
    courses = sum(len(entry["data"]) for entry in content_of(whole)["courses"].values())

    thin = build_page_data(result_of(dataset), courses + 0.4 * (size - courses))
    content = content_of(thin)
    kept = content["maps"]["cycles"]
    assert len(content["cycles"]) == 101
    assert len(content["maps"]["points"]) == n_good
    assert kept[0] == 0
    assert kept[-1] == 100
    assert 11 <= len(kept) < 60
    (note,) = thin.notes
    assert note.startswith(f"Maps are on this page at {len(kept)} of the 101 cycle counts of the slider: ")
    good = np.array(content["maps"]["points"])
    expected = dataset["wear_depth"].values.reshape(n_points, 101, n_pairs)[good][:, kept].astype("f4")
    np.testing.assert_array_equal(decode(content["maps"]["variables"]["wear_depth"], *expected.shape), expected)

    few = build_page_data(result_of(dataset), 1e5)
    content = content_of(few)
    points = content["maps"]["points"]
    worn = np.nan_to_num(dataset["worn_volume"].values.reshape(n_points, -1)[:, -1])
    assert 0 < len(points) < n_good
    assert sorted(points) == sorted(np.argsort(-worn)[: len(points)].tolist())
    assert len(content["maps"]["cycles"]) == 11
    assert any(f"the {len(points)} most worn of {n_good} points" in note for note in few.notes)


def test_a_page_without_room_says_so():
    data = build_page_data(result_of(build_file()), 1e3)
    assert data.content is None
    assert "do not fit" in data.notes[0]


def test_reading_in_blocks_is_reading(tmp_path, monkeypatch):
    build_file(failed=[5], loops=[4]).to_netcdf(tmp_path / "some.nc")
    with xr.open_dataset(tmp_path / "some.nc") as dataset:
        whole = build_page_data(result_of(dataset), 2e5)
    for size in (1.0, 4e3, 2e4):
        monkeypatch.setattr(page_kept, "_BYTES_A_BLOCK", size)
        with xr.open_dataset(tmp_path / "some.nc") as dataset:
            assert build_page_data(result_of(dataset), 2e5) == whole


def test_flanks_are_grids():
    panels = build_panels(result_of(build_file()))
    assert [(panel["title"], panel["kind"]) for panel in panels] == [("intrados", "grid"), ("extrados", "grid")]
    positions = flank_positions()
    seen = []
    for panel in panels:
        pairs = np.array(panel["pairs"])
        assert pairs.shape == (3, 4)
        np.testing.assert_allclose(np.ptp(positions[pairs][..., 2], axis=0), 0.0, atol=1e-12)
        np.testing.assert_allclose(positions[pairs][0, :, 2] - positions[pairs][0, 0, 2], panel["x"])
        seen += pairs.ravel().tolist()
    assert sorted(seen) == list(range(24))


def test_many_surfaces_share_a_panel():
    n_pairs = MOST_PANELS + 1
    dataset = build_file(positions=np.full((n_pairs, 3), np.nan), surfaces=[f"s{i}" for i in range(n_pairs)])
    assert build_panels(result_of(dataset)) == [
        {"title": "all contact pairs", "kind": "bars", "pairs": list(range(n_pairs))}
    ]

"""Report, page, statistics and joined results of missions."""

import base64

import numpy as np
import pytest
import xarray as xr

from solver.outcome import Outcome
from studyrunner.accessor import join_results
from studyrunner.api import run_study
from studyrunner.report.cli import main
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import Drawing, plotted_values
from studyrunner.report.page import build_page_data
from studyrunner.result.view import open_for_report
from tests.studyrunner.faked_runs import FakedBlocks
from tests.studyrunner.small_studies import MISSIONS

pytestmark = pytest.mark.slow

ONE = {"axes.frequency": 160, "axes.sweep": "up", "axes.wear_coefficient": 1e-11}
SCATTER = {"samples": 8, "friction_coefficient": {"normal": {"std": 0.03}}, "normal_load": {"normal": {"std": 0.5}}}
STUDIES = {"one": ONE, "grid": {"axes.sweep": "up"}, "scatter": {**ONE, "scatter": SCATTER}, "failed": ONE}
BLOCKS = ["run-up", "cruise", "heavy"]


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """A folder with results of one point, of a grid, of samples, and of one whose second block fails."""
    folder = tmp_path_factory.mktemp("missions")
    (folder / "missions.toml").write_text(MISSIONS, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        blocks = FakedBlocks(patch)
        for name, overrides in STUDIES.items():
            if name == "failed":
                blocks.fails["cruise"] = Outcome.START_FAILED
            run_study(folder / "missions.toml", folder / f"{name}.nc", overrides=overrides, progress=False).close()
    return folder


def items(path):
    return {item.name: item for item in draw_report(open_for_report(path))}


def test_the_report_has_blocks_and_counts_missions(results):
    found = items(results / "grid.nc")
    drawn = {name for name, item in found.items() if isinstance(item, Drawing)}
    assert {"block_shares", "block_responses", "worn_volume", "worn_volume_map", "final_worn_volume", "trends"} <= drawn
    for item in found.values():
        text = item.caption if isinstance(item, Drawing) else item.title
        assert "cycle" not in text.replace("cycles of one mission", ""), text
    rows = [("run-up", "150 to 170", "3200"), ("cruise", "161", "1610"), ("heavy", "155", "1000")]
    assert [row[:3] for row in found["blocks"].rows] == rows


def test_a_passage_of_a_joint_without_damping_has_an_infinite_rate(results, tmp_path):
    with xr.open_dataset(results / "one.nc") as dataset:
        without = dataset.load().assign(sweep_rate=dataset.sweep_rate + [np.inf, 0.0, 0.0])
    without.to_netcdf(tmp_path / "without.nc")
    assert [row[-1] for row in items(tmp_path / "without.nc")["blocks"].rows] == ["inf", "-", "-"]


def test_figures_of_blocks_have_the_numbers_of_the_file(results):
    found = items(results / "one.nc")
    with xr.open_dataset(results / "one.nc") as dataset:
        one = dataset.squeeze().load()
    variables = ("block_share", "block_worn_volume"), ("response_amplitude_begin", "response_amplitude")
    for figure, names in zip(("block_shares", "block_responses"), variables, strict=True):
        assert {row[2] for row in plotted_values(found[figure].figure)} == {"missions"}
        for panel, name in zip(found[figure].figure.axes, names, strict=True):
            wrong = {"block_share": None, "block_worn_volume": "block_worn_volume_error"}.get(name, "response_error")
            factor = {"block_share": 100.0, "block_worn_volume": 1e9}.get(name, 1e6)
            for place, line in enumerate(panel.get_lines()):
                values = factor * one[name][:, place]
                assert line.get_label() == BLOCKS[place]
                np.testing.assert_allclose(line.get_data(), [one.mission, values])
                if wrong is not None:
                    error = one[wrong][:, place] * values
                    edges = panel.collections[place].get_paths()[0].vertices[:, 1]
                    ends = [(values - error)[error > 0.0].min(), (values + error)[error > 0.0].max()]
                    np.testing.assert_allclose([edges.min(), edges.max()], ends)


def test_the_page_holds_the_variables_of_the_blocks(results):
    result = open_for_report(results / "grid.nc")
    content = build_page_data(result, 4e6, [])
    entries = {entry["name"]: entry for entry in content["variables"]}
    for name in ("response_amplitude", "response_amplitude_begin", "response_error", "block_worn_volume"):
        values = np.frombuffer(base64.b64decode(entries[name]["data"]), dtype="<f4")
        np.testing.assert_array_equal(values, result.blocks[name].values.ravel().astype("f4"))
    dims = {entry["name"]: entry for entry in content["dims"]}
    assert dims["block"]["values"] == BLOCKS
    assert dims["cycle"]["label"] == "missions"


@pytest.mark.parametrize("name", ["scatter", "failed"])
def test_the_page_is_written(results, tmp_path, name, capsys):
    assert main([str(results / f"{name}.nc"), "-o", str(tmp_path / name)]) == 0, capsys.readouterr().err
    assert "cruise" in (tmp_path / name / "index.html").read_text(encoding="utf-8")


def test_samples_of_missions_have_statistics(results):
    with xr.open_dataset(results / "scatter.nc") as dataset:
        statistics = dataset.fretwear.worn_volume_statistics([0.5])
        assert statistics.worn_volume_quantile.dims[-3:] == ("mission", "quantile", "bound")
        median = statistics.worn_volume_quantile.sel(quantile=0.5).isel(mission=-1, bound=0).squeeze()
        # of 8 samples the fourth, without interpolation
        assert median == np.sort(dataset.worn_volume.isel(mission=-1).values.ravel())[3]
        assert dataset.fretwear.response().dims == dataset.response_amplitude.dims


def test_results_of_missions_are_joined(results):
    with xr.open_dataset(results / "grid.nc") as dataset:
        whole = dataset.load()
    joined = join_results([whole.isel(frequency=[place]) for place in (1, 0)])
    for name in ("worn_volume", "block_worn_volume", "excitation_frequency", "outcome"):
        xr.testing.assert_equal(joined[name].sel(frequency=whole.frequency), whole[name])
    assert joined.block.values.tolist() == BLOCKS

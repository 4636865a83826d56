"""Studies of missions: blocks under [[mission]], computed slow_time.missions times in place of cycles."""

import numpy as np
import pytest
import xarray as xr

from solver import Block, Outcome, Passage, integrate_mission
from studies import build_scene
from studyrunner.api import run_study
from studyrunner.kinds.estimate import iterations_of_missions
from studyrunner.kinds.kind import build_tasks
from studyrunner.mpi import schedule
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from tests.studyrunner.faked_blocks import STUDY, blocks, load_of
from tests.studyrunner.fakes import points_of

__all__ = ["blocks"]

STEADY = """
[study]
name = "gross_slip"
[scene]
model = "sdof_slider"
normal_stiffness = 0.0
[axes]
frequency = 160
[slow_time]
missions = 1
outputs = 2
[solver]
harmonics = 3
samples = 64
[[mission]]
name = "all"
excitation_amplitude = 14.0
cycles = 1e5
begin = "sweep"
"""


@pytest.fixture
def study_file(tmp_path):
    path = tmp_path / "missions.toml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def run(path, name="out.nc", **more):
    with run_study(path, path.with_name(name), progress=False, **more) as found:
        return found.load()


def without_time(dataset):
    return dataset.drop_vars("run_time").drop_attrs(deep=False)


@pytest.mark.slow
def test_the_result_has_missions_and_blocks_and_the_values_of_the_solver(study_file, blocks):
    result = run(study_file)
    axes = {"frequency": 2, "wear_coefficient": 2, "excitation_amplitude": 1, "sweep": 2}
    assert dict(result.sizes) == {**axes, "mission": 4, "block": 3, "contact": 1, "response": 1}
    assert result.worn_volume.dims == (*axes, "mission")
    assert result.response_amplitude.dims == (*axes, "mission", "block", "response")
    assert result.mission.values.tolist() == [0, 100, 200, 300]
    assert result.block.values.tolist() == ["run-up", "cruise", "heavy"]
    for name, variable in result.variables.items():
        assert {"units", "long_name"} <= variable.attrs.keys(), name
    # one scene of the slider for two blocks, another for the third
    models = [build_scene("sdof_slider", normal_load=load) for load in (10.0, 12.0)]
    at = result.sel(frequency=161.0, wear_coefficient=2e-11, sweep="down").squeeze("excitation_amplitude")
    direct = integrate_mission(
        [
            Block(models[0], Passage(150.0, 170.0, 1.0), 10.0, 0.5, begin="up", name="run-up"),
            Block(models[0], 161.0, 1.0, 0.5, 1610.0, "down", "cruise"),
            Block(models[1], 155.0, 14.0, 0.5, 1000.0, "ramp", "heavy"),
        ],
        2e-11,
        [0, 100, 200, 300],
        sweep="down",
    )
    for name, values in {
        "worn_volume": direct.worn_volume,
        "worn_volume_error": direct.worn_volume_error,
        "wear_depth": direct.wear_depth,
        "block_worn_volume": direct.block_volume,
        "block_worn_volume_error": direct.block_volume_error,
        "response_amplitude": np.abs(direct.response_end),
        "response_peak_begin": direct.response_peak_begin,
        "excitation_frequency": [170.0, 161.0, 155.0],
        "excitation_frequency_begin": [150.0, 161.0, 155.0],
        "block_cycles": [3200.0, 1610.0, 1000.0],
        "newton_iterations": direct.newton_iterations,
        "last_mission": 300.0,
        "outcome": 0,
    }.items():
        np.testing.assert_array_equal(at[name], values, err_msg=name)
    assert (result.outcome == Outcome.CONVERGED).all()
    np.testing.assert_allclose(at.block_share.sum("block"), 1.0)
    # a rate is that of one mission: the volumes of all missions add up
    every = run(study_file, "every.nc", overrides={"slow_time.outputs": 301, "axes.frequency": 161.0})
    one = every.sel(wear_coefficient=2e-11, sweep="down").squeeze()
    np.testing.assert_allclose(np.cumsum(one.wear_rate[1:]), one.worn_volume[1:], rtol=1e-9)
    assert one.wear_rate[0] == one.wear_rate[1] > 0.0
    blocks = dict(result.fretwear.summary().wear.blocks)
    assert list(blocks) == result.block.values.tolist()
    assert sum(blocks.values()) == pytest.approx(1.0)


@pytest.mark.slow
def test_a_study_without_missions_is_one_block(tmp_path):
    path = tmp_path / "one.toml"
    path.write_text(STEADY, encoding="utf-8")
    found = run(path).squeeze()
    text = STEADY.partition("[[mission]]")[0].replace("missions = 1", "cycles = 1e5")
    path.write_text(text.replace("frequency = 160", "frequency = 160\nexcitation_amplitude = 14.0"), encoding="utf-8")
    whole = run(path, "whole.nc").squeeze()
    bars = found.wear_depth_error.values + whole.wear_depth_error.values
    assert (abs(found.wear_depth.values - whole.wear_depth.values) <= bars).all()
    assert found.error_estimate < 0.02
    np.testing.assert_allclose(found.response_amplitude.values[1], whole.response_amplitude.values[-1], rtol=0.02)
    np.testing.assert_array_equal(found.response_amplitude_begin[0], whole.response_amplitude[0])


@pytest.mark.slow
def test_an_interrupted_study_goes_on_to_the_last_bit(study_file, blocks, monkeypatch):
    monkeypatch.setattr(schedule, "SECONDS_TO_PROGRESS", 0.0)
    few = {"axes.frequency": 160, "axes.sweep": "up", "axes.wear_coefficient": 1e-11}
    whole = run(study_file, "whole.nc", overrides=few)
    n_whole = len(blocks.computed)

    def interrupt(number):
        if number == n_whole // 2:
            raise KeyboardInterrupt

    blocks.computed.clear()
    blocks.disturb = interrupt
    with pytest.raises(KeyboardInterrupt):
        run(study_file, overrides=few)
    blocks.disturb = lambda _: None
    found = run(study_file, overrides=few)
    # the step of the interruption is computed again
    assert n_whole <= len(blocks.computed) < 1.3 * n_whole
    xr.testing.assert_identical(without_time(found), without_time(whole))


@pytest.mark.slow
def test_a_block_that_fails_spoils_its_point_only(study_file, blocks):
    blocks.fails["cruise"] = Outcome.START_FAILED
    result = run(study_file, overrides={"axes.frequency": 160, "axes.sweep": "up", "slow_time.until.worn_volume": 1e-9})
    assert (result.outcome == Outcome.START_FAILED).all()
    assert np.isnan(result.worn_volume[..., 1:]).all()
    assert np.isnan(result.last_mission).all()


@pytest.mark.slow
def test_a_target_ends_the_missions(study_file, blocks):
    one = {"axes.frequency": 160, "axes.sweep": "up"}
    whole = run(study_file, overrides=one).squeeze()
    goal = 0.4 * whole.worn_volume[0, -1].item()
    whole_result = run(study_file, "life.nc", overrides={**one, "slow_time.until": {"worn_volume": goal}})
    result = whole_result.squeeze()
    assert (result.outcome == Outcome.CONVERGED).all()
    slow, fast = result.missions_to_target.values.tolist()
    assert 100.0 < slow < 200.0
    assert fast == pytest.approx(0.5 * slow, rel=0.05)
    assert (result.missions_to_target_error > 0.0).all()
    assert "later ones are not computed" in result.message[0].item()
    assert whole_result.fretwear.summary().life.count.value == fast


@pytest.mark.slow
def test_the_effective_study_is_the_same_study(study_file, blocks):
    study = read_study(study_file, ["mission.cruise.seconds=20", "mission.2.cycles=500"])
    assert [block.cycles_at(100.0) for block in study.mission] == [3200.0, 2000.0, 500.0]
    text = format_study(study)
    for name in ("scheme", "step", "final_share", "\ncycles = 1e", "excitation_amplitude = ["):
        assert (name in text) == (name == "excitation_amplitude = [")
    again = study_file.with_name("again.toml")
    again.write_text(text, encoding="utf-8")
    assert read_study(again).dimensions == study.dimensions
    assert format_study(read_study(again)) == text
    # a result is a study, too
    few = {"axes.frequency": 160, "axes.sweep": "up"}
    first = run(study_file, overrides=few)
    xr.testing.assert_identical(without_time(run(study_file.with_name("out.nc"), "again.nc")), without_time(first))


def test_scenes_of_blocks_are_built_once_and_points_are_tasks(study_file):
    study = read_study(study_file, {"axes.damping": [0.0, 1.0], "axes.wear_coefficient": 1e-11})
    scenes = find_scenes(study)
    assert len(scenes.studies) == 4
    assert scenes.of_blocks == ((0, 0, 1), (2, 2, 3))
    plan = build_tasks(study, 2)
    assert [task.scenes for task in plan.results[:: len(plan.results) // 2]] == [(0, 1), (2, 3)]
    assert plan.n_points == len({point for task in plan.results for point in points_of(task)}) == 8
    begins = [[block.begin for block in task.blocks] for task in plan.results[:2]]
    assert begins == [["up", "up", "ramp"], ["up", "down", "ramp"]]


def test_an_engine_order_is_a_frequency_by_the_speed_of_the_block(tmp_path):
    path = tmp_path / "engine.toml"
    path.write_text(
        """
[study]
name = "engine"
[scene]
model = "dovetail_sector"
mesh = 1
[slow_time]
missions = 10
[axes]
rotation_speed = [3000, 3100]
excitation_amplitude = 0.5
[[mission]]
name = "own speed"
rotation_speed = 2700
engine_order = 4
cycles = 100
[[mission]]
name = "speed of the axis"
engine_order = 4
seconds = 10
""",
        encoding="utf-8",
    )
    study = read_study(path)
    assert tuple(study.dimensions) == ("wear_coefficient", "excitation_amplitude", "sweep", "rotation_speed")
    tasks = build_tasks(study, 10).results
    assert [[block.frequency for block in task.blocks] for task in tasks] == [[180.0, 200.0], [180.0, 4 * 3100 / 60]]
    assert [task.blocks[1].cycles for task in tasks] == [2000.0, 10 * 4 * 3100 / 60]
    assert find_scenes(study).of_blocks == ((0, 1), (0, 2))


def test_blocks_have_the_same_pairs(study_file):
    with pytest.raises(UserError, match=r"mission.heavy: .* contact pairs of run-up"):
        run(study_file, overrides={"mission.heavy.area": 2e-4})


@pytest.mark.slow
def test_samples_draw_what_all_blocks_have(study_file, blocks):
    scatter = {"samples": 3, "friction_coefficient": {"normal": {"std": 0.03}}, "normal_load": {"normal": {"std": 0.5}}}
    one = {"axes.frequency": 160, "axes.sweep": "up", "axes.wear_coefficient": 1e-11}
    result = run(study_file, overrides={**one, "scatter": scatter})
    assert result.worn_volume.dims[-2:] == ("sample", "mission")
    for sample in range(3):
        load = result.sample_normal_load.values[sample]
        friction = result.sample_friction_coefficient.values[sample]
        of_sample = [case for case in blocks.computed if case.mission.blocks[0].friction_coefficient == friction]
        loads = {case.block.name: load_of(case.block) for case in of_sample}
        # around the value of the scene, and around that of the block
        assert loads["cruise"] == load
        assert loads["heavy"] == pytest.approx(12.0 + load - 10.0)
    assert len(set(result.worn_volume.isel(mission=-1).values.ravel())) == 3


@pytest.mark.slow
def test_a_result_at_mission_0_alone_has_no_error(study_file, blocks):
    few = {"axes.frequency": 160, "axes.sweep": "up", "axes.wear_coefficient": 1e-11, "slow_time.outputs": [0]}
    result = run(study_file, overrides=few).squeeze()
    assert result.worn_volume.item() == result.error_estimate.item() == 0.0
    assert result.last_mission.item() == 0.0


def test_the_estimated_time_follows_the_number_of_missions():
    times = [iterations_of_missions([("ramp", 0.0)], number, one_pair=False) for number in (1, 3, 20, 1e6)]
    assert times[1] == pytest.approx(6 * 110)
    assert times[2] < 4 * times[1]
    assert times[3] < 5 * times[2]
    # a ramp of one pair is seldom computed again
    assert iterations_of_missions([("ramp", 0.0)], 20, one_pair=True) < 0.7 * times[2]
    narrow, wide = (iterations_of_missions([("up", octaves)], 20, one_pair=True) for octaves in (0.1, 13.3))
    assert wide == pytest.approx(6 * narrow, rel=0.2)

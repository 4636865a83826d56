"""Studies of missions, with blocks under [[mission]], and of nonlinear modes, with axes.modal_amplitude."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from solver import Block, Outcome, Passage, backbone, integrate_mission
from studies import build_scene
from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.mpi import schedule
from studyrunner.report.contents import draw_report
from studyrunner.report.page import write_page
from studyrunner.result.opening import open_result
from studyrunner.result.view import open_for_report
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import read_study
from studyrunner.summary.answer import summary
from tests.mpi.launching import options, results
from tests.studyrunner.faked_runs import FakedBlocks, load_of
from tests.studyrunner.fakes import plan_of, points_of
from tests.studyrunner.small_studies import MISSIONS, compute

LINE = ("axes.frequency=160", "axes.sweep=up")
ONE = (*LINE, "axes.wear_coefficient=1e-11")


@pytest.fixture(autouse=True)
def studies(folder):
    Path("missions.toml").write_text(MISSIONS, encoding="utf-8")


@pytest.fixture
def blocks(monkeypatch):
    """Stands for the blocks in all runs of a test."""
    return FakedBlocks(monkeypatch)


def run(*overrides, output="out.nc"):
    return compute("missions.toml", output, *overrides)


def test_blocks_have_friction_tables_of_their_own():
    """Constant ones are equal to the bit to numbers of the blocks."""

    def worn(cold, hot):
        blocks = "".join(
            f'[[mission]]\nname = "{name}"\nfrequency = 160.0\nexcitation_amplitude = 10.0\ncycles = 1000\n{own}\n'
            for name, own in (("cold", cold), ("hot", hot))
        )
        head = MISSIONS.split("[[mission]]")[0].replace("frequency = [160, 161]\n", "")
        Path("own.toml").write_text(head + blocks, encoding="utf-8")
        rest = "slow_time.missions=3", "slow_time.outputs=2", "axes.wear_coefficient=1e-11", "axes.sweep=up"
        return compute("own.toml", "own.nc", *rest).worn_volume.values.ravel()

    table = "evolution = {{energy = [0, 1e5], friction_coefficient = [{}, {}]}}".format
    plain = worn("friction_coefficient = 0.3", "friction_coefficient = 0.5")
    assert worn(table(0.3, 0.3), table(0.5, 0.5)).tolist() == plain.tolist()
    assert worn(table(0.3, 0.4), table(0.5, 0.5))[-1] != pytest.approx(plain[-1], rel=1e-3)


@pytest.mark.slow
def test_the_result_has_missions_and_blocks_and_the_values_of_the_solver(blocks):
    result = run()
    axes = {"frequency": 2, "wear_coefficient": 2, "excitation_amplitude": 1, "sweep": 2}
    assert dict(result.sizes) == {**axes, "mission": 4, "block": 3, "contact": 1, "response": 1}
    assert result.response_amplitude.dims == (*axes, "mission", "block", "response")
    assert result.mission.values.tolist() == [0, 100, 200, 300]
    assert result.block.values.tolist() == ["run-up", "cruise", "heavy"]
    for name, variable in result.variables.items():
        assert {"units", "long_name"} <= variable.attrs.keys(), name
    # one scene of the slider for two blocks, another for the third
    light, heavy = (build_scene("sdof_slider", normal_load=load) for load in (10.0, 12.0))
    blocks_of = [
        Block(light, Passage(150.0, 170.0, 1.0), 10.0, 0.5, begin="up", name="run-up"),
        Block(light, 161.0, 1.0, 0.5, 1610.0, "down", "cruise"),
        Block(heavy, 155.0, 14.0, 0.5, 1000.0, "ramp", "heavy"),
    ]
    direct = integrate_mission(blocks_of, 2e-11, [0, 100, 200, 300], sweep="down")
    at = result.sel(frequency=161.0, wear_coefficient=2e-11, sweep="down").squeeze("excitation_amplitude")
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
    shares = summary(result).values["blocks"]
    assert list(shares) == result.block.values.tolist()
    assert sum(shares.values()) == pytest.approx(1.0)
    np.testing.assert_allclose(at.block_share.sum("block"), 1.0)
    # a rate is that of one mission: the volumes of all missions add up
    every = run("slow_time.outputs=301", "axes.frequency=161.0").sel(wear_coefficient=2e-11, sweep="down").squeeze()
    np.testing.assert_allclose(np.cumsum(every.wear_rate[1:]), every.worn_volume[1:], rtol=1e-9)
    assert every.wear_rate[0] == every.wear_rate[1] > 0.0


@pytest.mark.slow
def test_an_interrupted_study_goes_on_to_the_last_bit(blocks, monkeypatch):
    monkeypatch.setattr(schedule, "SECONDS_TO_PROGRESS", 0.0)
    whole = run(*ONE, output="whole.nc")
    n_whole = len(blocks.computed)

    def interrupt(number):
        if number == n_whole // 2:
            raise KeyboardInterrupt

    blocks.computed.clear()
    blocks.disturb = interrupt
    assert main(["missions.toml", "-o", "out.nc", *options(*ONE)]) == 130
    blocks.disturb = lambda _: None
    found = run(*ONE)
    # the step of the interruption is computed again
    assert n_whole <= len(blocks.computed) < 1.3 * n_whole
    xr.testing.assert_identical(found, whole)


@pytest.mark.slow
def test_a_block_that_fails_spoils_its_point_only(blocks):
    blocks.fails["cruise"] = Outcome.START_FAILED
    assert main(["missions.toml", "-o", "out.nc", *options(*LINE, "slow_time.until.worn_volume=1e-9")]) == 3
    assert (results().outcome == Outcome.START_FAILED).all()
    assert np.isnan(results().worn_volume[..., 1:]).all()
    assert np.isnan(results().last_mission).all()


@pytest.mark.slow
def test_a_target_ends_the_missions(blocks):
    goal = 0.4 * run(*LINE).worn_volume.squeeze()[0, -1].item()
    result = run(*LINE, f"slow_time.until={{worn_volume={goal!r}}}")
    assert (result.outcome == Outcome.CONVERGED).all()
    slow, fast = result.missions_to_target.values.ravel().tolist()
    assert 100.0 < slow < 200.0
    assert fast == pytest.approx(0.5 * slow, rel=0.05)
    assert (result.missions_to_target_error > 0.0).all()
    assert all("later missions are not computed" in message for message in result.message.values.ravel())
    assert summary(result).values["life"]["count"] == fast
    # no number is stored of what has worn then
    early = run(*LINE, f"slow_time.until={{worn_volume={1e-3 * goal!r}}}")
    assert (early.missions_to_target < early.mission[1]).all()
    assert np.isnan(early.error_estimate).all()
    assert "nothing wore" not in str(summary(early))


@pytest.mark.slow
def test_a_result_is_a_study_and_at_mission_0_alone_has_no_error(blocks):
    study = read_study("missions.toml", ["mission.cruise.seconds=20", "mission.2.cycles=500"])
    assert [block.cycles_at(100.0) for block in study.mission] == [3200.0, 2000.0, 500.0]
    first = run(*ONE, "slow_time.outputs=[0]")
    xr.testing.assert_identical(compute("out.nc", "again.nc").drop_attrs(), first.drop_attrs())
    assert first.worn_volume.item() == first.error_estimate.item() == first.last_mission.item() == 0.0


def test_scenes_of_blocks_are_built_once_and_points_are_tasks(capsys):
    study = read_study("missions.toml", ["axes.damping=[0.0, 1.0]", "axes.wear_coefficient=1e-11"])
    scenes = find_scenes(study)
    assert len(scenes.studies) == 4
    assert scenes.of_blocks == ((0, 0, 1), (2, 2, 3))
    plan = plan_of(study, 2)
    assert [task.scenes for task in plan.results[:: len(plan.results) // 2]] == [(0, 1), (2, 3)]
    assert plan.n_points == len({point for task in plan.results for point in points_of(task)}) == 8
    begins = [[block.begin for block in task.blocks] for task in plan.results[:2]]
    assert begins == [["up", "up", "ramp"], ["up", "down", "ramp"]]
    # all blocks have the same pairs
    for more in ([], ["--plan"]):
        assert main(["missions.toml", *options("mission.heavy.area=2e-4"), *more]) == 2
        assert "missions.toml: mission.heavy: " in capsys.readouterr().err


def test_an_engine_order_is_a_frequency_by_the_speed_of_the_block():
    blocks = "{name = 'own speed', rotation_speed = 2700, engine_order = 4, cycles = 100}, "
    blocks += "{name = 'speed of the axis', engine_order = 4, seconds = 10}"
    axes = ("axes.rotation_speed=[3000, 3100]", "axes.excitation_amplitude=0.5")
    study = read_study("mission", [*axes, f"mission=[{blocks}]"])
    assert tuple(study.dimensions) == ("wear_coefficient", "excitation_amplitude", "sweep", "rotation_speed")
    tasks = plan_of(study, 10).results
    assert [[block.frequency for block in task.blocks] for task in tasks] == [[180.0, 200.0], [180.0, 4 * 3100 / 60]]
    assert [task.blocks[1].cycles for task in tasks] == [2000.0, 10 * 4 * 3100 / 60]
    assert find_scenes(study).of_blocks == ((0, 1), (0, 2))


@pytest.mark.slow
def test_samples_of_missions_say_how_long_they_last_and_why(blocks):
    scatter = "{samples=16, friction_coefficient={normal={std=0.03}}, wear_coefficient={lognormal={factor=2.0}}}"
    whole = run(*ONE, f"scatter={scatter}")
    depth = float(whole.wear_depth_max.isel(mission=-1).max())
    end, least = f"slow_time.until={{wear_depth={0.3 * depth!r}}}", "scatter.limits={missions_to_target=150}"
    result = run(*ONE, f"scatter={scatter}", end, least, output="lives.nc")
    lives = result.missions_to_target.values.ravel()
    n_old = int((~(lives < 150.0)).sum())
    assert 0 < n_old < 16
    found = summary(result)
    assert found.values["limits"]["missions_to_target"]["probability"] == pytest.approx([n_old / 16.0] * 2)
    assert "samples last" in found.lines[0]
    assert found.values["input"] == {}
    assert "of the life, wear coefficient decides most" in " ".join(str(found).split())
    # a limit that was not asked for
    largest = float(result.response_amplitude.max())
    counted = result.fretwear.worn_volume_statistics(limits={"response_amplitude": 1.01 * largest})
    assert (counted.response_amplitude_within_limit.isel(mission=0) == 1.0).all()
    assert "missions_to_target_quantile" in counted


@pytest.mark.slow
def test_samples_draw_what_all_blocks_have(blocks):
    scatter = "{samples=3, friction_coefficient={normal={std=0.03}}, normal_load={normal={std=0.5}}}"
    result = run(*ONE, f"scatter={scatter}")
    assert result.worn_volume.dims[-2:] == ("sample", "mission")
    for sample in range(3):
        load, friction = (result[f"sample_{name}"].values[sample] for name in ("normal_load", "friction_coefficient"))
        of_sample = [case for case in blocks.computed if case.mission.blocks[0].model.contact.friction == friction]
        loads = {case.block.name: load_of(case.block) for case in of_sample}
        # around the value of the scene, and around that of the block
        assert loads["cruise"] == load
        assert loads["heavy"] == pytest.approx(12.0 + load - 10.0)
    assert len(set(result.worn_volume.isel(mission=-1).values.ravel())) == 3


# --- nonlinear modes ---

# a mass on a rigid slider has its mode while it slides: above 1e-5 m sqrt(kg)
MODES = """
study = {name = "slider_modes"}
scene = {model = "sdof_slider", worn = {depth = [[1e-6], [0.0]], cycle = [1e4, 0]}}
axes = {modal_amplitude = [1e-3, 1e-6, 1e-4], mode = [1, 3], sweep = "down"}
scatter = {samples = 2, friction_coefficient = {normal = {std = 0.03}}}
"""


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A result; its study stands beside it."""
    path = tmp_path_factory.mktemp("modes") / "out.nc"
    path.with_suffix(".toml").write_text(MODES, encoding="utf-8")
    run_study(path.with_suffix(".toml"), path, progress=False).close()
    return path


@pytest.fixture
def study(path):
    return str(path.with_suffix(".toml"))


@pytest.fixture
def result(path):
    return results(path)


@pytest.mark.slow
def test_the_result_has_its_axes_and_the_values_of_the_solver(result):
    """Amplitudes and worn joints in the order of the study file, each the same as in Python."""
    sizes = dict(zip(result.natural_frequency.dims, result.natural_frequency.shape, strict=True))
    expected = {"mode": 2, "sweep": 1, "sample": 2, "modal_amplitude": 3, "cycle": 2}
    assert list(sizes.items()) == list(expected.items())
    np.testing.assert_array_equal(result.cycle, [1e4, 0.0])
    for variable in result.variables.values():
        assert {"units", "long_name"} <= variable.attrs.keys()
    model = build_scene("sdof_slider")
    for sample, cycle, depth in ((0, 1, 0.0), (1, 0, 1e-6)):
        friction = result.sample_friction_coefficient.values[sample]
        direct = backbone(model, result.modal_amplitude, friction, sweep="down", wear_depth=depth)
        at = result.isel(mode=0, sweep=0, sample=sample, cycle=cycle)
        for name, values in {
            "natural_frequency": direct.frequency,
            "natural_frequency_error": direct.frequency_error,
            "damping_ratio": direct.damping_ratio,
            "damping_ratio_error": direct.damping_error,
            "response_amplitude": np.abs(direct.response),
            "slip_fraction": direct.slip_fraction,
            "open_fraction": direct.open_fraction,
            "harmonics_used": direct.harmonics_used,
            "outcome": direct.outcome,
        }.items():
            np.testing.assert_array_equal(at[name], values, err_msg=name)
    assert (result.harmonics_used.sel(mode=1, modal_amplitude=[1e-4, 1e-3]) > 0).all()


@pytest.mark.slow
def test_a_mode_that_is_not_there_says_so_and_the_others_over_the_wear(result, path):
    said = result.message.isel(sweep=0, sample=0).sel(cycle=0)
    assert "followed down to the amplitude" in said.sel(mode=1, modal_amplitude=1e-6).item()
    assert "fewer linear modes" in said.sel(mode=3)[0].item()
    found = result.natural_frequency.sel(mode=1, modal_amplitude=[1e-4, 1e-3])
    modes = summary(result).values
    assert modes["mode 1"]["natural_frequency"] == [found.min(), found.max()]
    assert modes["mode 3"] == {"n_found": 0}
    # in the order of the file, at the last amplitude where all was found
    few = open_result(path).sel(mode=[1], modal_amplitude=[1e-3, 1e-4])
    row = " ".join(str(few.fretwear.summary()).split())
    expected = few.natural_frequency.isel(sweep=0, sample=1).sel(mode=1, modal_amplitude=1e-4).values
    assert f"; after 10 000, 0 cycles {expected[0]:.6g}, {expected[1]:.6g} Hz and " in row


@pytest.mark.slow
def test_points_are_the_same_in_another_list(study, result):
    """And a study with more amplitudes goes on from the points that are there."""
    one = ("scatter.samples=1", "axes.mode=1", "scene.worn={depth=0.0, cycle=0}")
    first = compute(study, "out.nc", *one, "axes.modal_amplitude=[1e-4]", "outputs.variables=['slip_fraction']")
    assert "natural_frequency" not in first
    assert summary(first).values["mode 1"]["n_found"] == 1
    more = options(*one, "axes.modal_amplitude={start=1e-5, stop=1e-3, num=3, spacing='log'}")
    # the smallest amplitude has no mode
    assert main([study, "-o", "out.nc", *more]) == 3
    found = results()
    np.testing.assert_array_equal(found.modal_amplitude, [1e-5, 1e-4, 1e-3])
    for amplitude in (1e-4, 1e-3):
        where = {"modal_amplitude": [amplitude], "cycle": [0.0], "mode": [1], "sample": [0]}
        one, other = (each.sel(where).drop_attrs(deep=False) for each in (found, result))
        xr.testing.assert_identical(one, other)


@pytest.mark.slow
def test_the_report_draws_frequency_and_damping(result, path, folder):
    shown = open_for_report(path)
    items = {item.name: item for item in draw_report(shown)}
    assert "natural_frequency" in items
    assert ", 0 left out, " in write_page(shown, items.values(), folder / "index.html")
    drawn = {line.get_label(): line.get_ydata() for line in items["damping_ratio"].figure.axes[0].get_lines()}
    for label, cycle in (("mode 1, cycle 10\N{NO-BREAK SPACE}000", 1e4), ("mode 1, cycle 0", 0)):
        expected = result.damping_ratio.sel(mode=1, cycle=cycle).isel(sweep=0, sample=0).values[[1, 2, 0]]
        np.testing.assert_allclose(drawn[label], expected)
    # and over the cycles of wear
    over = {line.get_label(): line.get_xydata() for line in items["damping_ratio_cycle"].figure.axes[0].get_lines()}
    expected = result.damping_ratio.sel(mode=1, modal_amplitude=1e-3, cycle=[0, 1e4]).isel(sweep=0, sample=0)
    label = "mode 1, modal amplitude 0.001 m kg^0.5"
    np.testing.assert_allclose(over[label], np.column_stack([[0.0, 1e4], expected]))
    shown.dataset.close()

"""Points that are rows of a table: the same points as in a rectangular study, from any program, and what is wrong."""

import csv
import itertools
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.stats import qmc

from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.kinds.table import KINDS
from studyrunner.kinds.task import Identity
from studyrunner.plan_table import print_table
from studyrunner.report.cli import main as report
from studyrunner.result.view import open_for_report
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from studyrunner.worn_joint import compute_worn_joint
from tests.mpi.launching import options
from tests.studyrunner.fakes import plan_of
from tests.studyrunner.small_studies import CHEAP, MISSIONS, MODES, SAMPLES, SLIDER, same_values

AXES = {"frequency": [150.0, 160.0], "friction_coefficient": [0.4, 0.5], "damping": [1.0, 0.0]}
GRID = [dict(zip(AXES, values, strict=True)) for values in itertools.product(*AXES.values())]
"""A rectangular study, and all of its points as a design."""

SCATTER = {"samples": 2, "friction_coefficient": {"normal": {"std": 0.03}}, "frequency": {"normal": {"std": 1.0}}}

DESIGN = "frequency [Hz],damping,scheme\n150,0,adaptive\n160,2,implicit\n155,1,adaptive\n"


def names_of(study) -> list[str]:
    """The names of the results of all points, with scenes that are known by their parameters."""
    scenes = tuple(str(each.scene.of_model) for each in find_scenes(study).studies)
    plan = plan_of(study).named(Identity(scenes, "record"))
    found = [(task.points(place), name) for task in plan.results for place, name in enumerate(task.names)]
    return [name for _, name in sorted((number, name) for numbers, name in found for number in numbers)]


@pytest.mark.parametrize(
    ("source", "axes", "overrides"),
    [
        ("sdof_slider", AXES, {}),
        ("sdof_slider", {"frequency": [150, 160], "harmonics": [3, 5], "step": [1, 9]}, {"axes.sweep": ["up", "ramp"]}),
        ("sdof_slider", {"excitation_amplitude": [9, 10], "normal_load": [9, 10]}, {"axes.damping": [0.0, 1.0]}),
        ("dovetail", {"mesh": [1, 2], "stress_stiffening": [True, False], "scheme": ["adaptive", "explicit"]}, {}),
        ("missions.toml", {"wear_coefficient": [1e-11, 2e-11], "frequency": [160, 161], "damping": [0, 1]}, {}),
        ("modes.toml", {"friction_coefficient": [0.4, 0.5], "sweep": ["up", "down"], "normal_load": [9, 10]}, {}),
        ("sdof_slider", {"frequency": [150, 160], "damping": [0, 1]}, {"scatter": SCATTER}),
    ],
)  # fmt: skip
def test_a_row_is_the_point_of_a_rectangular_study(source, axes, overrides, folder):
    """Each point has the task that it has there, whatever the order of the rows."""
    Path("missions.toml").write_text(MISSIONS)
    Path("modes.toml").write_text(MODES)
    rows = list(itertools.product(*axes.values()))
    order = np.random.default_rng(1).permutation(len(rows))
    whole = read_study(source, {**overrides, **{f"axes.{name}": values for name, values in axes.items()}})
    design = read_study(source, overrides, pd.DataFrame([rows[place] for place in order], columns=list(axes)))
    assert next(iter(design.dimensions.items())) == ("point", range(len(rows)))
    assert set(design.dimensions) - {"point"} == set(whole.dimensions) - set(axes)
    names, sizes = list(whole.dimensions), [len(values) for values in whole.dimensions.values()]
    of_whole = np.array(names_of(whole)).reshape(sizes)
    of_whole = np.moveaxis(of_whole, [names.index(name) for name in axes], range(len(axes))).reshape(len(rows), -1)
    assert names_of(design) == of_whole[order].ravel().tolist()


@pytest.mark.slow
def test_values_are_those_of_a_rectangular_study_to_the_last_bit(folder):
    axes = {f"axes.{name}": values for name, values in AXES.items()}
    own = {key: value for key, value in (text.split("=", 1) for text in CHEAP) if key != "axes.frequency"}
    own = {key: float(value) if value[0].isdigit() else value for key, value in own.items()}
    own |= {"outputs.variables": ["default", "exact"], "axes.scheme": ["implicit", "adaptive"]}
    whole = run_study("sdof_slider", "whole.nc", overrides={**own, **axes}, progress=False).load()
    rows = GRID[::-1]
    design = run_study("sdof_slider", "rows.nc", overrides=own, points=pd.DataFrame(rows), progress=False).load()
    assert design.worn_volume.dims[:2] == ("point", "wear_coefficient")
    assert {name: design[name].dims for name in AXES} == dict.fromkeys(AXES, ("point",))
    for place, row in enumerate(rows):
        alone, same = design.isel(point=place, drop=True), whole.sel(row)
        for name in set(whole.data_vars) - {"run_time"}:
            np.testing.assert_array_equal(alone[name].squeeze(), same[name].squeeze(), err_msg=name)


def test_designs_of_other_programs_are_taken_as_they_are(folder):
    """A matrix and names, as of SALib, pyDOE and scipy.qmc; columns by name; a table of pandas; a file."""
    names, matrix = ["frequency", "normal_load"], qmc.scale(qmc.Sobol(2, rng=1).random(4), [150, 8], [170, 12])
    table = pd.DataFrame(matrix, columns=names)
    table.to_csv("design.csv", index=False)
    designs = [(matrix, names), dict(zip(names, matrix.T, strict=True)), table, "design.csv", Path("design.csv")]
    np.savetxt("plain.csv", matrix, fmt="%.17g", delimiter=",", header=",".join(names))
    table.to_csv("semicolons.csv", index=False, sep=";")
    studies = [read_study("sdof_slider", (), each) for each in (*designs, "plain.csv", "semicolons.csv")]
    assert all(each.axes.frequency == tuple(matrix[:, 0].tolist()) for each in studies)
    assert all(names_of(each) == names_of(studies[0]) for each in studies)
    # whole numbers of a matrix are those of a key that takes no others
    assert read_study("dovetail", (), (np.array([[2.0], [1.0]]), ["mesh"])).dimensions["point"] == range(2)


def test_a_result_of_a_design_is_its_study(folder, solver):
    Path("design.csv").write_text(DESIGN)
    given = options("axes.wear_coefficient=[1e-11, 2e-11]", "axes.harmonics=[3, 5]")
    assert main(["sdof_slider", *given, "--points", "design.csv", "-o", "out.nc"]) == 0
    assert main(["out.nc", "-o", "again.nc"]) == 0
    with xr.open_dataset("out.nc") as first, xr.open_dataset("again.nc") as again:
        xr.testing.assert_identical(first.drop_vars("run_time"), again.drop_vars("run_time"))
        others = [name for name in KINDS["wear"].axes if name not in ("frequency", "scheme")]
        assert first.outcome.dims == ("point", *others, "harmonics")
        assert first.damping.attrs["units"] == "N s/m"
        assert first.scheme.values.tolist() == ["adaptive", "implicit", "adaptive"]
    study = read_study("out.nc")
    assert format_study(study) == format_study(read_study("again.nc"))
    # another design, and none
    assert read_study("out.nc", (), {"damping": [1.0], "frequency": [100.0]}).n_points == 4
    assert read_study("out.nc", {"points": None, "axes.frequency": 100.0}).design is None


def test_flags_and_words_of_a_design_come_back_from_its_result(folder, solver):
    rows = {"stress_stiffening": [True, False], "harmonics": ["auto", 5], "mesh": [1, 1]}
    own = {"axes.scheme": "adaptive", "axes.frequency": 200.0, "axes.wear_coefficient": 1e-11}
    run_study("dovetail", "out.nc", overrides=own, points=rows, progress=False).close()
    assert {name: column.values for name, column in read_study("out.nc").design.columns.items()} == {
        "stress_stiffening": (True, False), "harmonics": ("auto", 5), "mesh": (1,),
    }  # fmt: skip


def test_more_points_are_computed_alone(folder, solver):
    """A loop from outside: the file of the run keeps what is known."""
    points = {"frequency": [100.0, 110.0], "damping": [0.0, 1.0]}
    own = {"axes.scheme": "implicit"}
    first = run_study("sdof_slider", "out.nc", overrides=own, points=points, progress=False).load()
    n_results = solver.n_results
    points = {"frequency": [100.0, 105.0, 110.0], "damping": [0.0, 0.5, 1.0]}
    whole = run_study("sdof_slider", "out.nc", overrides=own, points=points, progress=False).load()
    assert solver.n_results - n_results == 2, "one start state and one history"
    same = whole.isel(point=[0, 2]).assign_coords(point=first.point)
    same_values(same.drop_vars(["run_time"]), first.drop_vars(["run_time"]))


@pytest.mark.parametrize(
    ("content", "key", "remedy"),
    [
        ("frequncy\n150\n", "column frequncy", "frequency"),
        ("frequency\n150\nabc\n", "row 3, column frequency", "Hz"),
        ("damping\nabc\n", "row 2, column damping", "number"),
        ("frequency,damping\n150,0\n151,-3\n", "row 3, column damping", "0 or more"),
        ("frequency\n150\n-3\n", "row 3, column frequency", "above 0"),
        ("frequency\nnan\n", "row 2, column frequency", "finite"),
        ("frequency,damping\n150,\n", "row 2, column damping", "missing"),
        ("frequency,damping\n150\n", "row 2", "2 values"),
        ("frequency,frequency\n1,2\n", "column frequency", "of its own"),
        ("frequency,damping\n1,2\n2,2\n1,2.0\n", "row 4, column frequency", "row 2"),
        ("frequency [kHz]\n150\n", "column frequency", "Hz"),
        ("damping [N]\n1\n", "column damping", "N s/m"),
        ("frequency,frequency_ratio\n1,2\n", "column frequency", "of frequency"),
        ("model\na\n", "column model", "in the study"),
        ("mode\n1\n", "column mode", "in the study"),
        ("frequency\n", "points", "row"),
        ("", "points", "row"),
        ("rtol,frequency\n0.1,150\n2,150\n", "row 3, column rtol", "below 1"),
        ("scheme\nforward\n", "row 2, column scheme", "adaptive"),
    ],
)
def test_mistakes_name_row_and_column(content, key, remedy, folder, capsys):
    Path("design.csv").write_text(content)
    assert main(["sdof_slider", "--points", "design.csv", "-o", "out.nc"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"run-study: design.csv: {key}")
    assert remedy in line
    assert not Path("out.nc").exists()


@pytest.mark.parametrize(
    ("points", "key"),
    [
        ("missing.csv", "the file"),
        (3.0, "type"),
        ((np.zeros((2, 2)), ["frequency"]), "columns"),
        ({"frequency": [1.0, 2.0], "damping": [1.0]}, "columns"),
        ({"frequency": [100.0, None]}, "row 1, column frequency"),
        ({"frequency": [100.0], "friction_coefficient": [-0.1]}, "row 0, column friction_coefficient"),
        ({"step": [1.0]}, "axes.step"),
    ],
)
def test_mistakes_in_python(points, key, folder):
    with pytest.raises(UserError) as error:
        read_study("sdof_slider", {"axes.step": 3.0} if key == "axes.step" else {}, points)
    assert error.value.key == key


def test_points_are_printed_before_they_run(folder, capsys):
    Path("design.csv").write_text(DESIGN)
    given = ["--points", "design.csv", *options("axes.normal_load=[9, 10]"), "--plan", "--csv"]
    assert main(["sdof_slider", *given]) == 0
    rows = list(csv.DictReader(capsys.readouterr().out.splitlines()))
    assert [(each["point"], each["damping"], each["normal_load"]) for each in rows[:3]] == [
        ("0", "0.0", "9.0"), ("0", "0.0", "10.0"), ("1", "2.0", "9.0"),
    ]  # fmt: skip
    assert len(rows) == len({each["task"] for each in rows}) == len({each["scene"] for each in rows}) == 6
    assert all(float(each["seconds"]) > 0.0 and float(each["seconds_of_sweep"]) > 0.0 for each in rows)
    assert list(rows[0])[-1] == "point"
    assert main(["sdof_slider", "--csv"]) == 2


PLANNED = {
    "axes": (SLIDER, {"axes.normal_load": [9, 10], "axes.harmonics": [5, "auto"], "axes.sweep": ["up", "down"]}),
    "flags and tables": ("dovetail", {"axes.stress_stiffening": [True, False], "axes.mesh": [1, 2]}),
    "wear factors": ("cylinder_on_flat", {"axes.surfaces": {"flat": [0.5, 0.6]}, "wear.surfaces": {"cylinder": 0.5}}),
    "samples": (SAMPLES, {"axes.excitation_amplitude": [9.0, 10.0]}),
    "missions": (MISSIONS, {}),
    "modes": (MODES, {"axes.mass": [1.0, 1.1], "axes.sweep": ["up", "down"]}),
}


@pytest.mark.parametrize("case", PLANNED)
def test_the_points_of_a_plan_are_a_design_of_the_same_tasks(case, folder):
    source, overrides = PLANNED[case]
    if "\n" in source:
        Path("s.toml").write_text(source, encoding="utf-8")
        source = "s.toml"
    study = read_study(source, overrides)
    with Path("points.csv").open("w") as file:
        print_table(study, lambda _: None, file)
    again = read_study(source, {key: value for key, value in overrides.items() if "axes" not in key}, "points.csv")
    assert again.design.n > 1
    assert sorted(names_of(again)) == sorted(names_of(study))


@pytest.mark.slow
def test_the_report_shows_each_point_of_a_design(folder, capsys):
    Path("design.csv").write_text(DESIGN)
    assert main(["sdof_slider", *options(*CHEAP[2:]), "--points", "design.csv", "-o", "out.nc"]) == 0
    assert "point 1 (160 Hz, " in capsys.readouterr().out
    assert report(["out.nc"]) == 0
    page = Path("out-report/index.html").read_text("utf-8")
    assert "Points of the design" in page
    trends = Path("out-report/trends.csv").read_text("utf-8")
    assert trends.count("\n") > 12
    assert "_nolegend_" not in trends
    chosen = open_for_report("out.nc", {"damping": "2"})
    assert (chosen.designed, chosen.shown["point"]) == (["frequency", "damping", "scheme"], 1)
    loops = compute_worn_joint("out.nc", "worn", loops=[0], progress=False)["loops"]
    assert float(loops.loop_force.max()) > 0.0

"""What is wrong with a study: exit status 2, a line for each mistake with file, key, value and remedy, nothing else."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studyrunner.cli import main
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from tests.studyrunner import faked_blocks

SLIDER = """
[study]
name = "s"
[scene]
model = "sdof_slider"
[axes]
frequency = [150.0]
[slow_time]
cycles = 0
[solver]
harmonics = 5
"""
MODES = '[study]\nname = "m"\n[scene]\nmodel = "sdof_slider"\n[axes]\nmodal_amplitude = [1e-3, 1e-4]\n'
FOLLOWED = SLIDER.replace("[150.0]", '"peak"\n[loading]\nbetween = [180.0, 230.0]')
SAMPLES = SLIDER + "[scatter]\nsamples = 8\nfriction_coefficient = {normal = {std = 0.03}}\n"
RATIO = SLIDER.replace("frequency =", "frequency_ratio =")
END = SLIDER.replace("cycles = 0", "cycles = inf")
MISSIONS = faked_blocks.STUDY
DRAW = "scatter.friction_coefficient"

# a study, overrides, and for each line how it begins and what is in it
WRONG = [
    (SLIDER, "axes.freqency=1", "axes.freqency = 1: unknown key, give frequency"),
    (SLIDER, "slow_time.schemes=implicit", 'slow_time.schemes = "implicit": unknown key, give axes.scheme'),
    (SLIDER, "axis.frequency=1", "axis = {frequency = 1}: unknown table, give axes"),
    (SLIDER, "slow_time=3", "slow_time = 3: .. [slow_time]"),
    (SLIDER, "study.name='a/b'", 'study.name = "a/b": .. slash'),
    (SLIDER, "scene.model=turbine", 'scene.model = "turbine": .. dovetail_sector'),
    (SLIDER, "scene.model=missing.h5", 'scene.model = "missing.h5": .. no such file'),
    (SLIDER, "scene.area=-1e-4", "scene.area = -0.0001: .. above 0"),
    (SLIDER, "scene.mass=[1.0, 2.0]", "scene.mass = [1.0, 2.0]: .. the list as axes.mass"),
    (SLIDER, "axes.frequency=fast", 'axes.frequency = "fast": .. "resonance" or "peak"'),
    (SLIDER, "axes.frequency=[1, 2, 1.0]", "axes.frequency = 1.0: .. once"),
    (SLIDER, "axes.frequency={start = 1, stop = 2}", "axes.frequency = {start = 1, stop = 2}: .. {start, stop, num}"),
    (SLIDER, "axes.frequency={start=1, stop=2, num=1e9}", "axes.frequency.num = 1000000000.0: .. 100000 or less"),
    (SLIDER, "axes.step={start=0.0, stop=1, num=3, spacing='log'}", "axes.step = 0.0: .. above 0"),
    (SLIDER, "axes.scheme=euler", 'axes.scheme = "euler": .. "explicit"'),
    (SLIDER, "solver.harmonics=[1, 1.5]", "solver.harmonics = 1.5: .. whole"),
    (SLIDER, "solver.harmonics=1e9", 'solver.harmonics = 1000000000.0: .. 1000 or less, or "auto"'),
    (SLIDER, "solver.samples=10", "solver.samples = 10: .. at least 11"),
    (SLIDER, ("solver.harmonics=auto", "solver.samples=4"), "solver.samples = 4: .. at least 7"),
    (SLIDER, "slow_time.cycles=-1", "slow_time.cycles = -1: .. 0 or more"),
    (SLIDER, "slow_time.outputs=[2, 1]", "slow_time.outputs = [2, 1]: .. ascending"),
    (SLIDER, "slow_time.outputs=[0, 10]", "slow_time.outputs = 10.0: .. at most"),
    (SLIDER, "slow_time.until={hours = 1}", "slow_time.until = {hours = 1}: .. {wear_depth = ...}"),
    (SLIDER, "wear.law=reye", 'wear.law = "reye": .. "archard"'),
    (SLIDER, "wear.law=threshold", 'wear.law = "threshold": .. wear.threshold'),
    (SLIDER, ("wear={law='table', pressure=[0], depth=[0], factor=[[1]]}", "scene.worn={depth=1e-6}"), "wear.law"),
    (SLIDER, "wear.threshold=1.0", 'wear.threshold = 1.0: .. "threshold"'),
    (SLIDER, "wear.surfaces={disk = 1.0}", "wear.surfaces = {disk = 1.0}: .. surfaces support"),
    (SLIDER, "outputs.variables=default", 'outputs.variables = "default": .. list'),
    (SLIDER, "outputs.variables=['wear']", 'outputs.variables = "wear": .. wear_rate'),
    (SLIDER, "outputs.variables=['mesh']", 'outputs.variables = "mesh": .. has none'),
    (SLIDER, "outputs.variables=['natural_frequency']", "outputs.variables = .. nothing moves"),
    (SLIDER, "outputs.loops=[0, 1]", "outputs.loops = 1: .. from 0 to 0"),
    (SLIDER.replace("[study]\nname", "[other]\nname"), "", "study: missing", "other = .. unknown table"),
    (SLIDER.replace('model = "sdof_slider"\n', ""), "", "scene.model: missing"),
    (SLIDER.replace("model", "modle"), "axes.stepp=3", "scene.modle = .. give model", "axes.stepp = 3: .. step"),
    (SLIDER.replace("[scene]", "[scenes]"), "scenes.mas=1", "scene.mas = 1: .. mass", "scenes = .. give scene"),
    (SLIDER.replace("frequency = [150.0]\n", ""), "", "axes.frequency: missing"),
    (SLIDER.replace("[slow", "harmonics = [1, 3]\n[slow"), "", "solver.harmonics = 5: .. axes.harmonics"),
    (SLIDER + '"\\u001b]0;x\\u0007" = 1\n', "", r"solver.\x1b]0;x\x07 = 1: unknown key"),
    (SLIDER.replace("[150.0]", "1e999999999"), "", "axes.frequency = inf: .. finite"),
    (SLIDER, "scene.model=./s.toml", "model: .. no HDF5 file"),
    (RATIO, "", "axes.frequency_ratio = [150.0]: .. nothing that has mass"),
    (SAMPLES.replace("[150.0]", "1\nfrequency_ratio = 1"), "", "axes.frequency = [1.0]: .. one of both"),
    # axes that are keys of [scene] or [wear]
    (SLIDER, "axes.friction_coefficient=[0.3, -0.1]", "axes.friction_coefficient = -0.1: .. 0 or more"),
    ("sdof_slider", "axes.friction_coefficient={support=[0.3]}", "scene.friction_coefficient = 0.5: .. once"),
    (SLIDER, "axes.threshold=[1, 2]", 'axes.threshold = 1.0: .. only the law "threshold"'),
    (SLIDER, "axes.surfaces={nosuch=[1, 2]}", "axes.surfaces = {nosuch = 1.0}: .. support"),
    (SLIDER, "axes.surfaces={'<b>'=[1, 2]}", "axes.surfaces.<b> = [1, 2]: .. letters"),
    (SLIDER, "axes.stiffness={start=1e5, stop=2e5, num=10000000}", "axes.stiffness.num = 10000000: .. 100000 or less"),
    (
        SLIDER,
        ("axes.stiffness={start=1e5, stop=2e5, num=2000}", "axes.mass={start=1, stop=2, num=2001}"),
        "axes.mass = 2001: .. 4002000 combinations",
    ),
    (
        SLIDER,
        ("axes.stiffness={start=1e5, stop=2e5, num=200}", "axes.frequency={start=100, stop=200, num=6000}"),
        "axes.frequency = 6000: .. 1.2e+06 points",
    ),
    ("dovetail", ("axes.nodal_diameter=[0]", "outputs.variables=['natural_frequency']"), "outputs.variables = .. own"),
    # histories to the end
    (END, "axes.scheme=['adaptive', 'explicit']", 'axes.scheme = "explicit": .. "implicit"'),
    (END, "slow_time.outputs=[0, 10]", "slow_time.outputs = [0.0, 10.0]: .. number"),
    (END, ("axes.scheme=final", "slow_time.cycles=5"), "slow_time.cycles = 5.0: .. inf"),
    (END, ("axes.scheme=final", "slow_time.until={wear_depth=1}"), "slow_time.until = {wear_depth = 1.0}: .. out"),
    (END, "outputs.variables=['default', 'exact']", 'outputs.variables = "exact": .. given cycle counts'),
    # a frequency that is followed
    (FOLLOWED, "axes.frequency=resonnance", 'axes.frequency = "resonnance": .. "resonance" or "peak"'),
    (FOLLOWED, "axes.frequency=['peak', 200.0]", 'axes.frequency = ["peak", 200.0]: .. "peak" alone'),
    (FOLLOWED, "axes.frequency=200.0", "loading = {between = [180.0, 230.0]}: .. leave it out"),
    (FOLLOWED, "loading.between=[230.0, 180.0]", "loading.between = [230.0, 180.0]: .. lowest"),
    (FOLLOWED, "axes.sweep=ramp", 'axes.sweep = "ramp": .. "up" or "down"'),
    (FOLLOWED, "scatter={samples=3, frequency={normal={std=1.0}}}", "scatter.frequency: .. its own"),
    (SLIDER, "axes.frequency=peak", "loading.between: missing"),
    # nonlinear modes
    (MODES, "axes.frequency=200", "axes.frequency = [200.0]: leave it out"),
    (MODES, "axes.sweep=ramp", 'axes.sweep = "ramp": .. "up" or "down"'),
    (MODES, ("slow_time.cycles=10", "wear.law=energy"), "slow_time.cycles = 10.0: leave", 'wear.law = "energy": leave'),
    (MODES, "outputs.loops=[0]", "outputs.loops = [0]: leave it out"),
    (MODES, "outputs.variables=['worn_volume']", 'outputs.variables = "worn_volume": .. natural_frequency'),
    (MODES, "scene.worn={depth=0.0}", "scene.worn.cycle: missing"),
    # missions
    (MISSIONS, "slow_time.cycles=1e5", "slow_time.cycles = 100000.0: leave it out"),
    (MISSIONS, "slow_time.outputs=[0, 1.5]", "slow_time.outputs = [0.0, 1.5]: .. whole numbers"),
    (MISSIONS, "slow_time.until={frequency_shift = 0.1}", "slow_time.until = {frequency_shift = 0.1}: .. wear_depth"),
    (MISSIONS, ("axes.frequency=peak", "loading.between=[1, 2]"), 'axes.frequency = "peak": .. no resonance'),
    (
        MISSIONS,
        ("axes.normal_load=[1, 2]", "mission.0.normal_load=1.0", "mission.1.normal_load=1.0"),
        "axes.normal_load: .. every block",
    ),
    (MISSIONS, "mission.cruise.frequenzy=1.0", "mission.cruise.frequenzy = 1.0: unknown key, give frequency"),
    (MISSIONS, "mission.cruise.frequency={start=1.0, stop=2.0}", "mission.cruise.frequency = {start .. rate = Hz/s"),
    (MISSIONS, "mission.heavy.engine_order=4", "mission.heavy.engine_order = 4.0: .. one of both"),
    (MISSIONS, "mission.cruise.engine_order=4", "axes.frequency: .. every", "mission.cruise.engine_order = 4.0"),
    (MISSIONS, "mission.heavy.begin=continue", 'mission.heavy.begin = "continue": .. normal_load of the block before'),
    (MISSIONS, "mission.run-up.begin=ramp", 'mission.run-up.begin = "ramp": .. a passage is a sweep'),
    (MISSIONS, "mission.heavy.normal_load=-1.0", "mission.heavy.normal_load = -1.0: .. above 0"),
    (MISSIONS, "mission.heavy.wear_coefficient=1.0", "mission.heavy.wear_coefficient = 1.0: .. the same in all blocks"),
    (MISSIONS, "mission.heavy.name=cruise", 'mission.name = "cruise": .. its own'),
    (MISSIONS, "mission=[]", "mission = []: .. [[mission]]"),
    (MISSIONS, "outputs.variables=['slip_range']", 'outputs.variables = "slip_range": .. worn_volume'),
    (MISSIONS, "scatter={samples=4, frequency={normal={std=1.0}}}", "scatter.frequency = {std = 1.0}: .. run-up"),
    # scatter
    (SLIDER, f"{DRAW}={{normal={{std=0.1}}}}", "scatter.samples: missing"),
    (SLIDER, "scatter.samples=8", "scatter.samples = 8: .. friction_coefficient = {normal"),
    (SAMPLES, ("scatter.samples=1000000", "axes.frequency=[1, 2]"), "scatter.samples = 1000000: give fewer"),
    (SAMPLES, ("scatter.method=saltelli", "scatter.samples=12"), "scatter.samples = 12: .. power of 2"),
    (SAMPLES, "scatter.mass=0.5", "scatter.mass = 0.5: .. one distribution"),
    (SAMPLES, f"{DRAW}.uniform={{half_width = 1.0}}", f"{DRAW} = .. one distribution"),
    (SAMPLES, f"{DRAW}.normal=0.1", f"{DRAW}.normal = 0.1: give a table"),
    (SAMPLES, f"{DRAW}.normal.sigma=0.1", f"{DRAW}.normal.sigma = 0.1: unknown key, .. std"),
    (SAMPLES, f"{DRAW}.normal={{mean = 0.5}}", f"{DRAW}.normal = {{mean = 0.5}}: .. either std"),
    (SAMPLES, "scatter.mass={uniform={low=2.0, high=1.0}}", "scatter.mass.uniform = {low = 2.0, .. high above"),
    (SAMPLES, "scatter.mass={normal={std=1}, of='each pair'}", 'scatter.mass.of = "each pair": .. only area'),
    (SAMPLES, f"{DRAW}.correlation_length=0.1", f"{DRAW}.correlation_length = 0.1: .. each pair"),
    (SAMPLES, "scatter.gap={normal={std=1}, of='each pair', correlation_length=1}", "scatter.gap.correlation_length"),
    (SAMPLES, "scatter.stifness={normal={std=0.1}}", "scatter.stifness: unknown input, give stiffness"),
    (
        SAMPLES,
        ("wear.law=threshold", "wear.threshold=1", "scatter.threshold={normal={std=1}}"),
        "scatter.threshold = {std = 1.0}: .. less width",
    ),
    (SAMPLES, "scatter.mass={normal={std=1}}", "scatter.mass = -1. .. less width"),
    (
        SAMPLES,
        ("axes.frequency=[1, 2]", "scatter.frequency={normal={mean=1, std=0.1}}"),
        "scatter.frequency = {mean = 1.0, std = 0.1}: .. one value of axes.frequency",
    ),
    (SAMPLES, ("scatter.area={normal={std=1e-6}}", "outputs.variables=['exact']"), 'outputs.variables = "exact"'),
    (SAMPLES, ("scatter.stiffness={normal={std=1}}", "outputs.scene=true"), "outputs.scene .. 8 scenes"),
    # several at once, in the order of the file
    (
        SLIDER + '[wear]\nlaw = "threshold"\n[scatter]\nsamples = 0\nmu = {normal = {sigma = 1}}\n',
        ("scene.mas=1", "scene.area=-1.0", "axes.damping=[0.1, -0.2]", "axes.shceme=euler", "slow_time.outputs=[0, 9]"),
        "scene.area = -1.0",
        "scene.mas = 1: .. mass",
        "axes.shceme = .. scheme",
        "axes.damping = -0.2",
        "slow_time.outputs = 9.0",
        "wear.law",
        "scatter.samples = 0",
        "scatter.mu.normal.sigma = 1",
    ),
    (SLIDER, ("scene.area=-1", "axes.scheme=final", "solver.samples=8"), "scene.area", "slow_time.cycles", "solver.s"),
    (MISSIONS, ("scene.mas=1", "mission.heavy.mass=-1"), "scene.mas = 1", "mission.heavy.mass = -1"),
]  # fmt: skip


@pytest.mark.parametrize("row", WRONG, ids=[str(row[1]) for row in WRONG])
def test_each_mistake_is_a_line_and_nothing_is_computed(row, folder, capsys):
    study, overrides, *expected = row
    name = study if "\n" not in study else "s.toml"
    if name != study:
        Path(name).write_text(study, encoding="utf-8")
    changes = (overrides,) if isinstance(overrides, str) else overrides
    given = [word for change in changes if change for word in ("--set", change)]
    before = sorted(folder.iterdir())
    assert main([name, "--plan", *given]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    lines = said.err.splitlines()
    assert len(lines) == len(expected), said.err
    for line, words in zip(lines, expected, strict=True):
        start, *rest = words.split(" .. ")
        assert line.startswith(f"run-study: {name}: {start}"), line
        assert all(word in line for word in rest), line
    assert sorted(folder.iterdir()) == before


@pytest.mark.parametrize(
    "content", [b"[study\n", b"\xff" * 100_000, b"a = 1979-13-27", b"a=" + b"[" * 100_000, b"#" * 3_000_000]
)
def test_a_file_that_is_no_toml(content, folder, capsys):
    Path("s.toml").write_bytes(content)
    assert main(["s.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("run-study: s.toml: the file: give ")


# --- any text ---

VALUES = (
    *("nan", "-inf", "1e308", "-5e-324", "0", "-1", "9" * 400, "0x" + "f" * 300, "1e400", "true", "1979-05-27", "[]"),
    *("{}", "[[1]]", '""', '"auto"', '"\\u001b[2J"', "'../../x'", "[1, 'a']", "{start = 1, stop = 2, num = 1e9}", "="),
    *('"default"', "[" * 60 + "]" * 60, "1e9", '"adaptive"', "[nan]", "{start = nan, stop = 2, num = 3}", "\x00", "]"),
    *('"peak"', "[1.0, 2.0]", "{normal = {std = 0.1}}", "[{name = 1}]", "#", "\ud800"),
)
LINES = sorted({line for text in (SLIDER, MODES, FOLLOWED, SAMPLES, MISSIONS) for line in text.splitlines()})
CHANGES = st.one_of(
    st.tuples(st.just("value"), st.integers(0, 99), st.sampled_from(VALUES)),
    st.tuples(st.just("value"), st.integers(0, 99), st.sampled_from(VALUES)),
    st.tuples(st.just("insert"), st.integers(0, 99), st.sampled_from(LINES)),
    st.tuples(st.just("text"), st.integers(0, 99), st.text(max_size=9)),
    st.tuples(st.just("remove"), st.integers(0, 99), st.just("")),
)


@pytest.mark.slow
@given(st.sampled_from([SLIDER, MODES, FOLLOWED, SAMPLES, MISSIONS]), st.lists(CHANGES, min_size=1, max_size=4))
def test_any_text_is_a_study_that_can_be_written_or_mistakes(tmp_path_factory, text, changes):
    lines = text.splitlines()
    for way, number, new in changes:
        place = number % max(1, len(lines))
        if way == "value" and lines and "=" in lines[place]:
            lines[place] = f"{lines[place].partition('=')[0]}= {new}"
        elif way == "remove":
            del lines[place : place + 1]
        else:
            lines.insert(place, new)
    path = tmp_path_factory.getbasetemp() / "any.toml"
    path.write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    said = ""
    try:
        study = read_study(path)
    except UserError as error:
        said = str(error)
    if said:
        assert all(line.isprintable() and len(line) < 2000 for line in said.splitlines())
        return
    path.write_text(format_study(study), encoding="utf-8")
    assert format_study(read_study(path)) == format_study(study)

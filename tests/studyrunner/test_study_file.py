"""Study files: defaults, axes, overrides, the effective study that goes into the result; the pages on them."""

import re
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studyrunner.cli import main
from studyrunner.kinds.wear.kind import USUAL
from studyrunner.study.sections import SOLVER_AXES, AxesSection
from studyrunner.study.study_file import format_study, read_study
from studyrunner.study.text import format_toml, read_toml
from studyrunner.user_error import UserError
from tests.studies.fe_models.decks import SECTOR
from tests.studyrunner.small_studies import FOLLOWED, MISSIONS, MODES, SAMPLES, SLIDER, TO_THE_END, write_depths

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.usefixtures("folder")


def read(text, *overrides):
    Path("s.toml").write_text(text, encoding="utf-8")
    return read_study("s.toml", overrides)


# --- what is read ---


def test_every_default_is_filled_in():
    smallest = '[study]\nname = "s"\n[scene]\nmodel = "sdof_slider"\n[axes]\nfrequency = 100\n'
    # a byte order mark is no text
    Path("s.toml").write_bytes(b"\xef\xbb\xbf" + smallest.replace("\n", "\r\n").encode())
    study = read_study("s.toml")
    given = {"frequency": (100.0,)}
    fields = AxesSection.model_fields
    assert study.dimensions == {name: given.get(name, fields[name].default) for name in study.kind.axes}
    assert [getattr(study.solver, key) for key in SOLVER_AXES] == [("auto",), ("auto",), (1e-8,), (1e-2,)]
    assert (study.solver.time_limit, study.solver.shortcuts) == (None, True)
    assert study.output_counts == tuple(1000.0 * position for position in range(101))
    assert study.friction_coefficient == 0.5
    assert (study.outputs.variables, study.outputs.loops) == (USUAL, ())
    more = read_study("dovetail", ["outputs.variables=['natural_frequency', 'default']"])
    assert more.outputs.variables == (*USUAL, "mesh", "natural_frequency")


@pytest.mark.parametrize(
    ("given", "written"),
    [
        ("{start = 212, stop = 213, num = 6}", "212.0 212.2 212.4 212.6 212.8 213.0"),
        ("{start = 0.3, stop = 0.1, num = 3}", "0.3 0.2 0.1"),
        ("{start = 1e-300, stop = 4e-300, num = 4}", "1e-300 2e-300 3e-300 4e-300"),
        ("{start = 1, stop = 2, num = 4}", "1.0 1.3333333333333333 1.6666666666666667 2.0"),
        ("{start = 7.7, stop = 9, num = 1}", "7.7"),
    ],
)
def test_values_of_a_range_are_those_that_a_person_writes(given, written):
    assert " ".join(map(repr, read(SLIDER, f"axes.frequency={given}").axes.frequency)) == written


@pytest.mark.parametrize(
    ("key", "values"),
    [("harmonics", "['auto', 3]"), ("harmonics", "{start = 1, stop = 5, num = 3}"), ("rtol", "[1e-1, 1e-2, 1e-3]")],
)
def test_several_values_of_a_solver_key_are_an_axis(key, values):
    there = read_study("dovetail", [f"axes.{key}={values}", "axes.tolerance=1e-9"])
    here = read_study("dovetail", [f"solver.{key}={values}", "axes.tolerance=1e-9"])
    assert len(here.dimensions[key]) > 1
    assert here.dimensions == there.dimensions
    assert list(here.dimensions)[len(here.kind.axes) :] == sorted([key, "tolerance"], key=SOLVER_AXES.index)
    assert format_study(here) == format_study(there)


# --- the effective study ---


@pytest.mark.parametrize(
    ("text", "overrides"),
    [
        (SLIDER, ["solver.harmonics=3", "axes.rtol=[0.1, 0.2]"]),
        (SLIDER, ["study.title='\\ \"title\" with é'", "slow_time.outputs=[0]"]),
        (SLIDER, ["axes.samples=[64, 'auto']", "wear.law=threshold", "axes.threshold=[0, 5]"]),
        (SLIDER, ["wear.surfaces={support=0.5}", "scatter={samples=8, surfaces={support={lognormal={factor=1.5}}}}"]),
        (SLIDER, ["scene.worn={result='worn.nc', cycle=[0, 1000]}"]),
        (SAMPLES, ["axes.stiffness=[1.7e5, 1.6e5]", "axes.friction_coefficient=[0.4, 0.6]"]),
        (MODES, ["scene.worn={depth=[[1e-6], [0.0]], cycle=[1e4, 0]}", "axes.mode=[1, 3]"]),
        (MISSIONS, ["mission.cruise.seconds=20", "mission.2.cycles=500"]),
        (FOLLOWED, []),
        (TO_THE_END, ["axes.scheme=final"]),
        # each load has a width of its own
        (SLIDER, ["scene={model='cylinder_on_flat', stroke=1e-5}", "slow_time.cycles=10", "axes.P=[1e5, 2e5]"]),
    ],
)
def test_the_effective_study_is_the_same_study(text, overrides):
    write_depths("worn.nc", 150.0, [0.0, 1000.0], 1)
    study = read(text, *overrides)
    Path("worn.nc").unlink()
    written = format_study(study)
    again = read(written)
    assert format_study(again) == written
    assert (again.dimensions, again.follow) == (study.dimensions, study.follow)
    assert [each.scene for each in again.variants] == [each.scene for each in study.variants]


VALUES = (
    *("nan", "-inf", "1e308", "-5e-324", "0", "-1", "9" * 400, "0x" + "f" * 300, "1e400", "true", "1979-05-27", "[]"),
    *("{}", "[[1]]", '""', '"auto"', '"\\u001b[2J"', "'../../x'", "[1, 'a']", "{start = 1, stop = 2, num = 1e9}", "="),
    *('"default"', "[" * 60 + "]" * 60, "1e9", '"adaptive"', "[nan]", "{start = nan, stop = 2, num = 3}", "\x00", "]"),
    *('"peak"', "[1.0, 2.0]", "{normal = {std = 0.1}}", "[{name = 1}]", "#", "\ud800"),
)
TEXTS = [SLIDER, MODES, FOLLOWED, SAMPLES, MISSIONS]
CHANGES = st.one_of(
    st.tuples(st.just("value"), st.integers(0, 99), st.sampled_from(VALUES)),
    st.tuples(st.just("value"), st.integers(0, 99), st.sampled_from(VALUES)),
    st.tuples(st.just("insert"), st.integers(0, 99), st.sampled_from(sorted({*"\n".join(TEXTS).splitlines()}))),
    st.tuples(st.just("text"), st.integers(0, 99), st.text(max_size=9)),
    st.tuples(st.just("remove"), st.integers(0, 99), st.just("")),
)


@pytest.mark.slow
@settings(suppress_health_check=list(HealthCheck))
@given(st.sampled_from(TEXTS), st.lists(CHANGES, min_size=1, max_size=4))
def test_any_text_is_a_study_that_can_be_written_or_mistakes(text, changes):
    lines = text.splitlines()
    for way, number, new in changes:
        place = number % max(1, len(lines))
        if way == "value" and lines and "=" in lines[place]:
            lines[place] = f"{lines[place].partition('=')[0]}= {new}"
        elif way == "remove":
            del lines[place : place + 1]
        else:
            lines.insert(place, new)
    Path("any.toml").write_bytes("\n".join(lines).encode("utf-8", "surrogatepass"))
    said = ""
    try:
        study = read_study("any.toml")
    except UserError as error:
        said = str(error)
    assert all(line.isprintable() and len(line) < 2000 for line in said.splitlines())
    if not said:
        Path("any.toml").write_text(format_study(study), encoding="utf-8")
        assert format_study(read_study("any.toml")) == format_study(study)


# --- the pages ---

PAGES = [path for path in ROOT.rglob("*.md") if ".venv" not in path.parts and "```toml" in path.read_text("utf-8")]
EXAMPLES = [
    pytest.param(text, id=f"{page.stem}-{number}", marks=[pytest.mark.slow] * ("[study]" in text))
    for page in sorted(PAGES)
    for number, text in enumerate(re.findall(r"^```toml\n(.*?)^```$", page.read_text("utf-8"), re.M | re.S))
]


@pytest.mark.parametrize("text", EXAMPLES)
def test_every_example_is_a_study(text, capsys):
    # what the examples name: a result, a scene file, decks, reduced matrices, measurements
    write_depths("dovetail.nc", 211.5, [0.0, 1e4, 5e4, 1e5], 24)
    assert main(["sdof_slider", "--write-scene", "my_root.h5"]) == 0
    for deck in (SECTOR, ROOT / "studies" / "blade_root.inp"):
        shutil.copy(deck, deck.name.removeprefix("calculix_"))
    for name in ("nodes.csv", "blade.pch", "stress.csv"):
        Path(name).touch()
    Path("worn.csv").write_text("cycle,worn_volume_mm3\n1e4,0.1\n", encoding="utf-8")
    Path("blades.csv").write_text("sector,frequency\n" + "".join(f"{sector},0\n" for sector in range(12)))
    Path("scar.csv").write_text("x_mm,depth_um\n" + "".join(f"{x},1\n" for x in range(5)), encoding="utf-8")
    table = read_toml(text.encode(), "page")
    complete = {"study", "scene"} <= table.keys() and table.keys() & {"axes", "mission"}
    given = {"study": {"name": "s"}, "scene": {"model": "dovetail_sector"}, "axes": {}}
    whole = table if complete else {**given, **table}
    whole["scene"].setdefault("model", "dovetail_sector")
    if not complete and "modal_amplitude" not in whole["axes"]:
        whole["axes"].setdefault("frequency", 211.5)
    if whole["scene"]["model"] == "sector.inp":
        # the names of the page are those of any deck
        whole["scene"].pop("friction_coefficient")
    assert read(format_toml(whole)).dimensions
    if complete:
        Path("s.toml").write_text(text, encoding="utf-8")
        assert main(["s.toml", "--plan"]) == 0
        assert "points" in capsys.readouterr().out


def test_a_new_study_is_planned_and_its_comments_are_its_defaults(folder):
    assert main(["--new", "wear"]) == 0
    text = Path("wear.toml").read_text("utf-8")
    study = read_study("wear.toml")
    assert study.study.name == "wear"
    body, _, scatter = text.partition("# [scatter]")
    shown = re.sub(r"^# (\w+ = )", r"\1", body, flags=re.M)
    assert len(read_toml(shown.encode(), "")["solver"]) == 5
    assert format_study(read(shown)) == format_study(study)
    assert read(body + ("[scatter]" + scatter).replace("\n# ", "\n")).dimensions["sample"] == range(16)
    shutil.copy(SECTOR, "sector.inp")
    assert main(["--new", "root", "--from", "sector.inp"]) == 0
    assert read_study("root.toml").axes.frequency_ratio == (0.99, 1.0)
    for name in ("wear", "root"):
        assert main([f"{name}.toml", "--plan"]) == 0

"""What is wrong with a study or the command: exit status 2, a line for each mistake with file, key, value and
remedy, and nothing else."""

import contextlib
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studies.scene_file import write_scene
from studyrunner.cli import main
from studyrunner.system import progress
from studyrunner.user_error import listing
from tests.mpi.launching import options
from tests.studies.fe_models.decks import SECTOR
from tests.studies.fe_models.matrix_files import write_matrix_input
from tests.studies.fe_models.plates import Plates
from tests.studies.scene_models import plain, sector
from tests.studyrunner import small_studies as small

SCENE = small.SLIDER.replace("sdof_slider", "rough.h5").replace("harmonics = 5", "samples = 64")
RATIO = small.SLIDER.replace("frequency =", "frequency_ratio =")
DRAW = "scatter.friction_coefficient"

# a row: overrides, and the keys that the lines name, with their values where these are not those of the row; the key of
# the last override where nothing is said
WRONG = {
    small.SLIDER: f"""
        axes.freqency=1
        slow_time.schemes=implicit
        axis.frequency=1 -> axis = {{frequency = 1}}
        slow_time=3
        study.name='a/b'
        scene.model=turbine
        scene.model=missing.h5
        scene.model=./s.toml -> model
        scene.area=-1e-4
        scene.mass=[1.0, 2.0]
        axes.frequency=fast
        axes.frequency=[1, 1e200] -> axes.frequency = 1e+200
        axes.step=2026-11-26
        axes.frequency=[1, 2, 1.0] -> axes.frequency = 1.0
        axes.frequency={{start = 1, stop = 2}}
        axes.frequency={{start=1, stop=2, num=1e9}} -> axes.frequency.num = 1000000000.0
        axes.step={{start=0.0, stop=1, num=3, spacing='log'}} -> axes.step = 0.0
        axes.scheme=euler
        solver.harmonics=1e9
        solver.samples=10
        solver.harmonics=auto ; solver.samples=4
        slow_time.outputs=[0, 10]
        slow_time.until={{hours = 1}}
        axes.excitation_amplitude=allowable -> slow_time.until, slow_time.cycles
        axes.excitation_amplitude=[1.0, 'allowable'] ; slow_time.until={{wear_depth=1e-5}} \
            -> axes.excitation_amplitude, slow_time.cycles
        axes.excitation_amplitude=allowable ; slow_time={{cycles=inf, until={{wear_depth=1e-5}}}} -> slow_time.cycles
        wear.law=threshold -> wear.threshold
        wear={{law='table', pressure=[0], depth=[0], factor=[[1]]}} ; scene.worn={{depth=1e-6}} -> wear.law
        wear.threshold=1.0
        wear.evolution={{energy=[0, 1e5]}} -> wear.evolution
        wear.evolution={{energy=[1, 1e5], wear_factor=[1, 2]}} -> wear.evolution.energy = 1.0
        wear.evolution={{energy=[0, 1e5, 1e4], wear_factor=[1, 2, 3]}} -> wear.evolution.energy
        wear.evolution={{energy=[0, 1e5], wear_factor=[1, 2, 3]}} -> wear.evolution.wear_factor
        wear.evolution={{energy=[0, 1e5], contact_stiffness=[1e13, 5e12]}} \
            -> wear.evolution.contact_stiffness = 5000000000000.0
        scene.friction_coefficient=0.4 ; wear.evolution={{energy=[0, 1e5], friction_coefficient=[0.3, 0.5]}} \
            -> scene.friction_coefficient
        wear.evolution={{energy=[0, 1e5], wear_factor=[1, 2]}} ; scene.worn={{depth=1e-6}} -> scene.worn.energy
        wear.evolution={{energy=[0, 1e5], wear_factor={{nosuch=[1, 2]}}}} -> wear.evolution.wear_factor
        outputs.variables=['wear'] -> outputs.variables = "wear"
        outputs.variables=['mesh']
        outputs.variables=['natural_frequency']
        outputs.loops=[0, 1] -> outputs.loops = 1
        slow_time.cycles=1e6 ; slow_time.outputs=200000 ; outputs.loops=[0]
        axes.frequency=peak -> loading.between
        axes.frequency=resonance ; loading.between=[100, 200] ; axes.sweep=['down', 'ramp'] -> axes.sweep = "ramp"
        axes.frequency=[1, 'peak'] ; loading.between=[1, 2] ; axes.sweep=ramp -> axes.frequency, axes.sweep = "ramp"
        axes.friction_coefficient=[0.3, -0.1] -> axes.friction_coefficient = -0.1
        axes.surfaces={{nosuch=[1, 2]}}
        axes.surfaces={{'<b>'=[1, 2]}} -> axes.surfaces.<b>
        axes.stiffness={{start=1e5, stop=2e5, num=2000}} ; axes.mass={{start=1, stop=2, num=2001}}
        axes.stiffness={{start=1e5, stop=2e5, num=10000000}} -> axes.stiffness.num = 10000000
        axes.stiffness={{start=1, stop=2, num=200}} ; axes.frequency={{start=1, stop=2, num=6000}}
        axes.stiffness=[1.6e5, 1.7e5] ; outputs.scene=true
        {DRAW}={{normal={{std=0.1}}}} -> scatter.samples
        scatter.samples=8
        scene.worn={{depth=[5e-6, 1e-6]}} -> scene.worn.depth
        scene.worn={{depth=[[1e-6], [2e-6], [3e-6]], cycle=[0, 1]}} -> scene.worn.depth
        scene.worn={{depth=[[1e-6], [2e-6]], cycle=['a', 1]}} -> scene.worn.cycle = "a"
        scene.worn={{result='worn.nc', cycle=[10]}} -> scene.worn.cycle = 10.0
        scene.worn={{result='worn.nc', cycle=[0, 0]}} -> scene.worn.cycle
        scene.worn={{result='worn.nc', cycle=[0], freq=1}} -> scene.worn.freq = 1
        scene.worn={{result='worn.nc', cycle=[0], frequency=151}} -> scene.worn.frequency = 151
        scene.worn={{result='worn.nc', cycle=[0], scheme='explicit'}} -> scene.worn.scheme
        scene.worn={{result='none.nc', cycle=[0]}} -> scene.worn.result = "none.nc"
        scene.worn={{result='missions.nc', cycle=[0]}} -> scene.worn.result
        scene.worn={{result='ended.nc', cycle=[1]}} -> scene.worn.cycle = 1.0
        axes.scheme=final ; solver.samples=8 -> solver.samples, axes.scheme
    """,
    small.SLIDER.replace("[study]\nname", "[other]\nname"): "-> other",
    small.SLIDER.replace('model = "sdof_slider"\n', ""): "-> scene.model",
    small.SLIDER.replace("model", "modle"): "axes.stepp=3 -> scene.model",
    small.SLIDER.replace("[scene]", "[scenes]"): "scenes.mas=1 -> scenes",
    small.SLIDER.replace("frequency = [150.0]\n", ""): "-> axes.frequency",
    small.SLIDER.replace("[slow", "harmonics = [1, 3]\n[slow"): "-> solver.harmonics = 5",
    small.SLIDER.replace("[150.0]", "1e999999999"): "-> axes.frequency = inf",
    small.SLIDER + '"\\u001b]0;x\\u0007" = 1\n': r"-> solver.\x1b]0;x\x07",
    small.SLIDER + '[wear]\nlaw = "threshold"\n[scatter]\nsamples = 0\nmu = {normal = {sigma = 1}}\n': """
        scene.mas=1 ; scene.area=-1 ; axes.damping=[-0.2, 0.1] ; axes.shceme=euler -> axes.shceme, wear.threshold, \
scatter.samples, scatter.mu.normal.sigma, axes.damping, scene.area, scene.mas
    """,
    "sdof_slider": "axes.friction_coefficient={support=[0.3]} -> scene.friction_coefficient = 0.5",
    "dovetail": "axes.nodal_diameter=[0] ; outputs.variables=['natural_frequency']",
    "cylinder_on_flat": "axes.surfaces={flat=[0.5, 1.0]} -> wear.surfaces",
    RATIO: "-> axes.frequency_ratio = [150.0]",
    small.TO_THE_END: """
        axes.scheme=['adaptive', 'explicit'] -> axes.scheme = "explicit"
        slow_time.outputs=[0, 10]
        slow_time.cycles=5 ; axes.scheme=final
        axes.frequency=peak ; loading.between=[100, 200] ; axes.scheme=final -> axes.scheme = "final"
        slow_time.until={wear_depth=1} ; axes.scheme=final
        outputs.variables=['default', 'exact'] -> outputs.variables = "exact"
    """,
    small.FOLLOWED: """
        axes.frequency=['peak', 200.0]
        axes.frequency=200.0 -> loading
        loading.between=[230.0, 180.0]
        axes.sweep=ramp
        scatter={samples=3, frequency={normal={std=1.0}}} -> scatter.frequency
    """,
    small.MODES: """
        axes.frequency=200
        axes.sweep=ramp
        slow_time.cycles=10 ; wear.law=energy -> slow_time.cycles, wear.law
        outputs.loops=[0]
        scene.worn={depth=0.0} -> scene.worn.cycle
    """,
    small.MISSIONS: """
        slow_time.cycles=1e5
        slow_time.outputs=[0, 1.5]
        slow_time.until={frequency_shift = 0.1}
        axes.frequency=peak ; loading.between=[1, 2] -> axes.frequency
        axes.normal_load=[1, 2] ; mission.0.normal_load=1.0 ; mission.1.normal_load=1.0 -> axes.normal_load
        mission.cruise.frequency={start=1.0, stop=2.0}
        mission.run-up.frequency={start=1.0, stop=1e300, rate=1.0} -> mission.run-up.frequency.stop
        mission.heavy.engine_order=4
        mission.cruise.engine_order=4 -> axes.frequency
        mission.heavy.begin=continue
        mission.run-up.begin=ramp -> mission.run-up.frequency
        mission.heavy.wear_coefficient=1.0
        mission.heavy.evolution={energy=[1, 2], wear_factor=[1, 2]} -> mission.heavy.evolution.energy = 1.0
        mission.heavy.friction_coefficient=0.4 ; \
mission.heavy.evolution={energy=[0, 1e5], friction_coefficient=[0.3, 0.5]} -> mission.heavy.friction_coefficient = 0.4
        mission.heavy.name=cruise -> mission.name
        mission=[]
        scatter={samples=4, frequency={normal={std=1.0}}} -> scatter.frequency
        mission.heavy.mass=-1
    """,
    small.SAMPLES: f"""
        scatter.samples=1000000 ; axes.frequency=[1, 2] -> scatter.samples
        scatter.method=saltelli ; scatter.samples=12
        {DRAW}.uniform={{half_width = 1.0}} -> {DRAW}
        {DRAW}.normal.sigma=0.1
        {DRAW}.normal={{mean = 0.5}}
        scatter.mass={{uniform={{low=2.0, high=1.0}}}} -> scatter.mass.uniform
        scatter.mass={{normal={{std=1}}, of='each pair'}} -> scatter.mass.of
        {DRAW}.correlation_length=0.1
        scatter.gap={{normal={{std=1}}, of='each pair', correlation_length=1}} -> scatter.gap.correlation_length
        scatter.stifness={{normal={{std=0.1}}}}
        scatter.limits={{depth=1e-6}} -> scatter.limits.depth
        scatter.limits={{wear_depth=-1e-6}} -> scatter.limits.wear_depth
        scatter.limits={{worn_volume='1 mm3'}} -> scatter.limits.worn_volume
        scatter.limits={{}}
        slow_time.until={{wear_depth=1e-5}} ; scatter.limits={{wear_depth=5e-6}}
        scatter.limits={{cycles_to_target=5}}
        slow_time.until={{wear_depth=1e-5}} ; scatter.limits={{missions_to_target=5}}
        slow_time.until={{wear_depth=1e-5}} ; scatter.limits={{cycles_to_target=1e9}} -> scatter.limits.cycles_to_target
        scatter={{limits={{wear_depth=5e-6}}}} -> scatter.samples
        scatter={{samples=8, limits={{wear_depth=5e-6}}}} -> scatter.samples
        scatter.mass={{normal={{std=1}}}}
        axes.frequency=[1, 2] ; scatter.frequency={{normal={{mean=1, std=0.1}}}}
        scatter.area={{normal={{std=1e-6}}}} ; outputs.variables=['exact']
        scatter.stiffness={{normal={{std=1}}}} ; outputs.scene=true
    """,
    small.SAMPLES.replace("[150.0]", "1\nfrequency_ratio = 1"): "-> axes.frequency",
    # scene files: with and without friction of their own, of fewer nodal diameters than the harmonics need
    SCENE: """
        scene.friction_coefficient=0.3
        axes.friction_coefficient=[0.3, 0.4] -> axes.friction_coefficient = 0.3
        scene.model=plain.h5 -> scene.friction_coefficient
        scene.worn={result='worn.nc', cycle=[0]} -> scene.worn.result
        scene.model=wave.h5 ; scene.friction_coefficient=0.3 ; solver.harmonics=4 -> wave.h5: nd/16
        scene.model=wave.h5 ; scene.friction_coefficient=0.3 ; axes.harmonics=['auto', 4] -> wave.h5: nd/16
    """,
    small.ROOT_OF_A_DECK: """
        scene.contact=[["BLADS","DISKS"]]
        scene.load.set=TOP
        scene.model=none.inp
        scene={model="none.inp"} -> scene.model
        scene.matrices=none
        scene.n_sectors=47
        scene.friction_coefficient={BLADE=0.3} -> scene.friction_coefficient.BLADE
        scene.nodal_diameter=7
        scene.load.direction=[0,0,0]
        scene.clamp=[]
        scene.tolerance=1e-12 ; scene.contact=[["TIP","DISKS"]]
    """,
    small.ROOT_OF_A_DECK.replace("friction_coefficient = 0.1\n", ""): """
        axes.friction_coefficient={A=[0.1, 0.2]} -> axes.friction_coefficient.A
    """,
    small.LAP_JOINT: """
        scene.model=lap.med
        scene.units=mm-t-s ; scene.matrices=job -> scene.units
        scene.matrices=job ; scene.stress_stiffening=false
        scene.contact=[["UNDER","UNDER"]]
        scene.rotation_speed=100 -> scene.axis
        scene.clamp=['GROUND','UNDER'] -> scene.contact
        scene.preload=[{set='BOLT',direction=[0,0,1],force=1.0}] -> scene.preload.set
    """,
}

# the command, and with which file and key its line begins
COMMANDS = [
    ("missing.toml", "missing.toml: the study"),
    ("unheard_of", "unheard_of: the study"),
    (".", ".: the study"),
    ("s.toml --from deck.inp", "command line: --from"),
    ("s.toml --bogus", "command line: options"),
    ("s.toml --set axes.step=[1,", "command line: --set axes.step"),
    ("s.toml --set study.name.first=a", "command line: --set study.name.first"),
    ("s.toml --set axes.step", "command line: --set axes.step"),
    ("s.toml -o nowhere/out.nc", "command line: -o"),
    ("s.toml -o \udcff.nc", "command line: -o"),
    ("s.toml -o s.toml", "command line: -o"),
    ("s.toml -o /dev/stdout", "command line: -o"),
    ("s.toml --date=2026-02-29", "command line: --date"),
    ("s.toml --write-scene nowhere/out.h5", "command line: --write-scene"),
    ("s.toml --write-scene plain.h5", "command line: --write-scene"),
    ("sdof_slider --set axes.mass=[1,2] --write-scene scene.h5", "sdof_slider: scene"),
    ("s.toml --set scene.worn={result='worn.nc',cycle=[0]} -o worn.nc --overwrite", "command line: -o"),
    ("s.toml --set scene.worn={result='part.nc',cycle=[0]}", "part.nc: the file"),
    ("two_masses --check", "command line: --check"),
    ("--new s", "command line: --new"),
    ("--new a/b", "command line: --new"),
    ("--new none --from none.inp", "none.inp: model"),
    *((f"{number}.toml", f"{number}.toml: the file") for number in range(4)),
]
NO_TOML = (b"\xff" * 100_000, b"a = 1979-13-27", b"a=" + b"[" * 100_000, b"#" * 3_000_000)


def rows():
    """Study, overrides, and how the lines begin."""
    for study, text in WRONG.items():
        for row in filter(None, map(str.strip, text.replace("\\\n", "").splitlines())):
            overrides, _, named = row.partition("-> ")
            given = [each.strip() for each in overrides.split(" ; ") if each.strip()]
            keys = named.split(", ") if named else [given[-1].partition("=")[0]]
            yield pytest.param(study, given, keys, id=row)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with what the studies name."""
    folder = tmp_path_factory.mktemp("files")
    shutil.copy(SECTOR, folder / "sector.inp")
    (folder / "lap.inp").write_text(Plates().deck())
    (folder / "lap.med").touch()
    write_matrix_input(folder, *Plates().system())
    own = replace(plain().contact, friction_coefficient=np.array([0.2, 0.3, 0.4]))
    wave = replace(sector(), n_sectors=47, nodal_diameter=4)
    (standing, travelling) = wave.linear.values()
    held = {k: standing if k == 0 else travelling for k in (0, 4, 8, 12)}
    for name, model in {
        "plain": plain(),
        "rough": replace(plain(), contact=own),
        "wave": replace(wave, linear=held),
    }.items():
        write_scene(model, folder / f"{name}.h5")
    small.write_depths(folder / "worn.nc", 150.0, [0.0, 1000.0], 1)
    with xr.open_dataset(folder / "worn.nc") as worn:
        worn.rename(cycle="mission").to_netcdf(folder / "missions.nc")
    small.write_depths(folder / "ended.nc", 150.0, [0.0, 1000.0], 1, counts=[0.0, 1234.5])
    (folder / "part.nc").write_bytes((folder / "worn.nc").read_bytes()[:1000])
    for number, content in enumerate(NO_TOML):
        (folder / f"{number}.toml").write_bytes(content)
    (folder / "s.toml").write_text(small.SLIDER)
    return folder


@pytest.fixture
def refuses(files, capsys, monkeypatch):
    """Runs a command that does nothing but to say lines, which begin with these words."""
    # on a busy machine it says what it does as well
    monkeypatch.setattr(progress, "_SECONDS_WITHOUT_A_WORD", np.inf)

    def run(arguments, *begins):
        with contextlib.chdir(files):
            before = {path: path.stat().st_mtime_ns for path in Path().iterdir()}
            assert main(arguments) == 2
            assert {path: path.stat().st_mtime_ns for path in Path().iterdir()} == before
        said = capsys.readouterr()
        assert said.out == ""
        lines = said.err.splitlines()
        assert len(lines) == len(begins), said.err
        for line, begin in zip(lines, begins, strict=True):
            # the value as TOML has it, and what would be right
            assert re.fullmatch(rf"run-study: {re.escape(begin)}( = .+?)?: .+", line), line
            assert line.isprintable()
            assert "datetime" not in line

    return run


@pytest.mark.parametrize(("study", "overrides", "keys"), list(rows()))
def test_each_mistake_is_a_line_and_nothing_is_computed(study, overrides, keys, files, refuses):
    name = study if "\n" not in study else "s.toml"
    if name != study:
        (files / name).write_text(study, encoding="utf-8")
    begins = [key if ": " in key else f"{name}: {key}" for key in keys]
    refuses([name, "--plan", *options(*overrides)], *begins)


@pytest.mark.parametrize(("command", "begin"), COMMANDS)
def test_commands_that_cannot_be_right(command, begin, files, refuses):
    (files / "s.toml").write_text(small.SLIDER, encoding="utf-8")
    refuses(command.split(), begin)


def test_write_protected_output(files, refuses, monkeypatch):
    (files / "s.toml").write_text(small.SLIDER, encoding="utf-8")
    monkeypatch.setattr(os, "access", lambda *_: False)
    refuses(["s.toml", "-o", "worn.nc", "--overwrite"], "command line: -o")


@pytest.mark.parametrize(
    ("given", "number"),
    [
        ("scatter.limits.wear_depth = '5 \N{MICRO SIGN}m'", "5e-06"),
        ("slow_time.until={wear_depth = '5um'}", "5e-06"),
        ("axes.excitation_amplitude=['5 kN']", "5000"),
        ("axes.wear_coefficient='2e-7 1/MPa'", "2e-13"),
        ("axes.wear_coefficient='2e-4 mm3/(N m)'", "2e-13"),
    ],
)
def test_a_number_with_a_unit_is_said_in_si(given, number, capsys):
    key, _, value = given.partition("=")
    assert main(["sdof_slider", "--plan", "--set", f"{key.strip()}={value.strip()}"]) == 2
    assert f"give {number}, the number in SI" in capsys.readouterr().err


def test_a_list_that_is_cut_says_that_there_are_more_and_no_remedy_is_said_twice(capsys):
    assert listing(range(12)).endswith("10, 11")
    assert listing(range(13)).endswith("10, 11, ...")
    scatter = "scatter={samples = 8, friction_coefficient = {lognormal = {factor = 0.5}}}"
    assert main(["sdof_slider", "--plan", "--set", scatter]) == 2
    assert capsys.readouterr().err.count("1 or more") == 1

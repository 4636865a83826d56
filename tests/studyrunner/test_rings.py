"""Studies of all sectors of a ring: what they read, that sectors are told apart, and what comes out."""

import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from studies.scene_file import write_scene
from studyrunner import open_result
from studyrunner.cli import main
from studyrunner.kinds.estimate import iterations_of_sweep, seconds_of
from studyrunner.kinds.wear.kind import WEAR
from studyrunner.plan import build_tasks
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import Drawing
from studyrunner.result.view import open_for_report
from studyrunner.scatter import ScatterSection, draw
from studyrunner.scene.scene import build_study_scene, describe_study_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import format_study, read_study
from studyrunner.worn_joint import compute_worn_joint
from tests.mpi.launching import options, results, run_to_end
from tests.rings import N, one_sector
from tests.studyrunner.small_studies import UNWORN, compute, same_values

pytestmark = pytest.mark.usefixtures("folder")
RING = """
[study]
name = "r"
[scene]
model = "ring.h5"
friction_coefficient = 0.3
sectors = "all"
[axes]
frequency = 280.0
excitation_amplitude = 3.3
wear_coefficient = 1e-10
[slow_time]
cycles = 100
outputs = 3
[solver]
rtol = 0.05
"""
FILE = 'scene.sectors={file="blades.csv"}'
DOVETAIL = """
[study]
name = "d"
[scene]
model = "dovetail_sector"
mesh = 1
n_sectors = 12
[axes]
frequency_ratio = 0.999
excitation_amplitude = 0.02
[slow_time]
cycles = 0
[solver]
harmonics = 1
samples = 64
"""
PATTERN = np.array([0.02, -0.013, 0.0, 0.007, -0.018, 0.011])


def blades(*columns, header="sector,frequency", sectors=range(N)):
    """A file `blades.csv` with these columns beside the sectors."""
    rows = [",".join(f"{value:.9g}" for value in row) for row in zip(sectors, *columns, strict=True)]
    return "\n".join([header, *rows]) + "\n"


@pytest.fixture
def ring(folder):
    (folder / "ring.toml").write_text(RING)
    (folder / "blades.csv").write_text(blades(PATTERN))
    write_scene(one_sector(1), "ring.h5")
    return "ring.toml"


def read(*overrides):
    return read_study("ring.toml", [*overrides])


# --- what is read ---


def test_columns_are_read_in_any_order_and_unit(folder, ring):
    order = [3, 0, 5, 1, 2, 4]
    columns = PATTERN[order] * 100.0, np.linspace(0.1, 0.6, N)[order], np.arange(float(N))[order]
    header = "sector,frequency_percent,friction,wear_depth_um"
    (folder / "blades.csv").write_text(blades(*columns, header=header, sectors=order))
    text = RING.replace("friction_coefficient = 0.3\n", "").replace('"all"', '{file = "blades.csv"}')
    (folder / "ring.toml").write_text(text)
    study = read()
    sectors = study.scene.ring
    np.testing.assert_allclose(sectors.frequency, PATTERN, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(sectors.friction, np.linspace(0.1, 0.6, N), rtol=1e-8)
    np.testing.assert_allclose(sectors.wear_depth, 1e-6 * np.arange(N), rtol=1e-12)
    assert "blades.csv" in {path.name for path in study.files}
    # as a result has it the study needs the file no longer
    (folder / "again.toml").write_text(format_study(study))
    (folder / "blades.csv").unlink()
    assert read_study("again.toml").scene == study.scene


def test_files_of_spreadsheets_and_of_numpy(folder, ring):
    table = blades(100.0 * PATTERN, header="sector,frequency [%]")
    for text in (table, table.replace(",", ";").replace(".", ","), f"# wheel 3\n# {table}\n", f"\ufeff{table}"):
        (folder / "blades.csv").write_text(text, encoding="utf-8")
        np.testing.assert_allclose(read(FILE).scene.ring.frequency, PATTERN, rtol=1e-12)
    more = FILE.replace("}", ", friction=[0.1, 0.2, 0.3, 0.4, 0.5, 0.6]}")
    (folder / "ring.toml").write_text(RING.replace("friction_coefficient = 0.3\n", ""))
    assert read(more).scene.ring.friction[5] == 0.6
    assert read(more).scene.ring.frequency == read(FILE).scene.ring.frequency


BAD_FILES = {
    "sector 4 is missing": (blades(PATTERN[:5], sectors=[0, 1, 2, 3, 5]), "blades.csv: column sector"),
    "given twice": (blades(PATTERN, sectors=[0, 1, 2, 2, 4, 5]), "column sector, row 5 = 2"),
    "no whole number": (blades(PATTERN, sectors=[0, 1, 2.5, 3, 4, 5]), "column sector, row 4 = 2.5"),
    "a sector too many": (blades([0.0] * 7, sectors=range(7)), "blades.csv: column sector = 7 sectors"),
    "a sector too few": (blades([0.0] * 5, sectors=range(5)), "blades.csv: column sector = 5 sectors"),
    "too far": (
        blades([0.0, 0.21, 0.0, 0.0, 0.0, 0.0]),
        'column frequency, row 3 = "0.21": give a number of -0.2 to 0.2',
    ),
    "too far in percent": (
        blades([0.0, -21, 0.0, 0.0, 0.0, 0.0], header="sector,frequency [%]"),
        'column frequency_percent, row 3 = "-21": give a number of -20 to 20',
    ),
    "decimal commas": ("sector,frequency\n0,0,01\n", 'blades.csv: row 2 = "0,0,01": give 2 values'),
    "no number": (blades([0.0, np.nan, 0.0, 0.0, 0.0, 0.0]), "column frequency, row 3"),
    "negative friction": (blades([-0.1] * 6, header="sector,friction"), 'column friction, row 2 = "-0.1"'),
    "unknown column": (blades(PATTERN, header="sector,freqency"), "column freqency"),
    "unknown unit": (blades(PATTERN, header="sector,wear_depth_inch"), "column wear_depth_inch"),
    "a column twice": (blades(PATTERN, PATTERN, header="sector,frequency,frequency"), "column frequency: given twice"),
    "no sectors": (blades(PATTERN, header="blade,frequency"), 'line 1 = "blade,frequency": give a first line'),
    "no result": ("sector,result\n0,\n1,none.nc\n", 'column result, row 3 = "none.nc": give the path of a result'),
    "nothing beside": ("sector\n0\n1\n", "blades.csv: line 1"),
    "empty": ("", "blades.csv: line 1"),
}


def refused(capsys, *overrides):
    """The only line on a study that is refused."""
    assert main(["ring.toml", "--plan", *options(*overrides)]) == 2
    printed, said = capsys.readouterr()
    (line,) = [line for line in said.splitlines() if not line.startswith("[")]
    assert not printed
    return line


@pytest.mark.parametrize("case", BAD_FILES)
def test_a_wrong_file_is_named_with_column_and_row(folder, ring, capsys, case):
    text, words = BAD_FILES[case]
    (folder / "blades.csv").write_text(text)
    assert words in refused(capsys, FILE)


def test_a_sector_begins_with_the_wear_of_a_result(folder, ring, capsys, monkeypatch):
    monkeypatch.setattr(
        "studyrunner.study.sectors.read_worn",
        lambda table, *_: SimpleNamespace(depth=(tuple(1e-6 * np.arange(1.0, 1.0 + int(table["result"][0]))),)),
    )
    rows = ["0,0,", "2,1,1.nc", "1,0.5,", "3,0,1.nc", "4,0,", "5,0,"]
    head = "sector,wear_depth_um,result\n"
    (folder / "blades.csv").write_text(head + "\n".join(rows))
    np.testing.assert_allclose(read(FILE).scene.ring.wear_depth, [0.0, 5e-7, 2e-6, 1e-6, 0.0, 0.0])
    (folder / "blades.csv").write_text(head + "\n".join(rows).replace("1.nc", "2.nc"))
    wanted = np.array([[0.0, 0.0], [5e-7, 5e-7], [2e-6, 3e-6], [1e-6, 2e-6], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_allclose(read(FILE).scene.ring.wear_depth, wanted.ravel())
    assert "column result = 2 pairs: give results of one sector, which has 1 pair" in refused(capsys, FILE)
    (folder / "blades.csv").write_text(head + "\n".join(rows).replace("1.nc", "2.nc", 1))
    assert "row 5" in (said := refused(capsys, FILE))
    assert "the first one has 2 pairs, this one 1" in said


DRAWN = "scatter={samples=4, sector_frequency={normal={std=0.01}}}"
BAD_KEYS = {
    'scene.sectors={file="none.csv"}': "scene.sectors.file",
    "scene.sectors=some": "scene.sectors",
    "scene.sectors={frequency=[0.3, 0, 0, 0, 0, 0]}": "scene.sectors.frequency = 0.3",
    'scene.sectors={file="blades.csv", frequency=[0.1]}': "scene.sectors.frequency: given twice: leave it out",
    "scene.sectors={frequency=[0.1]}": "scene.sectors.frequency = 1 sector: give each of the 6 sectors",
    "scene.forced_sector=2": "scene.forced_sector = 2: give a scene of nodal diameter 0",
    "scene.sectors={friction=[0.3, 0.3, 0.3, 0.3, 0.3, 0.3]}": "scene.friction_coefficient = 0.3: leave it out",
    "scene.worn={depth=[1e-6, 1e-6]}": "scene.worn.depth: there are 2 depths: give one depth for each pair: the scene"
    " has 6 contact pairs",
    "scatter={samples=4, sector_frequency={normal={std=0.2}}}": "scatter.sector_frequency: give less width",
    "scatter={samples=4, sector_frequency={normal={std=0.01}, of='each pair'}}": "scatter.sector_frequency.of",
    "axes.sectors=all": "axes.sectors",
}


@pytest.mark.parametrize("override", BAD_KEYS)
def test_a_wrong_key_is_said_in_a_line(ring, capsys, override):
    assert BAD_KEYS[override] in refused(capsys, override)


def test_one_sector_has_no_keys_of_a_ring(folder, ring, capsys):
    (folder / "ring.toml").write_text(RING.replace('sectors = "all"\n', ""))
    assert 'scene.forced_sector = 2: give scene.sectors = "all"' in refused(capsys, "scene.forced_sector=2")
    assert 'scatter.sector_frequency: give scene.sectors = "all"' in refused(capsys, DRAWN)
    friction = "scatter={samples=4, friction_coefficient={normal={std=0.01}, of='each sector'}}"
    assert 'scatter.friction_coefficient: give scene.sectors = "all"' in refused(capsys, friction)


def test_scenes_that_are_no_ring_are_said_so(folder, ring, capsys):
    whole = one_sector(0)
    assert "scene.forced_sector = 6: give 0 to 5" in forced_beyond(whole, capsys)
    write_scene(replace(whole, linear={0: whole.linear[0]}), "ring.h5")
    assert "no nodal diameters 1, 2, 3; give the scene file the groups nd/0 to nd/3".replace(";", ":") in refused(
        capsys
    )
    write_scene(replace(whole, linear={0: whole.linear[0]}, n_sectors=0), "ring.h5")
    assert "the scene is no cyclic sector" in refused(capsys)
    write_scene(replace(whole, linear={k: replace(each, blade=None) for k, each in whole.linear.items()}), "ring.h5")
    assert main([ring, "--plan"]) == 0
    capsys.readouterr()
    for override in (FILE, DRAWN):
        assert "give the dataset blade in each group nd/<k>" in refused(capsys, override)
    (folder / "ring.toml").write_text(RING.replace('"ring.h5"', '"sdof_slider"'))
    assert 'scene.sectors = "all": leave it out: sdof_slider is no sector' in refused(capsys)
    dovetail = RING.replace('"ring.h5"', '"dovetail_sector"\nmesh = 1\nn_sectors = 12\nnodal_diameter = 7')
    (folder / "ring.toml").write_text(dovetail)
    assert "scene.nodal_diameter = 7: use at most n_sectors // 2 = 6" in refused(capsys)


def forced_beyond(model, capsys):
    write_scene(model, "ring.h5")
    return refused(capsys, "scene.forced_sector=6")


# --- what is made of it ---


def test_friction_and_wear_of_sectors_that_are_hardly_meant_are_asked_for(folder, ring, capsys):
    (folder / "blades.csv").write_text(blades([30.0] * N, [20.0] * N, header="sector,friction,wear_depth_mm"))
    (folder / "ring.toml").write_text(RING.replace("friction_coefficient = 0.3\n", ""))
    assert main([ring, "--plan", *options(FILE)]) == 0
    said = "".join(capsys.readouterr())
    assert "scene.worn 0.02 m" in said
    assert "friction_coefficient 30" in said


def test_rings_share_the_model_of_a_sector(ring):
    study = read(FILE, DRAWN)
    scenes = find_scenes(study)
    (alone,) = scenes.studies
    facts = describe_study_scene(alone, build_study_scene(alone))
    assert (facts.n_ring, facts.contact.n_contact, facts.n_displacements) == (N, N, 2 * N)
    assert facts.response_names == tuple(f"tip {sector}" for sector in range(N))
    plan = build_tasks(study, scenes, [facts])
    drawn = [dict(task.joint.contact)["sector_frequency"] for task in plan.sweeps]
    assert len(set(drawn)) == 4
    assert np.std(drawn - PATTERN) == pytest.approx(0.01, rel=0.5)
    # a task of a ring takes as long as those of its sectors
    one = read()
    (sweep,) = build_tasks(one, find_scenes(one), [facts]).sweeps
    assert sweep.cost == pytest.approx(N * seconds_of(sweep.n_unknowns // N, iterations_of_sweep("up", 1)))


def test_a_draw_of_each_sector_is_that_of_its_pairs():
    pairs = SimpleNamespace(surface=("shroud",) * 6)
    gap = {"normal": {"std": 1e-6}, "of": "each sector"}
    section = ScatterSection.model_validate(
        {"samples": 4, "gap": gap, "sector_frequency": {"uniform": {"half_width": 0.1}}}
    )
    found = draw(section, {"gap": np.zeros(6), "sector_frequency": np.array([0.0, 0.05, 0.1])}, pairs, n_sectors=3)
    gaps = found["gap"].reshape(4, 3, 2)
    assert (np.ptp(gaps, axis=2) == 0.0).all()
    assert len(np.unique(gaps)) == 12
    assert found["sector_frequency"].shape == (4, 3)
    assert (np.abs(found["sector_frequency"] - [0.0, 0.05, 0.1]) <= 0.1).all()


def test_the_identity_of_one_sector_knows_nothing_of_rings(ring, folder):
    """Friction that is given for each sector, wear of each sector and the deviations are all in the joint of a task."""
    columns = PATTERN, np.linspace(0.1, 0.6, N), np.arange(float(N))
    (folder / "blades.csv").write_text(blades(*columns, header="sector,frequency,friction,wear_depth_um"))
    text = RING.replace("friction_coefficient = 0.3\n", "").replace('"all"', '{file = "blades.csv"}')
    for name, content in (("ring", text), ("one", RING.replace('sectors = "all"\n', ""))):
        (folder / f"{name}.toml").write_text(content)
        study = read_study(f"{name}.toml")
        scenes = find_scenes(study)
        facts = describe_study_scene(study, build_study_scene(study))
        (sweep,) = build_tasks(study, scenes, [facts]).sweeps
        if name == "one":
            assert (sweep.joint.contact, sweep.joint.friction_coefficient, sweep.joint.n_sectors) == ((), 0.3, 1)
            assert "sectors" not in study.scene.of_model
            continue
        found = dict(sweep.joint.contact)
        assert sweep.joint.friction_coefficient is None
        np.testing.assert_allclose(found["friction_coefficient"], columns[1])
        np.testing.assert_allclose(found["gap"], np.arange(N) * 1e-6 + facts.contact.gap)
        model = sweep.joint.model({0: build_study_scene(study)})
        np.testing.assert_allclose(model.contact.friction, columns[1])


# --- what comes out ---


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """The folder of results: of equal sectors, of one, of a pattern, and of the pattern turned by two sectors."""
    folder = tmp_path_factory.mktemp("rings")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_scene(one_sector(1), "ring.h5")
        Path("ring.toml").write_text(RING)
        Path("one.toml").write_text(RING.replace('sectors = "all"\n', ""))
        Path("blades.csv").write_text(blades(PATTERN))
        Path("turned.csv").write_text(blades(np.roll(PATTERN, 2)))
        compute("ring.toml", "equal.nc")
        compute("one.toml", "one.nc")
        compute("ring.toml", "pattern.nc", FILE)
        compute("ring.toml", "turned.nc", FILE.replace("blades", "turned"))
    return folder


def opened(folder, *names):
    return [results(folder / f"{name}.nc").squeeze(drop=True) for name in names]


@pytest.mark.slow
def test_equal_sectors_are_one(computed):
    one, ring = opened(computed, "one", "equal")
    assert ring.worn_volume[-1] == pytest.approx(N * one.worn_volume[-1].item(), rel=2e-4)
    np.testing.assert_allclose(ring.sector_worn_volume[-1], one.worn_volume[-1].item(), rtol=1e-3)
    np.testing.assert_allclose(ring.sector_wear_depth[-1], one.wear_depth_max[-1].item(), rtol=1e-3)
    np.testing.assert_allclose(ring.sector_amplitude, np.tile(one.response_amplitude.values[:, None], N), rtol=1e-4)
    np.testing.assert_allclose(ring.sector_phase, np.tile(one.response_phase.values[:, None], N), atol=1e-4)
    np.testing.assert_allclose(ring.amplitude_magnification, 1.0, rtol=1e-4)
    np.testing.assert_array_equal(ring.contact_sector, np.arange(N))
    assert not ring.sector_frequency.any()
    assert "sector" not in one.dims
    assert {*ring.data_vars} - {*one.data_vars} == {*WEAR.of_rings}
    findings = open_result(computed / "equal.nc").fretwear.summary().findings
    (finding,) = [each for each in findings if each.name == "ring"]
    assert finding.text.startswith("all sectors wear alike, ")
    assert finding.text.count("all sectors vibrate alike") == 1


@pytest.mark.slow
def test_the_result_turns_with_the_pattern(computed):
    pattern, turned = opened(computed, "pattern", "turned")
    np.testing.assert_allclose(pattern.sector_frequency, PATTERN)
    for name, least in (("sector_amplitude", 0.01), ("sector_wear_depth", 0.2)):
        assert np.ptp(pattern[name].values[-1]) > least * pattern[name].values[-1].max()
    for name, rtol in (("sector_amplitude", 1e-5), ("sector_wear_depth", 1e-3), ("sector_worn_volume", 1e-3)):
        wanted, found = np.roll(pattern[name], 2, axis=1), turned[name].values
        np.testing.assert_allclose(found, wanted, rtol=rtol, atol=rtol * wanted.max())
    np.testing.assert_allclose(pattern.sector_worn_volume.sum("sector"), pattern.worn_volume, rtol=1e-12)
    np.testing.assert_allclose(pattern.sector_amplitude, pattern.response_amplitude)
    said = open_result(computed / "pattern.nc").fretwear.summary()
    (finding,) = [each for each in said.findings if each.name == "ring"]
    assert finding.values["wears_most"] == int(pattern.sector_worn_volume.values[-1].argmax())
    assert finding.values["vibrates_most_new"] == int(pattern.sector_amplitude.values[0].argmax())


@pytest.mark.slow
def test_results_know_their_sectors_and_begin_others(computed, monkeypatch):
    monkeypatch.chdir(computed)
    Path("turned.csv").write_text(blades(PATTERN))  # a result has the numbers that it was computed with
    np.testing.assert_allclose(read_study("turned.nc").scene.ring.frequency, np.roll(PATTERN, 2), atol=1e-12)
    names = ["one.nc" if sector in (1, 4) else "" for sector in range(N)]
    Path("worn.csv").write_text("sector,result\n" + "".join(f"{s},{name}\n" for s, name in enumerate(names)))
    depth = opened(computed, "one")[0].wear_depth_max[-1].item()
    overrides = (*UNWORN, FILE.replace("blades", "worn"))
    assert read(*overrides).scene.ring.wear_depth == pytest.approx([depth if name else 0.0 for name in names])
    found = compute("ring.toml", "goes_on.nc", *overrides).squeeze(drop=True)
    assert found.sector_amplitude.std() > 1e-3 * found.sector_amplitude.mean()


@pytest.mark.slow
def test_a_worn_ring_is_computed_again(computed, tmp_path):
    found = compute_worn_joint(computed / "pattern.nc", tmp_path, loops=[3], progress=False)
    assert found["loops"].sizes["contact"] == 1
    assert np.isfinite(found["loops"].loop_force).any()


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks_and_a_run_that_goes_on_give_the_same(computed, tmp_path):
    """A ring is made anew from its sector on each rank."""
    folder = shutil.copytree(computed, tmp_path / "again")
    command = ["-m", "studyrunner.cli", "ring.toml", *options(FILE)]
    both = options("axes.frequency=[276, 280]")
    assert run_to_end(2, [*command, *both, "-o", "ranks.nc"], folder).status == 0
    ended = run_to_end(0, [*command, *both, "-o", "pattern.nc"], folder)
    assert ended.status == 0
    assert "from an earlier run: 1 of 2 points" in ended.said
    same_values(results(folder / "ranks.nc"), results(folder / "pattern.nc"))


@pytest.mark.slow
def test_samples_of_a_ring_and_the_report(computed, monkeypatch):
    monkeypatch.chdir(computed)
    overrides = (*UNWORN, "axes.frequency=[276, 280]", "scatter={samples=4, sector_frequency={normal={std=0.01}}}")
    result = compute("ring.toml", "samples.nc", *overrides)
    assert result.sample_sector_frequency.dims == ("sample", "sector")
    factors = result.amplitude_magnification.squeeze().values
    assert (factors > 1.001).all()
    assert len(np.unique(factors)) == 8
    for path, wanted in (("samples", {"magnification"}), ("pattern", {"sectors"})):
        shown = open_for_report(f"{path}.nc")
        with shown.dataset:
            drawn = {item.name: item for item in draw_report(shown)}
        assert wanted <= {name for name, item in drawn.items() if isinstance(item, Drawing)}


@pytest.mark.slow
def test_missions_have_the_wear_and_vibration_of_each_sector(ring, folder):
    text = RING.replace("frequency = 280.0\n", "").replace("cycles = 100\noutputs = 3", "missions = 1")
    text += 'harmonics = 1\nsamples = 64\n[[mission]]\nname = "dwell"\nfrequency = 280.0\ncycles = 10\n'
    (folder / "ring.toml").write_text(text)
    found = compute("ring.toml", "ring.nc", FILE).squeeze(drop=True)
    assert found.sector_amplitude.dims == ("mission", "sector")
    np.testing.assert_allclose(found.sector_amplitude, found.response_amplitude)
    np.testing.assert_allclose(found.sector_worn_volume.sum("sector"), found.worn_volume, rtol=1e-12)
    assert (found.sector_worn_volume[-1] > 0.0).all()


@pytest.mark.slow
def test_a_mode_of_equal_sectors_is_that_of_one(folder):
    write_scene(one_sector(0), "ring.h5")
    table, axes = RING[: RING.index("frequency")], "modal_amplitude = {}\n"
    (folder / "ring.toml").write_text(table + axes.format(6e-5 * np.sqrt(N)))
    (folder / "one.toml").write_text(table.replace('sectors = "all"\n', "") + axes.format(6e-5))
    ring, one = (compute(f"{name}.toml", f"{name}.nc").squeeze(drop=True) for name in ("ring", "one"))
    np.testing.assert_allclose(ring.natural_frequency, one.natural_frequency, rtol=1e-9)
    np.testing.assert_allclose(ring.sector_amplitude, one.response_amplitude.item(), rtol=1e-6)


@pytest.mark.slow
def test_a_mirrored_pattern_has_the_mirrored_result(folder):
    """The dovetail is symmetric, and at nodal diameter 0 no wave turns."""
    pattern = np.random.default_rng(0).uniform(-0.005, 0.005, 12)
    mirror = -np.arange(12) % 12
    (folder / "dovetail.toml").write_text(DOVETAIL)
    found = []
    for name, own in (("right", pattern), ("left", pattern[mirror])):
        (folder / f"{name}.csv").write_text(blades(own, sectors=range(12)))
        found.append(compute("dovetail.toml", f"{name}.nc", f'scene.sectors={{file="{name}.csv"}}').squeeze(drop=True))
    right, left = (each.sector_amplitude.values for each in found)
    assert np.ptp(right) > 0.01 * right.max()
    np.testing.assert_allclose(left, right[mirror], rtol=1e-5)

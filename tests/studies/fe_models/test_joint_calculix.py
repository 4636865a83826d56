"""Glued frequencies of whole models against CalculiX, which reads the same meshes. Needs its command `ccx`."""

from dataclasses import replace

import numpy as np
import pytest

from studies.fe_models.files import UNITS
from studies.fe_models.from_files.check import describe_model
from studies.fe_models.from_files.imported import order_by_nodes
from studies.fe_models.from_files.model import find_files, load_model, reduce_model
from studies.fe_models.from_files.parameters import Parameters
from studies.fe_models.matrices.read import read_matrices
from studies.finite_element.reduced_joint import build_fe_scene, prepare_model
from studies.finite_element.solid_mesh import Rotation
from studies.finite_element.structure import FeModel, ReductionOptions
from tests.studies.fe_models.decks import listed_frequencies
from tests.studies.fe_models.sectors import N_SECTORS, OMEGA_SQUARED, Sector, Z, stubby
from tests.studies.fe_models.solid_meshes import EXPORT, centrifugal, deck_lines, needs_ccx, node_set, run_ccx

pytestmark = needs_ccx

N_MODES = 4


def cyclic_lines(mesh, held, left, right):
    """A sector whose cut faces belong together, with nodes that are held; all by the rows of their nodes."""
    sets = {"F": np.setdiff1d(held, left), "L": left, "R": right}
    return [
        *[*deck_lines(mesh), *(line for name, rows in sets.items() for line in node_set(name, mesh.numbers[rows]))],
        *["*SURFACE, NAME=LS, TYPE=NODE", "L", "*SURFACE, NAME=RS, TYPE=NODE", "R"],
        *["*TIE, CYCLIC SYMMETRY, NAME=CYC, POSITION TOLERANCE=1.E-5", "LS, RS"],
        *[f"*CYCLIC SYMMETRY MODEL, N={N_SECTORS}, NGRAPH=1, TIE=CYC", "0., 0., 0., 0., 0., 1."],
        *["*BOUNDARY", "F, 1, 3"],
    ]


def sector_lines(sector):
    """The sector with its root tied, the blade the dependent side, and the bore held."""
    cut = sector.joint().cut
    lines = cyclic_lines(sector.mesh, sector.bore, cut.left, cut.right)
    for name, faces in (("BLADES", sector.blade_faces), ("DISKS", sector.disk_faces)):
        lines += [f"*SURFACE, NAME={name}", *(f"{e}, S{f}" for e, f in zip(*faces, strict=True))]
    return [*lines, "*TIE, NAME=GLUE, POSITION TOLERANCE=1.E-5", "BLADES, DISKS"]


def calculix_frequencies(folder, lines, nodal_diameters, step="*STEP"):
    """Natural frequencies (n, N_MODES), Hz, that CalculiX finds at each nodal diameter.

    CalculiX finds each twice, as the real and the imaginary part of a rotating wave, nodal diameter 0 included.
    """
    found = []
    for k in nodal_diameters:
        select = f"*SELECT CYCLIC SYMMETRY MODES, NMIN={k}, NMAX={k}"
        job = run_ccx(folder, [*lines, step, "*FREQUENCY", str(3 * N_MODES), select, "*END STEP"], f"nd{k}")
        values = np.sort(listed_frequencies(job))
        found.append(values[np.append(True, np.diff(values) > 1e-5 * values[1:])][:N_MODES])
    return np.array(found)


@pytest.mark.slow
def test_meshes_that_do_not_match(tmp_path):
    sector = Sector("C3D20R", "C3D20R", (2, 6, 4), (3, 4, 5))
    prepared = prepare_model(sector.model(prestress=False), sector.joint())
    assert not np.isclose(prepared.pairs.opposite.data, 1.0).all()
    expected = calculix_frequencies(tmp_path, sector_lines(sector), (0, 2))
    own = np.array([prepared.frequencies(k, N_MODES) for k in (0, 2)])
    assert np.abs(own / expected - 1.0).max() < 1e-3


@pytest.mark.parametrize("kind", ["C3D8", "C3D20R"])
def test_matrices_of_calculix(kind, tmp_path):
    """Prestress and spin softening come in the matrices, and frequencies agree with those that CalculiX finds."""
    sector = Sector(kind, kind, (1, 4, 2), (2, 2, 2))
    lines = [*sector_lines(sector), "*STEP", "*STATIC", *centrifugal(sector.mesh, OMEGA_SQUARED), "*END STEP"]
    run_ccx(tmp_path, [*lines, "*STEP, PERTURBATION", "*BOUNDARY, OP=NEW", *EXPORT])
    rotation = Rotation(OMEGA_SQUARED, np.zeros(3), Z)
    given = read_matrices(tmp_path / "job")
    ordered = order_by_nodes(given, UNITS["SI"], sector.mesh)
    assert not ordered.missing.any()
    model = FeModel(ordered.mesh, rotation, forms=ordered.forms)
    scene = build_fe_scene(model, sector.joint(), ReductionOptions(nodal_diameter=3, n_modes=N_MODES), 2)
    expected = calculix_frequencies(tmp_path, lines, (0, 3, 6), "*STEP, PERTURBATION")
    own = np.array([scene.glued_frequencies[k] for k in (0, 3, 6)])
    assert np.abs(own / expected - 1.0).max() < 2e-5


def test_a_deck_whose_shrouds_touch_the_next_sector(tmp_path):
    """The same matrices as the bundled scene; its shrouds, one sector apart, are no cut faces. The order of the names
    does not matter.
    """
    model, joint = stubby(N_SECTORS).define_sector()
    (contact,), lines = joint.contacts, deck_lines(model.mesh)
    sets = {"BORE": np.flatnonzero(joint.held[:, 0]), "LEAD": contact.first.nodes, "TRAIL": contact.second.nodes}
    for name, rows in sets.items():
        lines += node_set(name, model.mesh.numbers[rows])
    (tmp_path / "s.inp").write_text("\n".join(lines) + "\n", encoding="ascii")
    given = {"units": "SI", "friction_coefficient": 0.3, "n_sectors": 12, "axis": {"direction": [0, 0, 1]}}
    given |= {"clamp": ["BORE"], "load": {"set": "LEAD", "direction": [0, 1, 0]}}
    expected = [prepare_model(model, joint).frequencies(k, N_MODES) for k in (0, 3, 6)]
    for change in ({"contact": [["LEAD", "TRAIL"]]}, {"contact": [["TRAIL", "LEAD"]]}):
        parameters = Parameters(**given, **change, next_sector=True)
        loaded = load_model(find_files(tmp_path, "s.inp", parameters), parameters)
        assert sorted(loaded.joint.cut.left) == sorted(joint.cut.left)
        prepared = prepare_model(loaded.model, loaded.joint)
        found = [prepared.frequencies(k, N_MODES) for k in (0, 3, 6)]
        np.testing.assert_allclose(found, expected, rtol=1e-7)
    rows = dict(describe_model(loaded, reduce_model(loaded, 1)))
    assert "8 nodes of TRAIL on LEAD of the sector before" in rows["contact"]


def test_stuck_shrouds_are_those_of_calculix(tmp_path):
    """With elements that are the same in both programs: incompatible modes of twisted elements are not."""
    model, joint = stubby(N_SECTORS).define_sector()
    groups = tuple(replace(each, kind="C3D8") for each in model.mesh.groups)
    model = replace(model, mesh=replace(model.mesh, groups=groups))
    (contact,) = joint.contacts
    left = np.concatenate([joint.cut.left, contact.second.nodes])
    right = np.concatenate([joint.cut.right, contact.first.nodes])
    prepared, diameters = prepare_model(model, joint), (0, 1, 3, 5, 6)
    own = [prepared.frequencies(k, N_MODES) for k in diameters]
    lines = cyclic_lines(model.mesh, np.flatnonzero(joint.held[:, 0]), left, right)
    np.testing.assert_allclose(own, calculix_frequencies(tmp_path, lines, diameters), rtol=2e-4)

"""Linear constraints and directions of a deck: against CalculiX, and against other ways to say the same."""

import re
import shutil

import numpy as np
import pytest

from studies.fe_models.from_files.check import total_force
from studies.scene_error import SceneError
from tests.studies.fe_models.decks import BLOCKS, SECTORS, frequencies, of_calculix, prepared_deck, run_tied
from tests.studies.fe_models.solid_meshes import needs_ccx

REFERENCE = "*NODE\n900, 45., 5., 0.\n"
LINE, END = (f"{REFERENCE}*RIGID BODY, NSET={name}, REF NODE=900" for name in ("XM", "XE"))
COUPLING = f"{REFERENCE}*COUPLING, REF NODE=900, SURFACE=SE, CONSTRAINT NAME=C\n*KINEMATIC\n"
CYLINDRICAL = "*TRANSFORM, NSET=XM, TYPE=C\n-20., -30., 0., -20., -30., 1.\n"
STATIC = "*STEP\n*STATIC\n*DLOAD\nEALL1, CENTRIF, 1e7, -100., 0., 0., 0., 0., 1.\n*END STEP\n"
BOTH_READ = {
    "equations that depend on each other": "*EQUATION\n2\n5,3,1.,15,3,1.\n*EQUATION\n3\n15,3,1.,10,3,-.5,3,3,.25\n"
    "2\n5,2,1.,3,2,1.\n",
    "rigid line": f"{LINE}\n",
    "rigid end with nodes in contact": f"{END}\n",
    "rigid elements": f"{REFERENCE}*ELSET, ELSET=RB\n4\n*RIGID BODY, ELSET=RB, REF NODE=900\n",
    "rigid body that cannot turn about two axes": f"*NODE\n901, 45, 5, 0\n{END}, ROT NODE=901\n"
    "*BOUNDARY\n901, 1, 2\n900, 3\n",
    "two rigid lines in one equation": f"{LINE}\n*NODE\n901, 3, 5, 9\n*NSET, NSET=X2\n116, 121, 126\n"
    "*RIGID BODY, NSET=X2, REF NODE=901\n*EQUATION\n2\n900,3,1.,901,3,-1.\n",
    "coupling": f"{COUPLING}1, 3\n",
    "coupling of some dofs": f"{COUPLING}1\n3\n",
    "rectangular directions": "*TRANSFORM, NSET=XM, TYPE=R\n1., 1., 0.3, -1., 1., 0.\n*BOUNDARY\nXM, 1\n",
    "cylindrical directions": "*TRANSFORM, NSET=XM, TYPE=C\n-20., -30., 0., -19., -30., 4.\n*BOUNDARY\nXM, 1, 2\n",
    "directions of nodes in contact": f"*NSET, NSET=XO\n20,25,30\n{CYLINDRICAL.replace('XM', 'XO')}*BOUNDARY\nXO, 1\n",
    "equations along such directions": f"{CYLINDRICAL}*EQUATION\n2\n5,1,1.,10,1,-1.\n3\n15,2,1.,10,2,-1.,3,1,0.5\n",
}


@needs_ccx
@pytest.mark.parametrize("name", BOTH_READ)
def test_as_calculix(name, tmp_path):
    text = BLOCKS + BOTH_READ[name]
    np.testing.assert_allclose(frequencies(tmp_path, text), of_calculix(tmp_path, text), rtol=1e-6)


@needs_ccx
def test_prestress_of_a_constrained_structure_as_calculix(tmp_path):
    text = BLOCKS + BOTH_READ["rigid line"] + STATIC
    expected = of_calculix(tmp_path, text, "*STEP, PERTURBATION\n*FREQUENCY\n4\n*END STEP\n")
    np.testing.assert_allclose(frequencies(tmp_path, text), expected, rtol=1e-6)


@needs_ccx
@pytest.mark.parametrize("name", ["rigid end with nodes in contact", "cylindrical directions"])
def test_constraints_on_matrices_of_calculix(name, tmp_path):
    """They are written without constraints, which the deck still has."""
    text = BLOCKS + BOTH_READ[name]
    removed = "*STEP\n*BOUNDARY, OP=NEW\n*EQUATION, REMOVE ALL\n*FREQUENCY, SOLVER=MATRIXSTORAGE, CYCMPC=INACTIVE\n"
    run_tied(tmp_path, text, f"*STEP\n*STATIC\n*END STEP\n{removed}*END STEP\n")
    own = frequencies(tmp_path, text, matrices="job")
    np.testing.assert_allclose(own, frequencies(tmp_path, text), rtol=1e-8)


MEAN = "*COUPLING, REF NODE=901, SURFACE=SE\n*DISTRIBUTING\n"
PINNED = "".join(f"*EQUATION\n2\n{a},{k},1.,{b},{k},-1.\n" for a, b in ((5, 15), (10, 3)) for k in (1, 2, 3))
SAME = {
    "PIN": ("*MPC\nPIN, 5, 15\nTIE, 10, 3\n", PINNED),
    "BEAM keeps a distance": ("*MPC\nBEAM, 5, 18\n", "*EQUATION\n4\n5,1,20.,5,3,-5.,18,1,-20.,18,3,5.\n"),
    "BEAM of a set": ("*MPC\nBEAM, XM, 3\n", "*RIGID BODY, NSET=XM, REF NODE=3\n"),
    "KINEMATIC COUPLING": (f"{REFERENCE}*KINEMATIC COUPLING, REF NODE=900\nXM, 1, 6\n", f"{LINE}\n"),
    "rotations of the reference node": (
        f"{END}\n*BOUNDARY\n900, 4, 5\n",
        f"*NODE\n901, 9, 9, 9\n{END}, ROT NODE=901\n*BOUNDARY\n901, 1, 2\n",
    ),
    "a reference node that is held": (f"{END}\n*BOUNDARY\n900, 1, 6\n", "*BOUNDARY\nXE, 1, 3\n"),
    "mean motion of a rigid end": (
        f"{END}\n*NODE\n901, 3, 5, 9\n{MEAN}*NSET, NSET=X2\n116, 121, 126\n*RIGID BODY, NSET=X2, REF NODE=901\n",
        f"{REFERENCE}*NSET, NSET=X2\nXE, 116, 121, 126\n*RIGID BODY, NSET=X2, REF NODE=900\n",
    ),
    "axes that are turned": (
        "*TRANSFORM, NSET=XE, TYPE=R\n0, 1, 0, -1, 0, 0\n*BOUNDARY\nXE, 1\n",
        "*BOUNDARY\nXE, 2\n",
    ),
}


def test_no_constraint_but_some_of_the_user_resists_motions_as_one_body(tmp_path):
    """`--check` names the one that does."""
    texts = {**BOTH_READ, **{name: text for name, (text, _) in SAME.items()}}
    resists = {name: "*EQUATION" * ("equation" in name) for name in texts} | {"PIN": "deck.inp, line 111: *MPC"}
    for number, (name, text) in enumerate(texts.items()):
        (folder := tmp_path / f"{number}").mkdir()
        prepared, loaded = prepared_deck(folder, BLOCKS + text)
        frequency, found = prepared.find_resistance(loaded.motions)
        assert (frequency > 1e-3) == bool(resists[name]), name
        assert resists[name] in found, name


SUSPENDED = "\n".join(
    [
        *("*ELSET, ELSET=EFOAM", "1, 5", "*MATERIAL, NAME=FOAM", "*ELASTIC", "0.001, 0.3", "*DENSITY", "1E-12"),
        *("*SOLID SECTION, ELSET=EFOAM, MATERIAL=FOAM", "*SURFACE, NAME=SA", "102, S1", "106, S1", "*SURFACE, NAME=SB"),
        *("104, S1", "108, S1", "*TIE, NAME=A, POSITION TOLERANCE=0.1", "SA, SLOW"),
        *("*TIE, NAME=B, POSITION TOLERANCE=0.8", "SB, SLOW", ""),
    ]
)


def test_ties_across_a_gap_let_bodies_turn(tmp_path):
    """On foam. CalculiX moves the nodes of the ties onto each other, as if there were no gap of 0.4 mm."""
    text = re.sub(r"\*SURFACE INTERACTION.*?SUP, SLOW\n", SUSPENDED, BLOCKS, flags=re.DOTALL)
    apart = re.sub(r"^(105|110|115), 40, (\d+), 5$", r"\1, 40, \2, 5.4", text, flags=re.MULTILINE)
    assert apart.count("5.4") == 3
    found = []
    for name, each in (("touching", text), ("apart", apart)):
        (tmp_path / name).mkdir()
        prepared, loaded = prepared_deck(tmp_path / name, each, friction_coefficient=0.3)
        assert prepared.find_resistance(loaded.motions)[0] < 1e-6
        found.append(prepared.frequencies(0, 8))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-2)
    if shutil.which("ccx") is not None:
        np.testing.assert_allclose(found[1][:4], of_calculix(tmp_path, apart), rtol=1e-2)


@pytest.mark.parametrize("name", SAME)
def test_two_ways_to_say_the_same(name, tmp_path):
    one, other = (frequencies(tmp_path, BLOCKS + text) for text in SAME[name])
    np.testing.assert_allclose(one, other, rtol=1e-9)


def test_forces_of_the_deck_and_gravity(tmp_path):
    """Along directions of the nodes, on a reference node, and of all mass: equal to forces that are given otherwise."""
    turned = "*TRANSFORM, NSET=XM, TYPE=R\n0, 1, 0, -1, 0, 0\n"
    step = "*STEP\n*STATIC\n*CLOAD\nXM, 1, 5.\n*DLOAD\nEALL1, GRAV, 9810., 0., 0., -1.\n*END STEP\n"
    prepared, _ = prepared_deck(tmp_path, BLOCKS + turned + step)
    other, _ = prepared_deck(tmp_path, BLOCKS, preload=({"set": "XM", "direction": (0, 1, 0), "force": 15.0},))
    weight = np.zeros((len(other.weight), 3))
    weight[:, 2] = -9.81 * other.weight
    np.testing.assert_allclose(prepared.static_load, other.static_load + weight.ravel(), atol=1e-12)
    # a pressure of 2 MPa on 40 by 10 mm, by elements and by a surface
    under = "*SURFACE, NAME=UNDER\nELOW, S1\n*STEP\n*STATIC\n"
    pressed = [
        prepared_deck(tmp_path, f"{BLOCKS}{under}{load}\n*END STEP\n")[0].static_load
        for load in ("*DLOAD\nELOW, P1, 2.", "*DSLOAD\nUNDER, P, 2.")
    ]
    np.testing.assert_array_equal(*pressed)
    np.testing.assert_allclose(pressed[0].reshape(-1, 3).sum(axis=0), [0.0, 0.0, 800.0], atol=1e-9)
    # a force on the reference node is one on those that follow
    coupling = BLOCKS + "*NODE\n900, 40., 5., 2.5\n*RIGID BODY, NSET=XE, REF NODE=900\n*STEP\n*STATIC\n*CLOAD\n"
    moved = []
    for force in ("900, 1, 6.", "XE, 1, 1."):
        pulled, loaded = prepared_deck(tmp_path, f"{coupling}{force}\n*END STEP\n")
        np.testing.assert_allclose(total_force(loaded, pulled.static_load), [6.0, 0.0, 0.0], atol=1e-12)
        moved.append(pulled.solve_static(pulled.static_load))
    np.testing.assert_allclose(moved[0], moved[1], atol=1e-9 * abs(moved[0]).max())


@needs_ccx
def test_a_force_on_the_mean_motion_of_a_surface_as_calculix(tmp_path):
    """By a reference node that is off the centre; the mean is weighted by the integrals of the shape functions."""
    mean = f"*NODE\n901, 45., 5., 0.\n{MEAN.replace('SE', 'SE, CONSTRAINT NAME=C')}1, 3\n"
    step = "*STEP\n*STATIC\n*CLOAD\n901, 1, 60.\n901, 3, 5.\n*NODE PRINT, NSET=XE\nU\n*END STEP\n"
    job = run_tied(tmp_path, BLOCKS + mean, step)
    table = np.array([line.split() for line in job.with_suffix(".dat").read_text().splitlines()[3:] if line], float)
    prepared, loaded = prepared_deck(tmp_path, BLOCKS + mean + step)
    moved = 1e3 * prepared.solve_static(prepared.static_load).reshape(-1, 3)
    own = np.searchsorted(loaded.model.mesh.numbers[:-1], table[:, 0])
    np.testing.assert_allclose(moved[own], table[:, 1:], atol=1e-6 * abs(table[:, 1:]).max())


@needs_ccx
@pytest.mark.parametrize("dofs", ["2, 3", "1"])
def test_cylindrical_directions_on_cut_faces_as_calculix(dofs, tmp_path):
    """The bore slides along its radius, or about the axis, in a sector at nodal diameter 3."""

    def text(bore):
        held = f"*BOUNDARY\n{bore}, {dofs}\n*BOUNDARY\n4, 1, 3\n"
        return f"{SECTORS}*TRANSFORM, NSET={bore}, TYPE=C\n0., 0., 0., 0., 0., 1.\n{held}"

    # CalculiX holds no node that follows its image, and has one cyclic symmetry
    step = "*STEP\n*FREQUENCY\n8\n*SELECT CYCLIC SYMMETRY MODES, NMIN=3, NMAX=3\n*END STEP\n"
    own = frequencies(tmp_path, text("BORE"), 3)
    np.testing.assert_allclose(own, of_calculix(tmp_path, text("INSIDE"), step, every=2), rtol=1e-6)


def test_moving_nodes_that_are_held_obliquely(tmp_path):
    """As in a plane of symmetry: nodes of both surfaces are held across it; whichever moves, the model is the same."""
    turned = "*TRANSFORM, NSET=XO, TYPE=R\n1., 1., 0., -1., 1., 0.\n*BOUNDARY\nXO, 1\n"
    held = f"*NSET, NSET=XO\n105, 110, 115, 20, 25, 30\n{turned}"
    text = BLOCKS.replace("1, 6, 11, 16, 21, 26", "1, 6, 11, 2, 7, 12") + held
    prepared, _ = prepared_deck(tmp_path, text)
    assert prepared.pairs.present.sum(axis=0).tolist() == [15, 15, 12]
    other, _ = prepared_deck(tmp_path, text.replace("\nSUP, SLOW\n", "\nSLOW, SUP\n"))
    assert other.pairs.moving_name == ("SLOW",)
    own, expected = (each.frequencies(0, 4) for each in (prepared, other))
    np.testing.assert_allclose(own, expected, rtol=1e-9)
    if shutil.which("ccx") is not None:
        # of nodes that are tied CalculiX holds those of the other surface
        alone = text.replace("115, 20, 25, 30", "115").replace("\nSUP, SLOW\n", "\nSLOW, SUP\n")
        np.testing.assert_allclose(own, of_calculix(tmp_path, alone), rtol=1e-6)
    for nodes in ("105, 110, 115", "115"):
        with pytest.raises(SceneError, match=r"node 1\d5 of SUP "):
            prepared_deck(tmp_path, text.replace("105, 110, 115, 20, 25, 30", nodes))

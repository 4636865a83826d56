"""What is given wrong in Python is refused in one line that begins with its name, and nothing is written."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import fretwear
from fretwear import Block, Passage, SceneError, SolverSettings, UserError
from solver import CubicSprings, IwanJoints
from solver.contact.wear_law import WearLaw, WearTable
from solver.settings import WearTarget

SLIDER = fretwear.build_scene("sdof_slider")
ROUGH = replace(SLIDER, contact=replace(SLIDER.contact, friction_coefficient=np.array([0.4])))
MATRICES = {"mass": np.eye(2), "damping": None, "stiffness": [[2.0, -1.0], [-1.0, 2.0]], "contact_dofs": [[0, 1, -1]]}
MATRICES |= {"area": 1.0, "load_harmonic": [0.0, 1.0]}
JOINT = {"model": SLIDER, "frequency": 150.0, "excitation_amplitude": 10.0, "friction_coefficient": 0.5}
HISTORY = JOINT | {"wear_coefficient": 1e-11, "cycles": 1e4}
FOLLOWED = HISTORY | {"frequency": "resonance", "between": (180.0, 230.0)}
MODE = {"model": SLIDER, "amplitude": 1e-3, "friction_coefficient": 0.5}
CURVE = JOINT | {"frequency": (0.2, 0.25)}
STUDY = {"study": "sdof_slider"}
SCENE = partial(fretwear.build_scene, "sdof_slider")
FEW = SolverSettings(harmonics=5, samples=8)
CRUISE = Block(SLIDER, 160.0, 10.0, 0.5, 200.0, "continue", "cruise")
MISSIONS = partial(fretwear.integrate_mission, wear_coefficient=1e-11, missions=10)
EVOLVE = partial(fretwear.with_evolution, energy=[0.0, 1.0])
EVOLVED = EVOLVE(SLIDER, wear_factor=[1.0, 2.0])
BY_DEPTH = WearLaw("table", table=WearTable((0.0, 1e6), (0.0, 1e-5), ((1.0, 1.0), (1.0, 1.0))))


def second_block(**changed):
    """What is said of one of two blocks, without its number and name."""
    with pytest.raises(ValueError, match=r"^blocks\[[01]\].*?: ") as caught:
        fretwear.integrate_mission((CRUISE, replace(CRUISE, name="", **changed)), 1e-11, 10)
    raise ValueError(str(caught.value).partition(": ")[2])


# a function with what is right, and for each name what is wrong; "->": what the line begins with, where it is another
WRONG = [
    (
        *(fretwear.build_model, MATRICES),
        {
            "mass": ([[1.0, 0.0]], [[1.0], [0.0, 1.0]]),
            "stiffness": ([[2.0, -1.0], [0.0, 2.0]], [[2.0, 1.0j], [-1.0j, 2.0]]),
            "damping": ([[np.nan, 0.0], [0.0, 1.0]],),
            "contact_dofs": ([0, 1, -1], [[0, 2, -1]], [[0, 0, -1]], [[-1, -1, -1]]),
            "contact_dofs -> normal_load": ([[-1, 1, -1]],),
            "area": (0.0,),
            "load_harmonic": ([1.0],),
            "response": ([2], []),
            "surface": ("left",),
        },
    ),
    (
        *(fretwear.march_wear, HISTORY),
        {
            "model": ("sdof_slider",),
            "frequency": (0.0, [1.0, 2.0], "resonnance"),
            "frequency -> between": ("resonance",),
            "between": ((205.0, 215.0),),
            "excitation_amplitude": (-1.0,),
            "friction_coefficient": (np.nan, [[0.5]], [0.5, 0.4], None),
            "model -> friction_coefficient": (ROUGH,),
            "cycles": ([0.0, 2.0, 2.0],),
            "sweep": ("sideways",),
            "scheme": ("euler", "final"),
            "scheme -> step": ("implicit",),
            "settings -> settings.samples": (SolverSettings(harmonics=5, samples=10),),
            "law": ("energy",),
            "until": (1e-6,),
            "wear_depth": ([0.0, 0.0],),
        },
    ),
    (fretwear.march_wear, HISTORY | {"wear_depth": 0.0}, {"law -> wear_depth": (BY_DEPTH,)}),
    (fretwear.march_wear, HISTORY | {"cycles": np.inf, "step": 10.0}, {"scheme": ("explicit",), "outputs": (1,)}),
    (
        *(fretwear.march_wear, FOLLOWED),
        {"between": (None, (215.0, 205.0), (205.0, np.nan)), "sweep": ("ramp",), "scheme": ("final",)},
    ),
    (
        *(fretwear.backbone, MODE),
        {
            "amplitude": (0.0,),
            "sweep": ("left",),
            "mode": (0,),
            "wear_depth": ([1e-6, 1e-6], -1e-6),
            "settings -> settings.samples": (FEW,),
        },
    ),
    (fretwear.response_curve, CURVE, {"frequency": (0.2, (0.2, 0.25, 0.3), (0.2, 0.2))}),
    (fretwear.response_curve, JOINT, {"excitation_amplitude": ((0.02, np.nan),)}),
    (fretwear.with_contact_stiffness, {"model": SLIDER}, {"contact_stiffness": (0.0, np.nan, 1e23)}),
    (
        *(fretwear.read_study, STUDY),
        {
            "overrides -> sdof_slider: slow_time.cycle": ({"slow_time.cycle": 3},),
            "overrides -> overrides: study.name.x": ({"study.name.x": 3},),
            "overrides -> overrides: axes..step": ({"axes..step": 2},),
            "overrides -> overrides: 1": ({1: 2},),
        },
    ),
    (
        *(fretwear.run_study, STUDY),
        {"output -> run_study: output": (Path("none/out.nc"),), "study -> nothing: the study": ("nothing",)},
    ),
    (
        fretwear.run_study,
        {"overrides": {"axes.step": 2}},
        {"study -> run_study: overrides": (fretwear.read_study("sdof_slider"),)},
    ),
    (lambda name: fretwear.build_scene(name), {}, {"name -> model": ("nothing",)}),
    (SCENE, {}, {"friction_coefficient": (0.3,), "mas": (1.0,), "mass": (-1.0, "1")}),
    (fretwear.read_scene, {}, {"path -> model": (Path(__file__),)}),
    (partial(CubicSprings, (0, 1)), {"linear": 1.0, "cubic": 0.0}, {"linear": ([1.0, -1.0],), "cubic": ([0.0],)}),
    (partial(IwanJoints, (0,), normal_stiffness=0.0), {"stiffness": 1.0, "limit": 1.0}, {"limit": (0.0,)}),
    (partial(IwanJoints, (0,), normal_stiffness=0.0), {"limit": 1.0}, {"stiffness": (np.inf,)}),
    (EVOLVE, {"wear_factor": [1.0, 2.0]}, {"model -> evolution": (EVOLVED,)}),
    (EVOLVE, {"model": SLIDER, "wear_factor": [1.0, 2.0]}, {"energy": ([1.0, 2.0], [0.0], [0.0, 0.0])}),
    (EVOLVE, {"model": SLIDER}, {"friction_coefficient": ([0.3, 2.5],), "contact_stiffness": ([2e13, 1e13],)}),
    (EVOLVE, {"model": SLIDER}, {"wear_factor": ([1.0, np.inf], [1.0, 2.0, 3.0]), "wear_factor -> evolution": (None,)}),
    (MISSIONS, {"blocks": (CRUISE,)}, {"missions": ([1.5], 0), "blocks": ((),), "largest_step": (1.5,)}),
    (MISSIONS, {"blocks": (CRUISE,)}, {"until": (WearTarget("frequency_shift", 0.1),), "sweep": ("continue",)}),
    (second_block, {}, {"begin": ("sweep",), "cycles": (0.0, None), "frequency": (np.nan,)}),
    (second_block, {}, {"friction_coefficient": ([0.1, 0.2],), "friction_coefficient -> begin": (0.4,)}),
    (second_block, {}, {"excitation_amplitude": (0.0,), "model": (SCENE(area=2e-4),)}),
    (second_block, {"frequency": Passage(2.0, 3.0, 1.0)}, {"cycles": (1.0,)}),
    (second_block, {"frequency": Passage(2.0, 3.0, 1.0), "cycles": None}, {"begin": ("down",)}),
    (second_block, {"cycles": None}, {"frequency -> frequency.stop": (Passage(2.0, 2.0, 1.0),)}),
    (second_block, {"cycles": None}, {"frequency -> frequency.rate": (Passage(2.0, 3.0, -1.0),)}),
]


def rows():
    for function, right, table in WRONG:
        for names, values in table.items():
            given, _, named = names.partition(" -> ")
            for value in values:
                yield function, right | {given: value}, named or given


@pytest.mark.parametrize(("function", "given", "named"), list(rows()))
def test_what_is_wrong_is_named_in_one_line(function, given, named, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, UserError, SceneError), match=rf"^{re.escape(named)}\b") as caught:
        function(**given)
    assert str(caught.value).isprintable()
    assert not list(tmp_path.iterdir())

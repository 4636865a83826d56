"""The keys of a study file as text, from the classes that check them: a new study, and a list of all keys."""

from collections.abc import Iterator
from pathlib import Path
from typing import Literal, get_args, get_origin

import numpy as np

from studies.scene import describe_field
from studyrunner.kinds.table import KINDS
from studyrunner.study.mistakes import check_tables, keys_as_given, scene_errors
from studyrunner.study.scene_section import SceneSection
from studyrunner.study.sections import SECTIONS, StudySection
from studyrunner.user_error import UserError, toml_value
from studyrunner.values import Section

Given = dict[str, tuple[object, str]]
"""Keys with value and comment."""

_NEW: dict[str, Given] = {
    "scene": {
        "model": ("dovetail_sector", "or a scene file, joint.h5, or the deck of a finite-element model, joint.inp"),
        "mesh": (1, "coarse, for first trials; run-study --scene-help dovetail_sector lists all keys of this scene"),
        "rotation_speed": (3000, "rpm"),
        "friction_coefficient": (0.5, ""),
    },
    "axes": {
        "frequency": ({"start": 211.5, "stop": 213.5, "num": 5}, "Hz; the joint resonates near 212.6 Hz"),
        "wear_coefficient": (1.1e-11, "1/Pa; 55 times that of Ti-6Al-4V, so that few cycles show wear: give your own"),
        "excitation_amplitude": (0.5, "N; every axis is a number, a list or {start, stop, num}"),
    },
    "slow_time": {"cycles": (20_000, "of vibration"), "outputs": (21, "cycle counts in the result")},
}
"""Tables of a new study; the time that the study takes is a minute."""

_HEAD = """\
# A study of fretting wear, in SI units. A line that begins with # shows a key with its default.
#   run-study {name}.toml --plan    what would be computed, and how long it takes
#   run-study {name}.toml           computes, and writes {name}.nc
#   study-report {name}.nc          draws figures and a page into {name}-report
"""

_TAIL = """\
# [scatter]                     # inputs that are not known exactly: a sample draws each of them
# samples = 16
# friction_coefficient = {normal = {std = 0.03}}
# wear_coefficient = {lognormal = {factor = 1.5}}
"""


def write_new_study(name: str, deck: Path | None = None) -> Path:
    """Writes a study file that runs, with a comment on each key, in the current folder.

    name: of the study. deck: of a finite-element model, of which the study is; None for the bundled dovetail.

    Raises UserError where the name or the deck is wrong, or the file is there or cannot be written.
    """
    name = name.removesuffix(".toml")
    path = Path(f"{name}.toml")
    with keys_as_given({"study.name": "--new"}):
        check_tables({"study": StudySection}, {"study": {"name": name}}, "command line")
    tables = _NEW | ({} if deck is None else _tables_of_deck(deck)) | {"study": {"name": (name, "")}}
    lines = [_HEAD.format(name=name)]
    for table in ("study", "scene", "axes", "slow_time", "wear", "solver", "outputs"):
        given = tables.get(table, {})
        lines.append(f"[{table}]")
        lines += [f"{key} = {toml_value(value)}" + f" # {note}" * bool(note) for key, (value, note) in given.items()]
        others = _keys(table, SECTIONS[table]) if table != "scene" else ()
        own = (each for each in others if each[0] not in given and KINDS["wear"].is_read(table, each[0]))
        lines += [f"# {key} = {default} # {meaning}" for key, default, meaning in own if default]
        lines.append("")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write("\n".join([*lines, _TAIL]))
    except OSError as error:
        raise UserError("command line", "--new", name, f"give another name: {error.strerror}") from None
    return path


def _tables_of_deck(path: Path) -> dict[str, Given]:
    """[scene] and [axes] for a deck or mesh: the load acts on the free set of nodes that is farthest from what is held.

    A name that only the user knows is "?", for which the study asks when it is run.
    """
    from studies.fe_models.meshes import read_mesh_file  # where it is used: it takes a while to load

    with scene_errors("command line", path):
        deck = read_mesh_file(path)
    held = np.unique(np.concatenate([np.empty(0), *(each.nodes for each in deck.boundaries)]))
    centre = deck.coordinates[np.isin(deck.node_numbers, held) | (len(held) == 0)].mean(axis=0)
    free = {name: nodes for name, nodes in deck.node_sets.items() if len(nodes) and not np.isin(nodes, held).any()}
    away = {
        name: float(np.linalg.norm(deck.coordinates[np.isin(deck.node_numbers, nodes)] - centre, axis=1).mean())
        for name, nodes in free.items()
    }
    if not away:
        raise UserError("command line", "--from", str(path), "give a deck with a set of nodes that can move")
    pushed = np.zeros(3)
    for force in deck.forces:
        pushed[force.first_dof - 1 : min(force.last_dof, 3)] += force.value * len(force.nodes)
    direction = [0, 1, 0] if not pushed.any() else (pushed / np.linalg.norm(pushed)).round(3).tolist()
    motion = {"set": max(away, key=lambda name: away[name]), "direction": direction}
    in_mm = any(material.density < 1e-3 for material in deck.materials.values() if material.density)
    scene: Given = {
        "model": (str(path), ""),
        "units": ("mm-t-s" if in_mm else "SI", "of the deck; all other keys are SI"),
        "load": (motion, f"where the excitation acts; sets of the deck: {', '.join(sorted(free))}"),
        "response": ({"tip": motion}, "what is observed"),
        "loss_factor": (1e-3, "damping of the material"),
    }
    if deck.cyclic:
        scene["nodal_diameter"] = (0, "of the travelling wave")
    elif not (deck.forces or deck.pressures or deck.centrifugal):
        press = [{"set": motion["set"], "direction": [0, 0, -1], "force": 500.0}]
        scene["# preload"] = (press, "N, what presses the surfaces together: the deck has no static load")
        scene["# retention_stiffness"] = (1e6, "N/m, against motions that friction alone would hold: see --check")
    if any(pair.friction_coefficient is None for pair in deck.contact_pairs) or not deck.contact_pairs:
        scene["friction_coefficient"] = (0.3, "")
    if not deck.contact_pairs and not deck.ties:
        scene["contact"] = ([["?", "?"]], "surfaces or sets that touch: the deck has no contact pair")
    if not len(held):
        scene["clamp"] = (["?"], "sets that are held: the deck holds none; or leave this line out")
    if not deck.sections:
        steel = {"young_modulus": 210e9, "poisson_ratio": 0.3, "density": 7800.0}
        scene["material"] = (steel, "steel: the deck has no material")
    ratios = ([0.99, 1.0], "over the first natural frequency with all contact pairs stuck; or frequency, Hz")
    return {"scene": scene, "axes": {"frequency_ratio": ratios, "excitation_amplitude": (1.0, "N")}}


def key_list() -> str:
    """Markdown: all keys of a study file with default and meaning."""
    lines = []
    of_kinds = {kind.table: kind.part("rules").TABLE for kind in KINDS.values() if kind.table}
    tables: dict[str, type[Section]] = {**SECTIONS, "scene": SceneSection, **of_kinds}
    order = (
        "study",
        "scene",
        "axes",
        "wear",
        "slow_time",
        "solver",
        "outputs",
        "loading",
        "scatter",
        "measured",
        *of_kinds,
    )
    for table in order:
        for key, default, meaning in _keys(table, tables[table]):
            shown = f"`{table}.{key} = {default}`" if default else f"`{table}.{key}`"
            needed = " (required)" if tables[table].model_fields[key].is_required() else ""
            lines.append(f"- {shown}{needed}: {meaning}")
    return "\n".join(lines)


def _keys(table: str, kind: type[Section]) -> Iterator[tuple[str, str, str]]:
    """Each key with its default, empty where it has none, and its meaning, after the words that it takes."""
    for key, field in kind.model_fields.items():
        value = None if field.is_required() else field.default
        if table in ("axes", "solver") and isinstance(value, tuple):
            value = value[0]
        inner = [*_types_and_words(field.annotation)]
        words = ", ".join(f'"{each}"' for each in inner if isinstance(each, str))
        if words and {int, float} & {*inner}:
            words = f"a number, or {words}"
        if field.description:
            default = "" if value is None else toml_value(value)
            meaning = describe_field(field)
            yield key, default, f"{words}: {meaning}" if words else meaning


def _types_and_words(annotation: object) -> Iterator[object]:
    """All types in an annotation, and the words that it takes."""
    inner = get_args(annotation)
    for each in inner:
        yield from (each,) if get_origin(annotation) is Literal else _types_and_words(each)
    if not inner:
        yield annotation

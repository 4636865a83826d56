"""No file on disk is a pickle: nothing that reads or writes one can run what somebody has put into it."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = sorted(path for package in ("solver", "studies", "studyrunner") for path in (ROOT / package).rglob("*.py"))
UNSAFE = {"pickle", "_pickle", "cPickle", "dill", "cloudpickle", "joblib", "shelve", "marshal"}
"""Modules whose files can run code when they are read."""

MAPPED = ROOT / "studyrunner" / "mpi" / "mapped_file.py"
"""What ranks of one run send each other is pickled, by mpi4py and here; of this, arrays alone are on a disk."""

READERS = {"load", "save", "savez", "savez_compressed"}
"""Of numpy: they write objects as pickles unless they are told not to."""


def offences(source):
    """What a module does that has to do with pickles."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found.extend(alias.name for alias in node.names if alias.name.split(".")[0] in UNSAFE)
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in UNSAFE:
            found.append(f"from {node.module}")
        elif isinstance(node, ast.Call):
            allowed = [key.value for key in node.keywords if key.arg == "allow_pickle"]
            if any(not (isinstance(value, ast.Constant) and value.value is False) for value in allowed):
                found.append(f"allow_pickle in line {node.lineno}")
            name = node.func
            of_numpy = isinstance(name, ast.Attribute) and isinstance(name.value, ast.Name) and name.value.id == "np"
            if of_numpy and isinstance(name, ast.Attribute) and name.attr in READERS and not allowed:
                found.append(f"np.{name.attr} in line {node.lineno}")
    return found


def test_no_module_reads_or_writes_pickles():
    assert len(SOURCES) > 80
    searched = [path for path in SOURCES if path != MAPPED]
    assert {str(path): found for path in searched if (found := offences(path.read_text(encoding="utf-8")))} == {}


def test_a_mapped_file_holds_numbers_alone():
    source = MAPPED.read_text(encoding="utf-8")
    assert offences(source) == ["pickle"]
    calls = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Call) and node.args]
    given = [(ast.unparse(call.func), ast.unparse(call.args[0])) for call in calls]
    assert [argument for name, argument in given if name == "pickle.loads"] == ["given.head"]
    assert [argument for name, argument in given if name.endswith(".write")] == ["question.mark", "buffer.raw()"]

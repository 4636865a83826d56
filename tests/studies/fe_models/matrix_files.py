"""Files with matrices that the tests write, after the manuals of the codes.

Each writer takes matrices and forces by name, and node and dof of the rows (n, 2), and writes job.*.
"""

from functools import partial

import h5py
import numpy as np
from scipy import io, sparse


def chain(nodes: tuple[int, ...] = (1, 2, 10), n_modes: int = 0):
    """Matrices (dense, definite) of some nodes and modes, and their rows; modes have the dof 0."""
    n = 3 * len(nodes) + n_modes
    generator = np.random.default_rng(5)
    stiffness = generator.normal(size=(n, n))
    stiffness = 1e9 * (stiffness + stiffness.T + n * np.eye(n))
    mass = np.diag(np.arange(1.0, n + 1)) * 1e-3
    mass[0, 1] = mass[1, 0] = 2e-4
    named = {"stiffness": stiffness, "mass": mass, "damping": mass, "load": np.arange(float(n))}
    rows = [[node, dof] for node in nodes for dof in (1, 2, 3)]
    return named, np.array(rows + [[9001 + mode, 0] for mode in range(n_modes)])


def entries(matrix, triangles="upper"):
    """Row, column (from 0) and value of a triangle, or both, column by column."""
    keep = {"upper": np.triu, "lower": np.tril, "both": np.asarray}[triangles](matrix)
    return [(row, column, keep[row, column]) for column, row in np.argwhere(keep.T)]


def write_calculix(folder, named, rows):
    for name, end in (("stiffness", "sti"), ("mass", "mas")):
        lines = [f"{r + 1} {c + 1}  {v:.13e}" for r, c, v in entries(named[name])]
        (folder / f"job.{end}").write_text("\n".join(lines) + "\n")
    (folder / "job.dof").write_text("".join(f"{node}.{dof}\n" for node, dof in rows))


def write_matrix_input(folder, named, rows, triangles="lower"):
    """Of *MATRIX OUTPUT, FORMAT=MATRIX INPUT, and forces."""
    for name, end in (("stiffness", "STIF1"), ("mass", "MASS1"), ("damping", "DMPV1")):
        if name in named:
            lines = [
                f"{','.join(map(str, rows[r]))}, {','.join(map(str, rows[c]))}, {v:.16e}"
                for r, c, v in entries(named[name], triangles)
            ]
            (folder / f"job_{end}.mtx").write_text("** a matrix\n" + "\n".join(lines) + "\n")
    if "load" in named:
        lines = [f"{node},{dof}, {value:.16e}" for (node, dof), value in zip(rows, named["load"], strict=True) if value]
        (folder / "job_LOAD1.mtx").write_text("*CLOAD, OP=NEW\n" + "\n".join(lines) + "\n")


def write_punch(folder, named, rows, large=True):
    """DMIG entries in large fields as Nastran punches them, or in small fields, two entries a line."""
    lines = ["$ matrices of a superelement", "GRID,1,,0.,0.,0."]
    for title, of in (("KAAX", "stiffness"), ("MAAX", "mass"), ("BAAX", "damping"), ("PAX", "load")):
        if of not in named:
            continue
        matrix = np.atleast_2d(named[of].T).T
        lines.append(f"{'DMIG':8}{title:8}{0:8d}{9 if of == 'load' else 6:8d}{2:8d}{0:8d}")
        for column in range(matrix.shape[1]):
            node, dof = (1, 0) if of == "load" else rows[column]
            own = [row for row in range(0 if of == "load" else column, len(matrix)) if matrix[row, column]]
            if large:
                lines.append(f"{'DMIG*':8}{title:16}{node:16d}{dof:16d}")
                values = [f"{matrix[row, column]:.9E}".replace("E", "D") for row in own]
                lines += [f"{'*':8}{rows[r][0]:16d}{rows[r][1]:16d}{v:>16}" for r, v in zip(own, values, strict=True)]
                continue
            groups = [f"{rows[r][0]:8d}{rows[r][1]:8d}{_short(matrix[r, column]):>8}{'':8}" for r in own]
            lines.append(f"{'DMIG':8}{title:8}{node:8d}{dof:8d}{'':8}{groups[0][:24] if groups else ''}")
            lines += [f"{'':8}{''.join(groups[at : at + 2])}" for at in range(1, len(groups), 2)]
    (folder / "job.pch").write_text("\n".join(lines) + "\n")


def _short(value):
    """A number in 8 characters, as Nastran has it: 1.234+9."""
    mantissa, exponent = f"{value:.3e}".split("e")
    return f"{mantissa}{int(exponent):+d}"


def write_user_element(folder, named, rows):
    """Of *SUBSTRUCTURE MATRIX OUTPUT: a node for each row, as CalculiX writes it, four entries a line."""
    lines = ["**", f"*USER ELEMENT, NODES={len(rows)}, LINEAR", "** ELEMENT NODES"]
    lines += ["** " + ", ".join(str(node) for node, _ in rows[at : at + 10]) for at in range(0, len(rows), 10)]
    lines += [f"{rows[0][1]}", *(f"{place}, {dof}" for place, (_, dof) in enumerate(rows[1:], 2))]
    for kind, of in (("STIFFNESS", "stiffness"), ("MASS", "mass"), ("VISCOUS DAMPING", "damping")):
        values = [f"{v:.16e}" for column in range(len(rows)) for v in named[of][: column + 1, column]]
        lines += [f"*MATRIX,TYPE={kind}", *(" , ".join(values[at : at + 4]) for at in range(0, len(values), 4))]
    (folder / "job.mtx").write_text("\n".join(lines) + "\n")


def write_rows(folder, rows):
    (folder / "job_rows.csv").write_text("node,dof\n" + "".join(f"{node},{dof}\n" for node, dof in rows))


def write_mat(folder, named, rows):
    io.savemat(folder / "job.mat", {**named, "stiffness": sparse.csc_array(named["stiffness"]), "rows": rows})


def write_mat_73(folder, named, rows):
    """HDF5 with transposed arrays behind a header of 512 bytes; the mass is sparse."""
    with h5py.File(folder / "job.mat", "w", userblock_size=512) as file:
        for name, values in {**named, "rows": rows.astype(float)}.items():
            if name != "mass":
                file[name] = values.T if values.ndim == 2 else values[None]
        columns = sparse.csc_array(named["mass"])
        group = file.create_group("mass")
        group.attrs["MATLAB_sparse"] = np.uint64(columns.shape[0])
        group["data"], group["ir"], group["jc"] = columns.data, columns.indices, columns.indptr
    with (folder / "job.mat").open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file")


def write_market(folder, named, rows):
    write_rows(folder, rows)
    for name, values in named.items():
        matrix = values[:, None] if values.ndim == 1 else sparse.coo_array(values)
        io.mmwrite(folder / f"job_{name}.mtx", matrix, precision=17)


def write_harwell_boeing(folder, named, rows):
    write_rows(folder, rows)
    for name, values in named.items():
        io.hb_write(folder / f"job_{name}.rb", sparse.csc_matrix(np.atleast_2d(values.T).T))


def write_one_triangle(folder, named, rows):
    """Harwell-Boeing: RSA, exponents with D, and fields that touch."""
    write_rows(folder, rows)
    for name, values in named.items():
        matrix = sparse.csc_array(np.tril(values) if values.ndim == 2 else values[:, None])
        matrix.sort_indices()
        lists = (matrix.indptr + 1, matrix.indices + 1, matrix.data)
        forms = (("(8I9)", 8, "{:9d}"), ("(I6)", 1, "{:6d}"), ("(1P,3D23.16)", 3, "{:23.16E}"))
        lines = []
        for numbers, (_, each, form) in zip(lists, forms, strict=True):
            texts = [form.format(number).replace("E", "D") for number in numbers]
            lines += ["".join(texts[at : at + each]) for at in range(0, len(texts), each)]
        head = "".join(f"{n:14d}" for n in (*matrix.shape, matrix.nnz, 0))
        kind = "RSA" if values.ndim == 2 else "RRA"
        formats = "".join(form.ljust(16) for form, *_ in forms)
        start = [name.upper().ljust(72), f"{len(lines):14d}{1:14d}{1:14d}{1:14d}{0:14d}", f"{kind:14}{head}", formats]
        (folder / f"job_{name}.hb").write_text("\n".join([*start, *lines]) + "\n")


def op4_strings(column, sparsely):
    """First row, from 1, and values of the parts of a column: one of all rows, or those between zeros."""
    if not sparsely:
        return [(1, column)]
    rows = np.flatnonzero(column)
    return [(part[0] + 1, column[part]) for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if part.size]


def write_op4(folder, named, rows, *, binary=False, sparsely=False, many=False):
    """many: two whole numbers a string, as for many rows (BIGMAT)."""
    write_rows(folder, rows)
    with (folder / "job.op4").open("wb") as file:

        def put(text, *parts):
            if binary:
                record = b"".join(part if isinstance(part, bytes) else np.asarray(part).tobytes() for part in parts)
                file.write(np.int32(len(record)).tobytes() + record + np.int32(len(record)).tobytes())
            else:
                file.write(text.encode() + b"\n")

        for name, of in (("KAA", "stiffness"), ("MAA", "mass"), ("BAA", "damping"), ("PA", "load")):
            matrix = np.atleast_2d(named[of].T).T
            size, columns = matrix.shape
            head = np.array([columns, -size if many else size, 6, 2], dtype=np.int32)
            put("".join(f"{n:8d}" for n in head) + f"{name:8}1P,3E23.16", head, f"{name:8}".encode())
            for number, column in enumerate(matrix.T, 1):
                strings = op4_strings(column, sparsely)
                extra = 0 if not sparsely else 2 if many else 1
                words = sum(2 * len(values) + extra for _, values in strings)
                count = words if binary or sparsely else len(column)
                texts, parts = [], []
                for row, values in strings:
                    length = 2 * len(values) + 1
                    start = [] if not sparsely else [length, row] if many else [(length << 16) + row]
                    texts += ["".join(f"{n:{8 if many else 12}d}" for n in start)] if start else []
                    texts += ["".join(f"{v:23.16E}" for v in values[at : at + 3]) for at in range(0, len(values), 3)]
                    parts += [np.array(start, dtype=np.int32), values]
                first = [number, 0 if sparsely else 1, count]
                put("\n".join(["".join(f"{n:8d}" for n in first), *texts]), np.array(first, dtype=np.int32), *parts)
            last = [columns + 1, 1, 1 + binary]
            put("".join(f"{n:8d}" for n in last) + "\n 1.0", np.array(last, dtype=np.int32), np.ones(1))


REDUCED = {
    "mat": write_mat,
    "mat 7.3": write_mat_73,
    "market": write_market,
    "harwell boeing": write_harwell_boeing,
    "one triangle": write_one_triangle,
    "matrix input": write_matrix_input,
    "user element": write_user_element,
    "punch": write_punch,
    "op4": write_op4,
    "op4 binary": partial(write_op4, binary=True),
    "op4 sparse": partial(write_op4, sparsely=True),
    "op4 binary sparse": partial(write_op4, binary=True, sparsely=True),
    "op4 many rows": partial(write_op4, binary=True, sparsely=True, many=True),
}
"""Those of reduced matrices."""


def node_table(mesh, nodes, sets, surface, gap="") -> str:
    """The table of some nodes, rows of a mesh, with the names of their sets; of those of a surface the contact."""
    area, normals = surface.areas_and_normals(mesh.coordinates)
    lines = ["node,x,y,z,sets,area,normal_x,normal_y,normal_z,gap"]
    for node in nodes:
        names = " ".join(name for name, members in sets.items() if node in members)
        contact = [[area[at], *normals[at], gap] for at in np.flatnonzero(surface.nodes == node)] or [[""] * 5]
        place = map(repr, mesh.coordinates[node].tolist())
        lines.append(",".join(map(str, [mesh.numbers[node], *place, names, *contact[0]])))
    return "\n".join(lines) + "\n"

"""Pairs of matrix files, as Abaqus and CalculiX write them, and MatrixMarket's.

    node, component, node, component, value     Abaqus (MATRIX INPUT), CalculiX
    row, column, value                          Abaqus (COORDINATE), job.sti, job.mas of CalculiX
    %%MatrixMarket matrix coordinate real ...   MatrixMarket, general or symmetric

The file given is the stiffness. Its mass, its degrees of freedom (job.dof of CalculiX, with lines
such as ``12.3``) and its nodes are in files beside it, by their names, or in files that are given.
Without a job.dof, rows are three or six components of each node, in the order of their numbers.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import MOST_EQUATIONS, Matrices, Nodes
from msahl.reduction.entries import Entries, assembled, mirrored
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.text_files import lines_of, natural, not_a_number, real

MARKET = "%%matrixmarket matrix coordinate"
COMMENTS = ("**", "%", "#")
OTHERS = {"mass": ("mass", "mas", "m"), "damping": ("dmpv", "", "")}
"""What stands in the names of other matrices for the words of the stiffness's."""
_STIFFNESS = re.compile(
    r"stif(?:f(?:ness)?)?(?=[^a-z]|$)|(?<=[-_.])k(?=[-_.]|$)|^k(?=[-_.]|$)", re.I
)


@dataclass(frozen=True, slots=True)
class Row:
    """The numbers of a line, and the line's number."""

    line: int
    numbers: list[float]


def other_matrix(stiffness: Path, what: str) -> Path | None:
    """Return the file of another matrix beside that of the stiffness; None if there is none."""
    long, end, short = OTHERS[what]
    if stiffness.suffix.lower() == ".sti" and end:
        names = {f"{stiffness.stem}.{end}".lower()}
    else:
        found = _STIFFNESS.search(stiffness.name)
        word = (short if found and len(found[0]) == 1 else long) if found else ""
        names = {_STIFFNESS.sub(word, stiffness.name, count=1).lower()} if word else set()
    return _beside(stiffness, names)


def file_of_nodes(stiffness: Path) -> Path | None:
    """Return the file of nodes beside a matrix: the input of the same job."""
    stems = {
        stiffness.stem.lower(),
        re.sub(r"[-_]stif(?:f(?:ness)?)?\d*$", "", stiffness.stem.lower()),
    }
    return _beside(
        stiffness,
        {stem + end for stem in stems for end in (".inp", ".bdf", ".dat", ".nas", ".csv")},
    )


def _beside(path: Path, names: set[str]) -> Path | None:
    folder = path.parent
    found = [one for one in folder.iterdir() if one.name.lower() in names and one.is_file()]
    return min(found) if found else None


def read_pair(stiffness: Path, mass: Path, damping: Path | None, nodes: Nodes | None) -> Matrices:
    """Return the matrices of files; ``nodes`` determine the rows of files without names of rows."""
    paths = {"stiffness": stiffness, "mass": mass} | ({"damping": damping} if damping else {})
    forms = {what: _form(path) for what, path in paths.items()}
    if set(forms.values()) == {5}:
        return assembled(str(stiffness), {what: _by_names(path) for what, path in paths.items()})
    other = next((what for what in paths if forms[what] != 3), "")
    if other:
        raise ReductionError(
            str(paths[other]), f"lines of {forms[other]} numbers; expected 'node, component, node, "
            "component, value' in all files, or 'row column value' in all",
        )  # fmt: skip
    matrices = {what: _by_rows(path) for what, path in paths.items()}
    size = max(A.shape[0] for A in matrices.values())
    for A in matrices.values():
        A.resize((size, size))
    labels, components = _rows(stiffness, size, nodes)
    return Matrices(
        labels, components, matrices["mass"], matrices["stiffness"], matrices.get("damping")
    )


def _numbers(path: Path) -> Iterator[Row]:
    for line, text in lines_of(path):
        stripped = text.strip()
        if stripped and not stripped.startswith(COMMENTS):
            words = stripped.replace(",", " ").split()
            values = [real(word) for word in words]
            for word, value in zip(words, values, strict=True):
                if value is None:
                    raise not_a_number(path, line, word)
            yield Row(line, [value for value in values if value is not None])


def _form(path: Path) -> int:
    """Return how many numbers the lines of a file have."""
    first = next(_numbers(path), None)
    if first is None:
        raise ReductionError(str(path), "there are no numbers in it; give the file of a matrix")
    return len(first.numbers)


def _by_names(path: Path) -> Entries:
    entries = Entries()
    for row in _numbers(path):
        if len(row.numbers) != 5:
            raise ReductionError(str(path), f"{len(row.numbers)} numbers, expected 5", row.line)
        i, a, j, b, value = row.numbers
        if not all(float(x).is_integer() and 0 < x < 1e12 for x in (i, a, j, b)) or max(a, b) > 6:
            raise ReductionError(
                str(path), "expected 'node, component, node, component, value' with components "
                "from 1 to 6; delete internal nodes and temperatures", row.line,
            )  # fmt: skip
        entries.add((int(i), int(a) - 1), (int(j), int(b) - 1), value)
    return entries


def _by_rows(path: Path) -> sparse.csr_array:
    market = _market_size(path)
    rows: list[int] = []
    columns: list[int] = []
    values: list[float] = []
    for k, row in enumerate(_numbers(path)):
        if k == 0 and market:
            continue
        if len(row.numbers) != 3:
            raise ReductionError(str(path), f"{len(row.numbers)} numbers, expected 3", row.line)
        i, j, value = row.numbers
        if not all(float(x).is_integer() and 0 < x <= MOST_EQUATIONS for x in (i, j)):
            raise ReductionError(
                str(path), f"row {i:g}, column {j:g}: expected numbers from 1 to {MOST_EQUATIONS}",
                row.line,
            )  # fmt: skip
        rows.append(int(i) - 1)
        columns.append(int(j) - 1)
        values.append(value)
    size = max(market, 1 + max([*rows, *columns], default=0))
    return mirrored(
        sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(size, size)))
    )


def _market_size(path: Path) -> int:
    """Return the number of rows that the head of a MatrixMarket file states; 0 for other files."""
    _, first = next(lines_of(path))
    if not first.lower().startswith("%%matrixmarket"):
        return 0
    words = first.lower().split()
    if not first.lower().startswith(MARKET) or words[3:] not in (
        ["real", "general"], ["real", "symmetric"], ["integer", "symmetric"],
    ):  # fmt: skip
        raise ReductionError(
            str(path), f"'{shown(first)}': expected '{MARKET} real general' or 'real symmetric'", 1
        )
    size = next(_numbers(path))
    rows, columns = size.numbers[:2]
    if rows != columns or not 0 < rows <= MOST_EQUATIONS or not rows.is_integer():
        raise ReductionError(
            str(path), f"{rows:g} rows and {columns:g} columns; the matrix is square", size.line
        )
    return int(rows)


def _rows(stiffness: Path, size: int, nodes: Nodes | None) -> tuple[np.ndarray, np.ndarray]:
    """Return labels and components of each row of matrices without names."""
    listed = _beside(stiffness, {f"{stiffness.stem}.dof".lower()})
    if listed is not None:
        return _listed_rows(listed, size)
    if nodes is None:
        raise ReductionError(str(stiffness), "its rows have no names; give the nodes by --nodes")
    count = len(nodes.labels)
    if size not in (3 * count, 6 * count):
        raise ReductionError(
            str(stiffness), f"{size} rows for {count} nodes; expected three or six for each node, "
            "in the order of their numbers, or a file job.dof beside it",
        )  # fmt: skip
    each = size // count
    return np.repeat(np.sort(nodes.labels), each), np.tile(np.arange(each), count)


def _listed_rows(path: Path, size: int) -> tuple[np.ndarray, np.ndarray]:
    found = []
    for line, text in lines_of(path):
        label, _, component = text.strip().partition(".")
        numbers = natural(label), natural(component or "0")
        if numbers[0] is None or numbers[1] is None or not 1 <= numbers[1] <= 6:
            raise ReductionError(
                str(path), f"'{shown(text)}': expected node.component, as 12.3", line
            )
        found.append((numbers[0], numbers[1] - 1))
    if len(found) != size:
        raise ReductionError(
            str(path), f"{len(found)} degrees of freedom for {size} rows of the matrices"
        )
    table = np.array(found)
    return table[:, 0], table[:, 1]

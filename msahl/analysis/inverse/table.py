"""The given motion: coordinates of joints, positions of markers or states of bodies over time.

A table is a CSV file whose first line names its columns as ``joints.csv``, ``markers.csv`` and
``states.csv`` of a run do, or the folder of a run, of which ``states.csv`` is taken and, if it was
written, ``accelerations.csv``. Rates and accelerations of a coordinate are used where the table has
them. Orientations become quaternions of one sign, which are smooth functions of time.
"""

import io
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from msahl.algebra.rotation_arrays import product, quaternions, rotated, rotations
from msahl.analysis.inverse.columns import header, in_si
from msahl.analysis.inverse.drives import InverseError
from msahl.analysis.inverse.run_error import RunError, run_error
from msahl.expressions.syntax import nearest
from msahl.input_files import open_input
from msahl.joints.coordinates import ORIENTATION, SPATIAL, SUFFIXES, coordinates, is_angle
from msahl.model import Joint, Model
from msahl.printable import printable, shown_path
from msahl.results.folder import find
from msahl.results.info import read_info
from msahl.results.read import read_run, unreadable
from msahl.results.write import INFO, file_name
from msahl.run.hidden_bodies import shown_tables
from msahl.run.tables import ACCELERATIONS, JOINTS, MARKERS, STATES
from msahl.system.names import (
    acceleration_columns,
    coordinate_columns,
    marker_columns,
    state_columns,
)

LEAST_ROWS = 8
"""Rows of the shortest table: splines of degree 5 need six, and their error estimate more."""
MOST_BYTES = 2**30
"""Of a table: some ten million rows of six columns."""
TIME = "time"


@dataclass(frozen=True, eq=False)
class Track:
    """The motion of one coordinate: of a joint (``coordinate``), or of a point of a body along an
    axis ("x", "y" or "z"), or an orientation of either (``ORIENTATION``), as a quaternion.

    Arrays are (m, 1), or (m, 4) of a quaternion; rates and accelerations are missing (None) where
    the table does not have them.
    """

    name: str
    element: str  # of the joint, marker or body
    kind: str  # "joint", "marker" or "body"
    coordinate: str
    values: np.ndarray
    rates: np.ndarray | None = None
    accelerations: np.ndarray | None = None

    @property
    def rotates(self) -> bool:
        """Whether the values are those of a rotation."""
        return self.coordinate == ORIENTATION or is_angle(self.coordinate)


@dataclass(frozen=True, eq=False)
class GivenMotion:
    """A table of motion; ``unused`` are columns that the model has, but that determine nothing,
    ``error`` that of the run that computed the motion (None: no run did).
    """

    source: str
    time: np.ndarray  # (m,) [s]
    tracks: tuple[Track, ...]
    unused: tuple[str, ...] = field(default=())
    error: RunError | None = None

    @property
    def joint_coordinates(self) -> tuple[str, ...]:
        """Coordinates of joints that the table has, at which motors can act."""
        return tuple(
            track.name
            for track in self.tracks
            if track.kind == "joint" and track.coordinate != ORIENTATION
        )

    @property
    def has_accelerations(self) -> bool:
        """Whether all coordinates have accelerations."""
        return all(track.accelerations is not None for track in self.tracks)


def read_motion(
    path: Path, model: Model, mapping: Mapping[str, str] = MappingProxyType({})
) -> GivenMotion:
    """Read the table, or the run's folder, at ``path``; ``mapping`` is that of ``mapping_of``.
    Raises ``InverseError``, or the errors of ``read_run``.
    """
    if not path.is_dir():
        names, numbers = in_si(*_read_table(path), mapping, shown_path(path))
        motion = motion_of_table(names, numbers, model, shown_path(path))
        return replace(motion, error=_error_of_folder(path))
    run = read_run(path)
    shown, table = shown_tables(replace(model, simulation=run.model.simulation)), run.states
    columns = shown[STATES]  # those that a table at this path would have
    lacks = [name for name in columns if name not in table.columns]
    if lacks:
        raise InverseError(
            f"{shown_path(path)}: the run is of another model: it has no column {lacks[0]}; give a "
            "run of this deck, or a table of coordinates"
        )
    more = run.others.get(ACCELERATIONS)
    parts = [table[columns].to_numpy()]
    if more is not None:
        names = shown[ACCELERATIONS][1:]
        columns = [*columns, *names]
        parts.append(more[names].to_numpy())
    motion = motion_of_table(columns, np.concatenate(parts, axis=1), model, shown_path(path))
    return replace(motion, error=run_error(run.info))


def _error_of_folder(path: Path) -> RunError | None:
    """Return the errors of the run in whose folder the table at ``path`` is; None if it is none."""
    folder = path.parent
    if path.name not in map(file_name, (STATES, JOINTS, MARKERS)) or find(folder, INFO) is None:
        return None
    return run_error(read_info(folder))


def motion_of_table(
    columns: list[str], numbers: np.ndarray, model: Model, source: str
) -> GivenMotion:
    """Return the motion in a table (m, columns) of numbers; ``source`` names it in messages."""
    _check(columns, numbers, model, source)
    table = dict(zip(columns, numbers.T, strict=True))
    tracks: list[Track] = []
    for joint in model.joints:
        tracks += _of_joint(joint, table, source)
    for marker in model.markers:
        fixed = marker.basis in ("", *(ground.name for ground in model.grounds))
        found = _of_point(marker.name, "marker", table, source)
        if found and not fixed:
            raise InverseError(
                f"{source}: the columns of marker '{marker.name}' are components along axes of "
                f"'{marker.basis}', which moves; give the marker no basis"
            )
        tracks += found
    for body in model.bodies:
        tracks += _of_point(body.name, "body", table, source)
    if not tracks:
        raise InverseError(
            f"{source}: no column determines the motion; give coordinates of joints as in "
            "joints.csv, such as Joint.angle, or positions as in markers.csv, such as Tip.x"
        )
    used = {name for track in tracks for name in _columns_of(track)}
    unused = tuple(name for name in columns if name != TIME and name not in used)
    return GivenMotion(source, numbers[:, columns.index(TIME)].copy(), tuple(tracks), unused)


def _columns_of(track: Track) -> list[str]:
    """Return the columns that a track may have been read from."""
    if track.kind == "joint" and track.coordinate != ORIENTATION:
        return [f"{track.element}.{track.coordinate}{suffix}" for suffix in SUFFIXES]
    if track.coordinate != ORIENTATION:
        return [f"{track.element}.{order}{track.coordinate}" for order in ("", "v", "a")]
    first = ("q0", "q1", "q2", "q3") if track.kind == "marker" else SPATIAL[0]
    return [f"{track.element}.{name}" for name in (*first, *SPATIAL[1], *SPATIAL[2])]


def _read_table(path: Path) -> tuple[list[str], np.ndarray]:
    """Return columns and numbers (m, columns) of a CSV file."""
    shown = shown_path(path)
    if path.is_char_device():
        raise InverseError(f"{shown}: a device, not a table; give the path of a CSV file")
    try:
        with open_input(path) as file:  # which may be a pipe without end
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            most = f"{MOST_BYTES // 2**20} MiB, the largest table accepted"
            raise InverseError(f"{shown}: larger than {most}; give fewer rows or columns")
        text = io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig").read()
        head, _, rows = text.partition("\n")
    except OSError as error:
        raise InverseError(f"{shown}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise InverseError(f"{shown}: cannot be read: {error}; save it as text (UTF-8)") from error
    columns = header(head)
    lines = [line for line in rows.splitlines() if line.strip()]
    try:
        numbers = np.loadtxt(lines, delimiter=",", ndmin=2, comments=None) if lines else None
    except ValueError:
        numbers = None
    if lines and (numbers is None or numbers.shape[1] != len(columns)):
        raise InverseError(f"{shown}:{unreadable(rows, len(columns))}; correct the table")
    return columns, np.zeros((0, len(columns))) if numbers is None else numbers


def _check(columns: list[str], numbers: np.ndarray, model: Model, source: str) -> None:
    """Raise ``InverseError`` at the first fault of a table."""
    if TIME not in columns:
        raise InverseError(f"{source}: no column 'time'; name that of times [s] so, or by --map")
    twice = [name for name in columns if columns.count(name) > 1]
    if twice:
        raise InverseError(f"{source}: the column {printable(twice[0])} appears twice; remove one")
    known = _known(model)
    for name in columns:
        if name not in known:
            remedy = nearest(name, known)
            raise InverseError(f"{source}: the model has no coordinate '{printable(name)}'{remedy}")
    if len(numbers) < LEAST_ROWS:
        raise InverseError(
            f"{source}: {len(numbers)} rows; accelerations need at least {LEAST_ROWS}"
        )
    bad = np.argwhere(~np.isfinite(numbers))
    if bad.size:
        row, column = bad[0]
        raise InverseError(
            f"{source}: row {row + 1}: {columns[column]} is {numbers[row, column]}, not a finite "
            "number; correct it, or remove the row"
        )
    time = numbers[:, columns.index(TIME)]
    late = np.flatnonzero(np.diff(time) <= 0.0)
    if late.size:
        row = int(late[0]) + 1
        raise InverseError(
            f"{source}: row {row + 1}: time {time[row]:.12g} s follows {time[row - 1]:.12g} s; "
            "times must increase"
        )
    if time[0] != 0.0:
        raise InverseError(
            f"{source}: the first time is {time[0]:.12g} s; the deck starts at 0, so let the table "
            "begin at 0 as well"
        )


def _known(model: Model) -> dict[str, None]:
    """Return the columns that a table may have: those of joints first, which messages suggest."""
    names: Iterable[str] = (
        TIME,
        *coordinate_columns(model, 3)[1:],
        *marker_columns(model)[1:],
        *state_columns(model)[1:],
        *acceleration_columns(model)[1:],
    )
    return dict.fromkeys(names)


def _columns(table: dict[str, np.ndarray], element: str, names: Iterable[str]) -> np.ndarray | None:
    """(m, k) columns of an element, None if one of them is missing."""
    heads = [f"{element}.{name}" for name in names]
    if not all(head in table for head in heads):
        return None
    return np.stack([table[head] for head in heads], axis=1)


def _of_joint(joint: Joint, table: dict[str, np.ndarray], source: str) -> list[Track]:
    """Return the tracks of a joint that the table has."""
    found = []
    for name in coordinates(joint):
        if name == ORIENTATION:
            P = _columns(table, joint.name, SPATIAL[0])
            if P is not None and f"{joint.name}.x" not in table:  # else they are a body's
                track = Track(joint.name, joint.name, "joint", ORIENTATION, quaternions(P))
                found.append(_rotating(track, table))
            continue
        values = _columns(table, joint.name, [name])
        if values is None:
            continue
        rates, accelerations = (
            _columns(table, joint.name, [name + suffix]) for suffix in SUFFIXES[1:]
        )
        head = f"{joint.name}.{name}"
        found.append(Track(head, joint.name, "joint", name, values, rates, accelerations))
        _check_revolutions(found[-1], table[TIME], source)
    return found


def _check_revolutions(track: Track, time: np.ndarray, source: str) -> None:
    """Raise ``InverseError`` where an angle changes by half a revolution from row to row."""
    fast = np.flatnonzero(np.abs(np.diff(track.values[:, 0])) >= math.pi)
    if track.rotates and fast.size:
        row = int(fast[0])
        raise InverseError(
            f"{source}: {track.name} changes by half a revolution or more from {time[row]:.9g} s "
            f"to {time[row + 1]:.9g} s; give more rows, and count angles over all revolutions"
        )


def _of_point(element: str, kind: str, table: dict[str, np.ndarray], source: str) -> list[Track]:
    """Return the tracks of a marker, or of the reference point of a body, that the table has."""
    found, body = [], kind == "body"
    R = None
    if body:
        P = _columns(table, element, SPATIAL[0])
        q = None if P is None or f"{element}.x" not in table else quaternions(P)
        R = None if q is None or P is None else rotations(P)
    else:
        q = _columns(table, element, ("q0", "q1", "q2", "q3"))
        if q is not None:
            size = np.linalg.norm(q, axis=1, keepdims=True)
            if not np.all(np.abs(size - 1.0) < 1e-3):
                raise InverseError(f"{source}: {element}.q0 to .q3 are not of size 1")
            q = q / size
    moved = [
        _inertial(_columns(table, element, [f"{order}{axis}" for axis in "xyz"]), R)
        if body
        else None
        for order in "va"
    ]
    for i, axis in enumerate("xyz"):
        values = _columns(table, element, [axis])
        if values is None:
            continue
        if body:
            v, a = (None if part is None else part[:, i : i + 1] for part in moved)
        else:
            v, a = (_columns(table, element, [f"{order}{axis}"]) for order in "va")
        found.append(Track(f"{element}.{axis}", element, kind, axis, values, v, a))
    if q is not None:
        found.append(_rotating(Track(element, element, kind, ORIENTATION, q), table))
    return found


def _inertial(vectors: np.ndarray | None, R: np.ndarray | None) -> np.ndarray | None:
    """(m, 3) vectors of a body's own axes in inertial axes."""
    return None if vectors is None or R is None else rotated(R, vectors)


def _rotating(track: Track, table: dict[str, np.ndarray]) -> Track:
    """Return the track of a quaternion with one sign throughout, and with its derivatives.

    q' = q w / 2 and q'' = q alpha / 2 + q' w / 2 with w and alpha in the rotating axes.
    """
    q = track.values.copy()
    signs = np.where(np.sum(q[1:] * q[:-1], axis=1) < 0.0, -1.0, 1.0)
    q[1:] *= np.cumprod(signs)[:, None]
    w = _columns(table, track.element, SPATIAL[1])
    alpha = _columns(table, track.element, SPATIAL[2])
    rate = None if w is None else 0.5 * product(q, _pure(w))
    change = None
    if rate is not None and w is not None and alpha is not None:
        change = 0.5 * (product(q, _pure(alpha)) + product(rate, _pure(w)))
    return Track(
        f"{track.element}.P1 to .P3", track.element, track.kind, track.coordinate, q, rate, change
    )


def _pure(vectors: np.ndarray) -> np.ndarray:
    """(m, 4) quaternions without scalar part."""
    return np.concatenate([np.zeros((len(vectors), 1)), vectors], axis=1)


def spins(q: np.ndarray, rate: np.ndarray, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m, 3) angular velocities and accelerations, rotating axes, of quaternions and their first
    and second derivatives: w = 2 (q* q') and alpha = 2 (q* q''), vector parts.
    """
    size = np.sum(q * q, axis=1, keepdims=True)
    back = np.concatenate([q[:, :1], -q[:, 1:]], axis=1) / size
    return 2.0 * product(back, rate)[:, 1:], 2.0 * product(back, change)[:, 1:]

"""Import a file: what it says becomes the text of a deck, and a list of what the deck has not."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from msahl.deck.faults import DeckError, Element, Faults
from msahl.deck.parse import parse, read_bytes
from msahl.deck.source import Source
from msahl.importers.build import build, root_of
from msahl.importers.contacts import apart, omit_unwanted
from msahl.importers.deck_text import deck_text
from msahl.importers.meshes import MeshFiles
from msahl.importers.mjcf import read_mjcf
from msahl.importers.mjcf_files import FOREIGN_ATTRIBUTES
from msahl.importers.openings import Opening, fault_openings, note_openings, openings
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, Note
from msahl.importers.robot import Axis, Robot
from msahl.importers.sdf import read_sdf
from msahl.importers.urdf import read_urdf
from msahl.model import Model

FORMATS = {"robot": "URDF", "mujoco": "MJCF", "sdf": "SDF"}
"""Formats by the tag of the root."""


@dataclass(frozen=True)
class Imported:
    """The text of a deck, ``notes`` on what it has not or has in another form, in the order of the
    file, and the ``copies``: files of meshes by the path that the deck names them with."""

    source: Source
    format: str
    notes: tuple[Note, ...]
    copies: Mapping[str, Path]


def import_file(
    path: str | PathLike[str], options: ImportOptions | None = None, target: Path | None = None
) -> Imported:
    """Return the deck of a URDF, SDF or MJCF file, for a file at ``target`` or beside ``path``.

    Raises ``DeckError`` with every fault found.
    """
    path, options = Path(path), options or ImportOptions()
    target = path.with_suffix(".deck.xml") if target is None else target
    log = Log(str(path))
    faults = Faults(str(path))
    root = parse(read_bytes(path, faults), faults, tuple(FORMATS), FOREIGN_ATTRIBUTES)
    with np.errstate(all="ignore"):  # what is not finite is found by the deck's own check
        return _imported(root, path, options, target, log)


def _imported(
    root: Element, path: Path, options: ImportOptions, target: Path, log: Log
) -> Imported:
    folders = (path.parent, *options.packages)
    copied = f"{target.name.partition('.')[0]}_meshes" if options.copy_meshes else ""
    meshes = MeshFiles(folders, target.parent, copied)
    if root.tag == "robot":
        robot = read_urdf(root, options, meshes, log)
    elif root.tag == "sdf":
        robot = read_sdf(root, path, options, meshes, log)
    else:
        robot = read_mjcf(root, path, options, meshes, log)
    _set_pose(root, robot, options, log)
    _follow(robot)
    log.raise_if_any()
    omit_unwanted(robot, options, log)
    found = openings(robot)
    note_openings(found, log)
    built = build(robot, options, log)
    format_ = FORMATS[str(root.tag)]
    source = Source(target, deck_text(built, format_, path.name))
    placed = _model(source, robot, found, log)
    contacts = tuple(apart(built.candidates, placed, log))
    if contacts:
        built = built._replace(model=replace(built.model, contacts=contacts))
        source = Source(target, deck_text(built, format_, path.name))
        _model(source, robot, found, log)
    notes = sorted(dict.fromkeys(log.notes), key=lambda note: (note.file, note.line))
    return Imported(source, format_, tuple(notes), meshes.copies)


def _model(source: Source, robot: Robot, found: list[Opening], log: Log) -> Model:
    """Return the model of a deck that was made; that it has faults is one of the file: of the
    loops that are open, if these cannot be closed, or of the one that the deck names."""
    try:
        return source.model()
    except DeckError as error:
        fault_openings(found, error, log)
        fault = error.faults[0]
        named = (c.element for c in robot.closures if f"'{c.name}'" in fault.where)
        first = re.sub(r"^.*?:\d+: ", "", str(fault))
        log.stop(next(named, root_of(robot)), f"its deck cannot be run: {first}")


def _axes(robot: Robot) -> dict[str, Axis]:
    """Return the hinges, screws and slides by name."""
    axes = (axis for link in robot.links.values() for axis in link.axes)
    return {axis.name: axis for axis in axes if axis.kind in ("hinge", "screw", "slide")}


def _set_pose(root: Element, robot: Robot, options: ImportOptions, log: Log) -> None:
    """Set the values and rates of joints at t = 0 that the user gives."""
    axes = _axes(robot)
    for what, given in (("value", options.pose), ("rate", options.rates)):
        for name, value in given.items():
            if name in axes:
                setattr(axes[name], what, value)
            else:
                known = ", ".join(list(axes)[:20]) or "none"
                log.fault(root, f"joint '{name}' does not rotate or slide; those that do: {known}")


def _follow(robot: Robot) -> None:
    """Put joints that follow others where their relation has them, in the order of the file."""
    axes = _axes(robot)
    for _ in robot.relations:  # a chain of them needs as many rounds as it is long
        for relation in robot.relations:
            first, second = axes.get(relation.first), axes.get(relation.second)
            if first and second and relation.ratio:
                second.value = relation.ratio * first.value + relation.offset
                second.rate = relation.ratio * first.rate

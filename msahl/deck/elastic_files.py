"""Read the files of elastic bodies that a deck names, and put their numbers into its tree.

    <elasticBody file="arm.npz"> -> the same with <modes>: all that a run needs of the file

So a deck as it ran is complete. Files lie beside the deck or below, as parts do.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from msahl.check.names import FORBIDDEN
from msahl.deck.elements import child, numbers
from msahl.deck.faults import DeckError, Element, Faults, attribute, is_true
from msahl.deck.parse import read_bytes
from msahl.model.elastic import Square
from msahl.reduction.body import ReducedBody, read_body_bytes
from msahl.reduction.faults import ReductionError
from msahl.reduction.followers import Part, Parts, parts_of
from msahl.reduction.reduce import MEAN

COUPLED = 1e-9
"""Damping between two modes, by that of both, that is round-off."""
MOST_MODES = 200


def read_elastic_file(element: Element, path: Path, data: bytes | None, faults: Faults) -> bytes:
    """Put the numbers of the file at ``path`` into an ``<elasticBody>``; return its bytes, which
    are ``data`` if they are known. Faults are those of the element."""
    own = Faults(str(path))
    try:
        data = read_bytes(path, own) if data is None else data
        body = read_body_bytes(str(path), data)
        stiffening = is_true(element, "stiffening")
        problem = _problem(body, stiffening)
        if not problem:
            _write_modes(element, _short(parts_of("", body, stiffening)))
    except DeckError as error:
        problem = error.faults[0].message
    except ReductionError as error:
        problem = error.message
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        problem = "its numbers do not describe a body; reduce it again"
    if problem:
        faults.add(element, f"file '{attribute(element, 'file')}': {problem}")
    return data or b""


def _problem(body: ReducedBody, stiffening: bool) -> str:
    """Return why a deck cannot have a body, with geometric stiffening or without; "" if it can."""
    names = [str(name) for name in np.atleast_1d(body.interface_names)]
    D = body.damping
    across = np.abs(D - np.diag(np.diag(D))).max(initial=0.0)
    if body.frame != MEAN:
        return f"its frame is fixed to {body.frame}; reduce it with --frame {MEAN}"
    if not 0 < body.eigenvalues.size <= MOST_MODES:
        return f"it has {body.eigenvalues.size} modes; a deck takes 1 to {MOST_MODES}"
    if any(not n.isprintable() or n != n.strip() or FORBIDDEN & set(n) or not n for n in names):
        return "a name of the interface has characters that no name in a deck has"
    if stiffening and body.stiffening is None:
        return "it has no geometric stiffening; reduce a mesh of beams with --stiffening"
    if across > COUPLED * np.abs(np.diag(D)).max(initial=0.0):
        return "its damping couples the modes; leave the matrix of damping out, give dampingRatio"
    return ""


def _short(parts: Parts) -> Parts:
    """Return parts whose names are those within the body: that of the frame is empty."""
    bodies = (part._replace(name=part.name.removeprefix(".")) for part in parts.bodies)
    return parts._replace(bodies=tuple(bodies))


def _write_modes(element: Element, parts: Parts) -> None:
    """Add ``<modes>`` with these parts."""
    modes = child(element, "modes")
    numbers(modes, "stiffness", parts.stiffness)
    numbers(modes, "damping", parts.damping)
    write_squares(modes, parts.squares)
    for part in parts.bodies:
        write_part(modes, part)


def write_squares(modes: Element, squares: Sequence[Square]) -> None:
    """Add what is squared, counted from 1, and its factors to ``<modes>``; nothing without any."""
    if squares:
        pairs = ((one.argument + 1, one.factor) for one in squares)
        numbers(modes, "squares", [number for pair in pairs for number in pair])


def write_part(modes: Element, part: Part) -> None:
    """Add a body of an elastic one to ``<modes>``: the frame without a name, or a follower."""
    values = [part.mass, part.inertia, *part.place]
    if part.name:
        values += [*part.shape.ravel(), *(part.rotation.ravel() if part.rotation.any() else ())]
    written = numbers(modes, "follower" if part.name else "frame", values)
    if part.name:
        written.set("name", part.name)
    if part.is_node:
        written.set("interface", "true")

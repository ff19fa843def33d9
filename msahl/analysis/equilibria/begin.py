"""Decks that begin at an equilibrium, and runs that do.

    deck as it runs  ->  equilibrium  ->  deck with the model there  ->  run

The run is that of a deck which was written with the bodies in equilibrium and with all explicit
that it counts from t = 0 (``deck.moved``). So a run, its checkpoint, ``deck.xml`` and all that
reads these need not know of the search, and a run is resumed with the numbers with which it began.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import Vector, at
from msahl.analysis.equilibria.equilibrium import (
    BALANCED,
    Solution,
    balance_at,
    held_motions,
    search_start,
)
from msahl.analysis.equilibria.search import find
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import close, prepared
from msahl.deck import Source, deck_digest
from msahl.deck.moved import Configuration, moved_text
from msahl.elements.constraints import scalar
from msahl.model import JointSpring, RigidBody, SignalState, SpringDamper
from msahl.model.settings import EQUILIBRIUM
from msahl.results import folder as results
from msahl.results.job import Job
from msahl.results.write import DECK
from msahl.start.velocities import StartError
from msahl.system.collect import collect

NEGLIGIBLE = 1e-14
"""Displacement, over the size of the system, and rotation [rad] that are round-off: a coordinate
keeps the deck's value, so that a planar model remains exactly planar."""
ROUND_OFF = 2.3e-16
"""Constraint violation, over the largest length, to which the joints of a deck are closed."""
SAME_MODEL = 10.0 * BALANCED
"""Force that is not balanced, over the largest, in a deck that was written for an equilibrium."""
NOTE = "Written by msahl: the bodies are in equilibrium, and what counts from t = 0 is explicit"


def beginning(job: Job) -> Job:
    """Return the run from the equilibrium that its deck asks for; ``job`` itself if it asks for
    none. Raises ``StartError`` if no equilibrium is found.
    """
    if job.model.simulation.start != EQUILIBRIUM:
        return job
    start = search_start(job.model)
    solution = find(start, np.zeros(3))
    if solution is None:
        raise StartError(
            "no equilibrium was found from where the deck has the bodies (<simulation start="
            '"equilibrium">); place them nearer to one, or look for it with msahl equilibrium '
            "--starts"
        )
    text = deck_at(job.text, job.source.path, start, solution)
    return _begun(job, text, _record(job, start, solution))


def beginning_of_run(job: Job, folder: Path) -> Job | None:
    """Return the run from the equilibrium at which the run of the same deck in ``folder`` began,
    to the bit; None if there is none.
    """
    for place in (results.place(folder), folder):
        info = results.info(place)
        start, path = info.get("start"), place / DECK
        if not isinstance(start, dict) or start.get("given") != deck_digest(job.text):
            continue
        text = path.read_bytes() if path.is_file() else b""
        if deck_digest(text) == info["deck"].get("digest"):
            return _begun(job, text, start)
    return None


def _begun(job: Job, text: bytes, start: Mapping[str, Any]) -> Job:
    """Return the run of the deck ``text``, which was written for it."""
    model = Source(job.source.path, text).model(())
    return replace(job, model=model, moved=text, start=start)


def in_words(start: Mapping[str, Any]) -> str:
    """Return in words where a run starts, as ``Job.start`` has it."""
    held = "; ".join(
        f"motion '{name}' is held for it, but moves at t = 0" for name in start.get("held", ())
    )
    return (
        f"starts at an equilibrium, up to {start['moved']:.3g} m from where the deck has the "
        "bodies: "
        f"{start['stability']}; residual {start['residual']:.2g} N" + (f"; {held}" if held else "")
    )


def _record(job: Job, start: Point, solution: Solution) -> dict[str, Any]:
    """Return what ``run.json`` says of the start."""
    from msahl.analysis.equilibria.stability import stability

    point, balance = solution.place.point, solution.place.balance
    moved = np.linalg.norm(point.state.x - start.state.x, axis=1)
    return {
        "at": EQUILIBRIUM,
        "method": solution.method,
        "iterations": solution.iterations,
        "residual": balance.residual,
        "relative": balance.relative,
        "moved": float(moved.max()),
        "stability": stability(point),
        "held": held_motions(job.model),
        "given": deck_digest(job.text),
    }


def deck_at(data: bytes, path: Path, start: Point, solution: Solution) -> bytes:
    """Return the deck ``data``, whose model at t = 0 is ``start``, with the model at an
    equilibrium. Raises ``StartError`` if it is not in equilibrium there by that deck.
    """
    text = deck_there(data, path, start, solution.place.point)
    balance = balance_at(search_start(Source(path, text).model(())), solution.place.balance.axes)
    if not balance.relative <= SAME_MODEL:
        raise StartError(
            f"the equilibrium cannot be written as a deck: of the forces {balance.relative:.1e} "
            "are not balanced there, so a number counts from t = 0 that a deck cannot give, such "
            "as full revolutions of an angle in an expression"
        )
    return text


def deck_there(data: bytes, path: Path, start: Point, point: Point) -> bytes:
    """Return the deck ``data``, whose model at t = 0 is ``start``, with the model at ``point``."""
    state = close(point.system, point.state, point.unknowns, closed=ROUND_OFF)
    return moved_text(data, path, configuration(start, replace(point, state=state)), NOTE)


def configuration(start: Point, point: Point) -> Configuration:
    """Return where the model is at ``point``, for a deck that begins at ``start``."""
    bodies, model = {}, start.model
    size = NEGLIGIBLE * max(float(np.abs(start.state.x).max()), 1.0)
    for b, body in enumerate(model.bodies):
        bodies[body.name] = _body(body, point, b, size)
    states = [signal.name for signal in model.signals if isinstance(signal, SignalState)]
    length, travel = _springs(start, point)
    values = dict(zip(states, point.state.auxiliary.tolist(), strict=True))
    return Configuration(bodies, length, travel, values)


def _body(body: RigidBody, point: Point, b: int, size: float) -> RigidBody:
    """Return a body with its place and its velocity at ``point``."""
    state = point.state
    P = _snapped(at(state.p, b), body.orientation, NEGLIGIBLE)
    R, arm = np.array(matrix(P)), np.array(body.r_BG)
    spin = state.w[b]
    position = _snapped(_vector(state.x[b] - R @ arm), body.position, size)
    velocity = _vector(R.T @ state.v[b] - np.cross(spin, arm))
    return replace(
        body, position=position, orientation=P, velocity=velocity, angular_velocity=_vector(spin)
    )


def _snapped(a: Vector, given: Vector, size: float) -> Vector:
    """Return ``a`` with those components of the ``given`` vector from which it hardly differs."""
    x, y, z = (old if abs(new - old) <= size else new for new, old in zip(a, given, strict=True))
    return (x, y, z)


def _vector(a: np.ndarray) -> Vector:
    x, y, z = (a + 0.0).tolist()  # no minus before a zero
    return (x, y, z)


def _springs(start: Point, point: Point) -> tuple[dict[str, float], dict[str, float]]:
    """Return the lengths at t = 0 of springs without a free length [m], and how far the coordinates
    of springs on joints have moved since then [m or rad].
    """
    length, travel = dict[str, float](), dict[str, float]()
    loads, springs = start.model.loads, collect(start.model).along
    if not springs:
        return length, travel
    before, after = _values(start), _values(point)
    for entry in springs:
        load, q = loads[entry.column], entry.coordinate
        if isinstance(load, SpringDamper) and load.free_length is None and not load.table:
            length[load.name] = float(before[q])
        elif isinstance(load, JointSpring):
            travel[load.name] = float(after[q] - before[q])
    return length, travel


def _values(point: Point) -> np.ndarray:
    """(q,) values of the coordinates, angles counted."""
    group = point.system.scalar
    assert group is not None  # springs act along coordinates
    start = prepared(point.system, point.state)
    value, rate = np.zeros((2, point.state.angle.size))
    scalar.values(group, start.scalar, start.frames, value, rate)
    return value

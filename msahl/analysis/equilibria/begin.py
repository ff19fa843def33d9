"""Models that begin at an equilibrium, and runs that do.

    model  ->  equilibrium  ->  model there  ->  run

Velocities that the deck gives are those with which the bodies leave the equilibrium, in the axes of
each body: a rotor spins in the place where its weight holds it.

The run is that of a model with its bodies in equilibrium and with all explicit that it counts from
t = 0 (``moved``). So a run, its checkpoint, ``deck.xml`` and all that reads these need not know of
the search, and a run is resumed with the numbers with which it began.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from msahl.analysis.equilibria.equilibrium import (
    BALANCED,
    Solution,
    balance_at,
    held_motions,
    search_start,
)
from msahl.analysis.equilibria.moved import moved_model
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.slipping import none_found
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import close
from msahl.analysis.linearised.steady import residual_in_words
from msahl.deck import Source, deck_digest
from msahl.deck.write_model import write_deck
from msahl.model import Model
from msahl.model.settings import EQUILIBRIUM
from msahl.results import folder as results
from msahl.results.job import Job
from msahl.results.write import DECK
from msahl.start.velocities import StartError

ROUND_OFF = 2.3e-16
"""Constraint violation, over the largest length, to which the joints of a deck are closed."""
SAME_MODEL = 10.0 * BALANCED
"""Force that is not balanced, over the largest, where a model begins that was moved."""
NOTE = "Written by msahl: the bodies are in equilibrium, and what counts from t = 0 is explicit"


def beginning(job: Job) -> Job:
    """Return the run from the equilibrium that its deck asks for; ``job`` itself if it asks for
    none. Raises ``StartError`` if no equilibrium is found.
    """
    if job.model.simulation.start != EQUILIBRIUM:
        return job
    start, solution = _found(job.model)
    model = _with_given_velocities(model_at(start, solution), job.model)
    return replace(job, model=model, start=_record(job, start, solution))


def started(model: Model) -> Model:
    """Return the ``model`` where a run of it starts: in equilibrium, if it asks for that. Raises
    ``StartError`` if no equilibrium is found.
    """
    if model.simulation.start != EQUILIBRIUM:
        return model
    return _with_given_velocities(model_at(*_found(model)), model)


def _found(model: Model) -> tuple[Point, Solution]:
    """Return where the search begins, and the equilibrium."""
    start = search_start(model)
    solution = find(start, np.zeros(3))
    if solution is None:
        otherwise = (
            'from where the deck has the bodies (<simulation start="equilibrium">); place them '
            "nearer to one, or look for it with msahl equilibrium --starts"
        )
        raise StartError(none_found(start, otherwise))
    return start, solution


def _with_given_velocities(there: Model, given: Model) -> Model:
    """Return the model ``there``, at rest in an equilibrium, with the velocities of the ``given``
    one in the axes of its bodies.
    """
    if not _is_moving(given):
        return there
    bodies = [
        replace(body, velocity=old.velocity, angular_velocity=old.angular_velocity)
        for body, old in zip(there.bodies, given.bodies, strict=True)
    ]
    return replace(there, bodies=tuple(bodies))


def _is_moving(model: Model) -> bool:
    """Return whether the deck gives velocities."""
    return any(any(body.velocity) or any(body.angular_velocity) for body in model.bodies)


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
            model = Source(job.source.path, text).model(())
            return replace(job, model=model, moved=text, start=start)
    return None


def in_words(start: Mapping[str, Any]) -> str:
    """Return in words where a run starts, as ``Job.start`` has it."""
    more = ["with the velocities that the deck gives"] if start.get("moving") else []
    more += [
        f"motion '{name}' is held for it, but moves at t = 0" for name in start.get("held", ())
    ]
    return (
        f"starts at an equilibrium, up to {start['moved']:.3g} m from where the deck has the "
        "bodies: "
        f"{start['stability']}; residual {residual_in_words(start['residual'], start['relative'])}"
        + "".join(f"; {part}" for part in more)
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
        "moving": _is_moving(job.model),
        "given": deck_digest(job.text),
    }


def model_at(start: Point, solution: Solution) -> Model:
    """Return the model, which begins at ``start``, so that it begins at an equilibrium. Raises
    ``StartError`` if it is not in equilibrium there.
    """
    model = model_there(start, solution.place.point)
    balance = balance_at(search_start(model), solution.place.balance.axes)
    if not balance.relative <= SAME_MODEL:
        raise StartError(
            f"no model begins at the equilibrium: of the forces {balance.relative:.1e} are not "
            "balanced there, so a number counts from t = 0 that a deck cannot give, such as full "
            "revolutions of an angle in an expression"
        )
    return model


def model_there(start: Point, point: Point) -> Model:
    """Return the model, which begins at ``start``, so that it begins at ``point``."""
    state = close(point.system, point.state, point.unknowns, closed=ROUND_OFF)
    return moved_model(start, replace(point, state=state))


def deck_at(start: Point, solution: Solution) -> bytes:
    """Return the text of a deck whose model begins at an equilibrium (see ``model_at``)."""
    return write_deck(model_at(start, solution), NOTE)

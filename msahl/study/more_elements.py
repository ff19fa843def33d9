"""Finer meshes of beams: the model of a run with one, and the error in space of an equilibrium.

    u_n - u = c n^-q        q = 2 p of elements of degree p, so twice the elements suffice

Positions are compared where both have nodes: at the ends of the beams and at the places that the
deck names; and at all other bodies.
"""

import numpy as np

from msahl.analysis.equilibria.begin import beginning
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.point import Point
from msahl.beams.places import Place, common_places
from msahl.deck.faults import DeckError
from msahl.deck.finer_beams import RefinementError, higher_degree, more_elements
from msahl.deck.source import Source
from msahl.model import Model
from msahl.model.settings import LOCAL, OFF
from msahl.results.job import Job, make_job
from msahl.run.mesh_error import FinerMesh
from msahl.start.velocities import StartError
from msahl.system.names import STATE_COLUMNS


def equilibrium_error(source: Source, text: bytes, found: Point, rotation: np.ndarray) -> float:
    """Return the error in space [m] of an equilibrium ``found`` of the deck ``text`` in plain
    numbers, in a steady ``rotation`` (3,) [rad/s]: the largest of a position at the ends of beams,
    at places that the deck names, and of other bodies.

    Raises ``RefinementError`` if there is none with twice the elements, or the deck names nodes by
    numbers.
    """
    model = Source(source.path, more_elements(text, source, 2, begin=False)).model(())
    try:
        finer = find(search_start(model), rotation)
    except StartError as error:
        raise RefinementError(str(error)) from error
    if finer is None:
        raise RefinementError("no equilibrium was found with twice the elements")
    places = [by_name(point.model, state_row(point)[None]) for point in (found, finer.place.point)]
    common = [key for key in places[0] if key in places[1]]
    change = max(float(np.abs(places[0][key] - places[1][key]).max()) for key in common)
    ratio = 2.0 ** (2 * min(beam.degree for beam in found.model.beams))
    return change * ratio / (ratio - 1.0)


def by_name(model: Model, rows: np.ndarray) -> dict[Place, np.ndarray]:
    """Positions (times, 3) in ``rows`` of states (times, ...), by place."""
    states = rows.reshape(-1, len(model.bodies), len(STATE_COLUMNS))
    return {place: states[:, index, :3] for place, index in common_places(model).items()}


def finer(job: Job) -> FinerMesh | None:
    """Return the model of a run with a finer mesh of its beams; None if there are none, or errors
    are not estimated."""
    if not job.model.beams or job.settings.error in (LOCAL, OFF):
        return None
    try:
        source = Source(job.source.path, higher_degree(job.given_text, job.source))
        model = beginning(make_job(source, source.model(()), {})).model
    except (RefinementError, DeckError, StartError) as error:
        return FinerMesh(None, str(error))
    return FinerMesh(model)

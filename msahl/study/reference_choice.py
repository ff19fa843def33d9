"""Choose the reference with which a study compares its runs."""

import math
from pathlib import Path

import numpy as np

from msahl.deck import DeckError
from msahl.model import Model
from msahl.results.read import ResultError, read_run
from msahl.study.dynamics import Dynamics
from msahl.study.independent import TooSlowError, independent
from msahl.study.reference import Reference, TableReference
from msahl.study.refined_runs import refined_reference


def stored(folder: Path, model: Model) -> TableReference:
    """Return the run in ``folder`` as a reference."""
    run = read_run(folder)
    table = run.states.to_numpy()[:, 1:]
    if table.shape[1] != 12 * len(model.bodies):
        raise ResultError(f"{folder}: not a run of this deck (it has other bodies)")
    description = f"The reference is the stored run {folder}."
    return TableReference(description, run.time, table, float(run.time[-1]), 0.0, Dynamics(model))


def choose_reference(
    wanted: str, model: Model, times: np.ndarray, accuracy: float, seconds: float = math.inf
) -> Reference:
    """Return the reference that ``wanted`` names: "auto", "independent" or a run's folder.

    "auto" is independent or, if that takes more than ``seconds``, from msahl's own runs at small
    steps. Raises ``ResultError`` if there is none.
    """
    if wanted == "independent":
        return independent(model, times, accuracy)
    if wanted == "auto":
        try:
            return independent(model, times, accuracy, seconds)
        except TooSlowError as error:
            return refined_reference(model, accuracy, seconds, error.solution)
    try:
        return stored(Path(wanted), model)
    except DeckError as error:
        raise ResultError(str(error.faults[0])) from error

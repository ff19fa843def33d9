"""The output times at which loads are exported."""

from collections.abc import Sequence

import numpy as np

from msahl.results.info import ResultError
from msahl.results.read import Run
from msahl.system.names import FORCE_COLUMNS, MOMENT_COLUMNS


def extreme_rows(run: Run) -> list[int]:
    """Return the rows at which the force or the moment of a joint is the largest of the run."""
    found = set()
    for joint in run.model.joints if run.reactions is not None else ():
        for components in (FORCE_COLUMNS, MOMENT_COLUMNS):
            names = [f"{joint.name}.{component}" for component in components]
            if run.reactions is not None and set(names) <= set(run.reactions.columns):
                sizes = np.linalg.norm(run.reactions[names].to_numpy(), axis=1)
                found.add(int(np.argmax(sizes)))
    if not found:
        raise ResultError("no joint has a reaction, so no instant is extreme; give --at or --all")
    return sorted(found)


def nearest_rows(run: Run, times: Sequence[float]) -> list[int]:
    """Return the rows with the output times nearest to ``times`` [s]."""
    for t in times:
        if not run.time[0] <= t <= run.time[-1]:
            raise ResultError(
                f"the run has no output time near {t:g} s: it is from {run.time[0]:g} to "
                f"{run.time[-1]:g} s"
            )
    return sorted({int(np.argmin(np.abs(run.time - t))) for t in times})

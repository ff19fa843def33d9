"""Takes many collocation steps of different sizes, as the companion of a run by tolerance does."""

import numpy as np

from msahl.jit.kernel import kernel
from msahl.schemes.collocation import dense_output, newton
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.collocation.tree import stages as tree_stages


@kernel
def take_steps(
    subsystem: CollocationWorkspace,
    sizes: np.ndarray,
    first: int,
    last: int,
    due: np.ndarray,
    share: np.ndarray,
) -> int:
    """As ``newton.take_steps``, with recorded steps of ``sizes`` (steps,) [s]."""
    for step in range(first, last):
        dense_output.save_end(subsystem.dense_output.begin, subsystem.workspace)
        tree_stages.choose_form(subsystem.tree, step)
        if not newton.take_step(subsystem, sizes[step]):
            return step
        newton.record_step(subsystem, sizes[step], step, due, share)
    return last

"""One step of the schemes of higher order, in plain Python."""

import numpy as np

from msahl.model.scheme import split
from msahl.schemes.collocation import equations
from msahl.schemes.collocation.tableau import new_tableau
from msahl.schemes.collocation.workspace import new_stage_arrays
from msahl.system import evaluate
from msahl.system.arrays import new_system_workspace, node_count
from msahl.system.build import build_system
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose


class Step:
    """The equations of one step by a scheme in plain Python, in all unknowns, at a random place."""

    def __init__(self, model, word, h, rng):
        scheme, self.degree = split(word)
        self.h = h
        self.system = build_system(model)
        self.state = build_state(model, self.system)
        self.start = new_system_workspace(self.system, self.state)
        evaluate.prepare(self.system, self.state, self.start)
        self.unknowns = choose(self.system, all_unknowns(self.system))
        tableau = new_tableau(scheme, self.degree)
        self.stages = new_stage_arrays(self.system, self.unknowns, self.state, tableau)
        self.stages.reaction[:] = rng.normal(size=self.stages.reaction.shape)
        self.shape = (self.degree, self.unknowns.free.size)
        self.z = 0.3 * rng.normal(size=self.shape)

    def rows(self, z, fresh=False):
        """(s, f) rows at ``z``."""
        self.stages.Z.reshape(self.degree, -1)[:, self.unknowns.free] = z
        given = (self.system, self.state, self.start, self.stages, self.h)
        equations.evaluate(*given, fresh)
        return self.stages.F.reshape(self.degree, -1)[:, self.unknowns.free].copy()

    def derivative(self):
        """(s, f, s, f) at ``z``."""
        self.rows(self.z, fresh=True)
        s, nodes = self.degree, node_count(self.system)
        complete = np.zeros((s, nodes, 3, s, nodes, 3))
        entries = np.zeros((self.system.constant.size, s, s))
        entries[self.stages.needed] = self.stages.values
        for m, (row, column) in enumerate(self.system.blocks.tolist()):
            if m > 0:
                block = entries[9 * m : 9 * m + 9].reshape(3, 3, s, s)
                complete[:, row, :, :, column, :] += block.transpose(3, 0, 2, 1)
        flat = complete.reshape(s, 3 * nodes, s, 3 * nodes)
        return flat[:, self.unknowns.free][..., self.unknowns.free]

    def difference(self, direction, step=1e-5):
        """Derivative of the equations along ``direction``, by central differences."""
        return (self.rows(self.z + step * direction) - self.rows(self.z - step * direction)) / (
            2.0 * step
        )

    def differs(self, rng):
        """Largest difference of the derivative from ``difference``, over the latter's own size or
        1, in three random directions.
        """
        A, worst = self.derivative(), 0.0
        for _ in range(3):
            direction = rng.normal(size=self.shape)
            wanted = self.difference(direction)
            error = np.abs(np.einsum("jakb,kb->ja", A, direction) - wanted).max()
            worst = max(worst, error / max(1.0, np.abs(wanted).max()))
        return worst

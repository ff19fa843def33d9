"""Steps of higher degree of one island, for ``solve.island``; loaded only where they are asked for.
"""

import numpy as np

from msahl.compiled import compiled
from msahl.schemes.gauss import Stages
from msahl.solve import between, high
from msahl.solve.high import High, new_high
from msahl.solve.outcome import Outcome
from msahl.solve.plan import Plan
from msahl.solve.step import Scene

_march = compiled(high.march)
_publish = compiled(high.publish)

NO_ROWS = (np.zeros(0, dtype=np.int64), np.zeros(0))


class Higher:
    """Steps of a ``degree`` of one ``scene``."""

    def __init__(self, scene: Scene, degree: int) -> None:
        self.high: High = new_high(scene, degree)

    @property
    def kind(self) -> str:
        """Which compiled step the scene needs."""
        kind = "points" if self.high.scene.system.along is None else "along"
        rubs = "" if self.high.rubbing is None else "-friction"
        return f"{kind}{rubs}-high"

    def march(self, h: float, first: int, last: int, plan: Plan) -> int:
        """As ``high.march``."""
        return int(_march(self.high, h, first, last, plan.due, plan.share))

    def show(self, h: float, step: int, plan: Plan) -> None:
        """As ``high.publish``."""
        _publish(self.high, h, step, plan.due, plan.share)

    def forget(self) -> None:
        """Let the next step, from where the scene stands, be guessed from its accelerations."""
        high.forget(self.high)
        between.mark(self.high.between.begin, self.high.scene)

    @property
    def memory(self) -> Stages:
        """What advances beside the scene."""
        return self.high.stages

    def take(self, h: float, share: float) -> Outcome:
        """A step ``h``, whatever ``share`` it is of the whole one, by the compiled solver."""
        _march(self.high, h, 0, 1, *NO_ROWS)
        residual, worst = self.high.outcome
        return Outcome(float(residual), int(worst))

    def take_by_root(self, h: float, share: float) -> Outcome:
        """Likewise by scipy."""
        from msahl.solve import high_root

        return high_root.take(self.high, h)

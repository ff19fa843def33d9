"""Closed forms: scenes whose motion is known, recognised from the model.

Each island of a scene is matched on its own; a scene all of whose islands match is exact. A new
form is a module with ``recognise(scene)`` that returns it or None, and one entry in ``FORMS``.
"""

from collections.abc import Callable

import numpy as np

from msahl.model import Model
from msahl.study.exact import free, oscillator, pendulum, top
from msahl.study.exact.motion import Form, Scene, publish, read_scene
from msahl.system.subsystems import split

FORMS: tuple[Callable[[Scene], Form | None], ...] = (
    free.recognise,
    pendulum.recognise,
    top.recognise,
    oscillator.recognise,
)


class ExactReference:
    """The closed forms of all islands of a scene; trusted at any time."""

    horizon = float("inf")
    error = 1e-13
    """Round-off of closed forms in double precision, times lengths of a metre [m]."""

    def __init__(self, model: Model, forms: dict[str, tuple[Scene, Form]]) -> None:
        self.model, self.forms = model, forms
        names = sorted({form.words for _, form in forms.values()})
        self.words = f"The reference is exact: {'; '.join(names)}."

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``."""
        tables = []
        for body in self.model.bodies:
            scene, form = self.forms[body.name]
            tables.append(publish(scene.body, form.motion(times)))
        return np.hstack(tables)

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] at ``times``."""
        tables = [np.zeros((len(times), 0))]
        for joint in self.model.joints:
            sign = -1.0 if joint.parent in self.forms else 1.0
            scene, form = self.forms[joint.parent if sign < 0.0 else joint.child]
            motion = form.motion(times)
            force = scene.body.mass * (motion.a - scene.gravity)
            tables.append(sign * (force if motion.load is None else force - motion.load))
        return np.hstack(tables)


def recognise(model: Model) -> ExactReference | None:
    """The closed form of ``model``, or None if there is none for some island."""
    forms = {}
    for subsystem in split(model):
        scene = read_scene(subsystem)
        form = next((f for f in (make(scene) for make in FORMS) if f), None) if scene else None
        if scene is None or form is None:
            return None
        forms[scene.body.name] = scene, form
    return ExactReference(model, forms)

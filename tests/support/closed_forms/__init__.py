"""Recognise models whose motion is known in closed form, and return it as a reference.

The independent subsystems of a model are matched one by one; a model is exact if all of them match.
A new form is a module with ``recognise(single)`` that returns the form or None, and one entry in
``FORMS``.
"""

from collections.abc import Callable

import numpy as np

from msahl.model import Model
from msahl.system.subsystems import split
from tests.support.closed_forms import free, oscillator, pendulum, top
from tests.support.closed_forms.motion import Form, SingleBody, publish, read_single_body

FORMS: tuple[Callable[[SingleBody], Form | None], ...] = (
    free.recognise,
    pendulum.recognise,
    top.recognise,
    oscillator.recognise,
)


class ExactReference:
    """The closed forms of all subsystems of a model; trusted at any time."""

    horizon = float("inf")
    error = 1e-13
    """Rounding error of closed forms in double precision, for lengths of about a metre [m]."""

    def __init__(self, model: Model, forms: dict[str, tuple[SingleBody, Form]]) -> None:
        self.model, self.forms = model, forms
        names = sorted({form.description for _, form in forms.values()})
        self.description = f"The reference is exact: {'; '.join(names)}."

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, 12 n) at ``times``."""
        tables = []
        for body in self.model.bodies:
            single, form = self.forms[body.name]
            tables.append(publish(single.body, form.motion(times)))
        return np.hstack(tables)

    def forces(self, times: np.ndarray) -> np.ndarray:
        """Return the joint forces (m, 3 k) [N] at ``times``."""
        tables = [np.zeros((len(times), 0))]
        for joint in self.model.joints:
            sign = -1.0 if joint.parent in self.forms else 1.0
            single, form = self.forms[joint.parent if sign < 0.0 else joint.child]
            motion = form.motion(times)
            force = single.body.mass * (motion.a - single.gravity)
            tables.append(sign * (force if motion.load is None else force - motion.load))
        return np.hstack(tables)


def recognise(model: Model) -> ExactReference | None:
    """Return the closed form of ``model``, or None if there is none for some subsystem."""
    forms = {}
    for subsystem in split(model):
        single = read_single_body(subsystem)
        form = next((f for f in (make(single) for make in FORMS) if f), None) if single else None
        if single is None or form is None:
            return None
        forms[single.body.name] = single, form
    return ExactReference(model, forms)

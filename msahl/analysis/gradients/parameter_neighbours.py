"""Models with other values of a number of the deck, and their weights in its derivative."""

import math
from collections.abc import Mapping, Sequence
from functools import cached_property

from msahl.analysis.equilibria.begin import beginning
from msahl.analysis.gradients.neighbouring_runs import Nearby
from msahl.analysis.gradients.start import NotDifferentiable
from msahl.analysis.gradients.tables import Neighbours
from msahl.deck import DeckError, ParsedDeck
from msahl.deck.faults import Element
from msahl.deck.overrides import FoundNumber, find_number
from msahl.deck.parse import parse_with_comments
from msahl.model import Model
from msahl.results.job import Job, make_job
from msahl.run.options import OptionError
from msahl.start.velocities import StartError

CENTRAL, ONE_SIDED = ((-1.0, -0.5), (1.0, 0.5)), ((1.0, 2.0), (2.0, -0.5))
"""Shifts and weights of the differences of order 2; the rest of the weights is that of the value
itself. Each model has to be read and built, which takes longer than many of a small model's steps,
so there are no more. Most numbers of a system are proportional to those of the deck, or to a small
power of them, so that the differences are exact but for 1e-10."""
RELATIVE = 1e-5
"""Shift of a value, relative to it."""
ABSOLUTE = 1e-5
"""Shift of a value that is zero, in its unit."""


class DeckNumbers:
    """The numbers of a job's deck, and models with other values of one of them."""

    def __init__(self, job: Job) -> None:
        self.job, self._deck = job, ParsedDeck(job.source)

    @cached_property
    def _root(self) -> Element:
        return parse_with_comments(self.job.given_text)

    def find(self, name: str) -> FoundNumber:
        """Return the number that ``name`` names as ``--set`` does; raises ``LookupError``."""
        found = find_number(self._root, name)
        if found.path.startswith("simulation."):
            raise LookupError(
                "a derivative by it would need other steps, and these are held fixed; name a "
                "parameter, or a number of a body, joint, motion, load or marker"
            )
        return found

    def neighbours(self, name: str, number: FoundNumber, factor: float = 1.0) -> Neighbours:
        """Return models with values near that of the ``number`` with this ``name``, ``factor``
        times as far as usual: on both sides, or on the side that the deck allows.

        Raises ``NotDifferentiable``.
        """
        e = factor * (RELATIVE * abs(number.value) or ABSOLUTE)
        refused = ""
        for points, side in ((CENTRAL, 1.0), (ONE_SIDED, 1.0), (ONE_SIDED, -1.0)):
            try:
                models = [
                    (self._model(name, number, number.value + side * node * e), side * weight / e)
                    for node, weight in points
                ]
            except (DeckError, OptionError, StartError) as error:
                refused = refused or str(error).split("\n", 1)[0]
                continue
            wider = None
            if factor == 1.0:

                def wider(times: float) -> Neighbours:
                    return self.neighbours(name, number, times)

            return Neighbours(models, abs(number.value), wider)
        raise NotDifferentiable(f"the deck allows no values near {number.value:g}: {refused}")

    def nearby(self, name: str, number: FoundNumber) -> Nearby:
        """Return the models with any values near that of the ``number`` with this ``name``."""

        def at(shift: float) -> Model:
            try:
                return self._model(name, number, number.value + shift)
            except (DeckError, OptionError, StartError) as error:
                refused = str(error).split("\n", 1)[0]
                raise NotDifferentiable(
                    f"the deck allows no values near {number.value:g}: {refused}"
                ) from error

        return Nearby(number.value, at)

    def moved(self, numbers: Mapping[str, FoundNumber]) -> "DeckNumbers":
        """Return the numbers of the deck with each of these ``numbers`` changed by its last digit,
        so that no other is equal to it.
        """
        changed = [
            f"{name}={math.nextafter(number.value, math.inf)!r} {number.units}".rstrip()
            for name, number in numbers.items()
        ]
        job, changed = self.job, [*self.job.changed, *changed]
        moved = make_job(job.source, self._deck.model(changed), job.given, changed)
        return DeckNumbers(beginning(moved))

    def _model(self, name: str, number: FoundNumber, value: float) -> Model:
        setting = f"{name}={value!r} {number.units}".rstrip()
        changed: Sequence[str] = (*self.job.changed, setting)
        model = self._deck.model(changed)
        return beginning(make_job(self.job.source, model, self.job.given, changed)).model

"""Rules about events: their conditions, and the elements that they release and engage."""

from collections.abc import Collection, Iterator

from msahl.check.context import Context
from msahl.check.faults import Finding
from msahl.check.names import FORBIDDEN
from msahl.check.signals import expression_findings
from msahl.expressions.syntax import nearest
from msahl.model.events import Event


def event_findings(event: Event, context: Context) -> Iterator[Finding]:
    """Find a condition that cannot be evaluated, actions that contradict each other, and a message
    that no table can hold; ``context.switchable`` are the elements that may be named.
    """
    yield from expression_findings("when", event.expression, context)
    for part, names in (("release", event.releases), ("engage", event.engages)):
        for name in names:
            yield from switchable_findings(part, name, context.switchable)
    for name in sorted({*event.releases} & {*event.engages}):
        yield Finding("", f"it releases and engages '{name}'; remove one of the two")
    if not (event.elements or event.message):
        yield Finding("", "nothing happens; add <release>, <engage> or <message>")
    bad = FORBIDDEN & {*event.message}
    if bad or not event.message.isprintable():
        shown = " ".join(sorted(bad)) or "characters that do not print"
        yield Finding("message", f"it must not contain {shown} (it is a column of events.csv)")


def switchable_findings(part: str, name: str, known: Collection[str]) -> Iterator[Finding]:
    """Find a name that is none of a joint, coupling, motion or contact."""
    if name not in known:
        message = f"{part} '{name}' is no joint, coupling, motion or contact of this model"
        yield Finding(part, message + nearest(name, known))

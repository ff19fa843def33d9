"""Rules about events: their conditions, and what they release, engage, set and push."""

import math
from collections.abc import Collection, Iterator

from msahl.check.context import Context
from msahl.check.faults import Finding
from msahl.check.joints import coordinate_findings
from msahl.check.loads import element_findings
from msahl.check.names import FORBIDDEN
from msahl.check.signals import expression_findings
from msahl.expressions.syntax import nearest
from msahl.model.events import Event, Impulse, ParameterChange
from msahl.model.settable import settable, with_parameter


def event_findings(event: Event, context: Context) -> Iterator[Finding]:
    """Find a condition that cannot be evaluated, actions that contradict each other or act on what
    does not exist, and a message that no table can hold; ``context.switchable`` are the elements
    that may be released and engaged.
    """
    yield from expression_findings("when", event.expression, context)
    for part, names in (("release", event.releases), ("engage", event.engages)):
        for name in names:
            yield from switchable_findings(part, name, context.switchable)
    for name in sorted({*event.releases} & {*event.engages}):
        yield Finding("", f"it releases and engages '{name}'; remove one of the two")
    yield from _set_findings(event, context)
    for impulse in event.impulses:
        yield from _impulse_findings(impulse, context)
    if not (event.acts or event.message):
        message = "nothing happens; add <release>, <engage>, <set>, <impulse> or <message>"
        yield Finding("", message)
    bad = FORBIDDEN & {*event.message}
    if bad or not event.message.isprintable():
        shown = " ".join(sorted(bad)) or "characters that do not print"
        yield Finding("message", f"it must not contain {shown} (it is a column of events.csv)")


def switchable_findings(part: str, name: str, known: Collection[str]) -> Iterator[Finding]:
    """Find a name that is none of a joint, coupling, motion or rigid contact."""
    if name not in known:
        message = f"{part} '{name}' is no joint, coupling, motion or rigid contact of this model"
        yield Finding(part, message + nearest(name, known))


def _set_findings(event: Event, context: Context) -> Iterator[Finding]:
    """Find states and parameters that do not exist or are set twice, and values that a law does not
    take.
    """
    for change in event.states:
        yield from state_findings(change.state, context)
        yield from expression_findings("set", change.expression, context)
    for parameter in event.parameters:
        yield from _parameter_findings(parameter, context)
    names = [change.state for change in event.states]
    names += [f"{change.load}.{change.parameter}" for change in event.parameters]
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield Finding("set", f"it sets '{name}' twice; remove one of the two")


def state_findings(name: str, context: Context) -> Iterator[Finding]:
    """Find a name that is neither a state nor, as LOAD.PARAMETER, a number of a load."""
    if name not in context.states:
        known = [f"{load}.{key}" for load, of in context.loads.items() for key in settable(of)]
        message = (
            f"set '{name}' is neither a <state> nor a number of a spring, damper, friction or drag"
        )
        yield Finding("set", message + nearest(name, [*context.states, *known]))


def _parameter_findings(change: ParameterChange, context: Context) -> Iterator[Finding]:
    name, load = f"{change.load}.{change.parameter}", context.loads.get(change.load)
    if load is None or change.parameter not in settable(load):
        yield from state_findings(name, context)
        return
    known = set(element_findings(load, context))
    for found in element_findings(with_parameter(load, change.parameter, change.value), context):
        if found not in known:
            yield Finding("set", f"'{name}': {found.message}")


def _impulse_findings(impulse: Impulse, context: Context) -> Iterator[Finding]:
    """Find a joint, coordinate or marker that does not exist, and a direction of no length."""
    if impulse.joint and impulse.joint not in context.kinds:
        message = f"'{impulse.joint}' is not a joint of this model"
        yield Finding("impulse", message + nearest(impulse.joint, context.kinds))
    elif impulse.joint:
        for found in coordinate_findings("joint", impulse.joint, impulse.coordinate, context):
            yield Finding("impulse", found.message)
    elif impulse.marker not in context.markers:
        message = f"'{impulse.marker}' is not a marker of this model"
        yield Finding("impulse", message + nearest(impulse.marker, context.markers))
    elif context.markers[impulse.marker] in context.grounds:
        message = f"'{impulse.marker}' is on a ground, which never moves; name one of a rigid body"
        yield Finding("impulse", message)
    elif not math.hypot(*impulse.direction) > 0.0:
        yield Finding("impulse", "<direction> is missing or zero; give its components")
    yield from expression_findings("impulse", impulse.expression, context)

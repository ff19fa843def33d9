"""Rules about elastic bodies: their numbers fit together, and their bodies exist."""

from collections.abc import Collection, Iterator

from msahl.check.faults import Finding, number_findings
from msahl.check.names import unresolved
from msahl.model.elastic import AXES, ElasticBody


def elastic_findings(body: ElasticBody, bodies: Collection[str]) -> Iterator[Finding]:
    """Find numbers of an elastic body that do not fit together, and bodies that do not exist."""
    for name in body.bodies:
        if name not in bodies:
            yield Finding("followers", unresolved("follower", name, "body", bodies))
            return
    for numbers in (body.stiffness, body.damping):
        if min(numbers, default=0.0) < 0.0:
            yield Finding("", f"{min(numbers):g} is less than zero; give stiffness and damping")
    yield from _findings(body)


def _findings(body: ElasticBody) -> Iterator[Finding]:
    q = len(body.stiffness)
    yield from number_findings(body)
    if not q or len(body.damping) != q or body.carriers > len(body.followers):
        yield Finding("stiffness", "each amplitude needs a stiffness, a damping and a carrier")
        return
    for follower in body.followers:
        yield from number_findings(follower)
        if any(len(row) != q for row in (*follower.shape, *follower.rotation)):
            message = f"'{follower.body}' does not have a shape for each of {q} amplitudes"
            yield Finding("followers", f"{message}; correct it")
            return
    for j, (_, axis) in enumerate(body.amplitudes):
        row = body.followers[j // AXES].shape[axis]
        if row[j] != 1.0 or any(value for k, value in enumerate(row) if k != j):
            yield Finding("followers", f"amplitude {j + 1} is not the displacement of its carrier")
            return

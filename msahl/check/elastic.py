"""Rules about elastic bodies: their numbers fit together, and their bodies exist."""

from collections.abc import Collection, Iterator

from msahl.check.faults import Finding, number_findings
from msahl.check.names import unresolved
from msahl.model.elastic import ElasticBody, least_followers


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
    least = min((one.argument for one in body.squares), default=0)
    if least < 0 or least_followers(q, body.squares) > len(body.followers):
        yield Finding("squares", "squares and followers do not fit together; correct them")
        return
    n = q + len(body.squares)
    for follower in body.followers:
        yield from number_findings(follower)
        if any(len(row) != n for row in (*follower.shape, *follower.rotation)):
            message = f"'{follower.body}' does not have a shape for each of {n} numbers"
            yield Finding("followers", f"{message}; correct it")
            return
    for j, (k, axis) in enumerate((*body.carried(0, q), *body.squared)):
        row = body.followers[k].shape[axis]
        if row[j] != 1.0 or any(value for i, value in enumerate(row) if i != j):
            what = f"amplitude {j + 1}" if j < q else f"square {j - q + 1}"
            yield Finding("followers", f"{what} is not the displacement of its carrier")
            return

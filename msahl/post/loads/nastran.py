"""Load cards of Nastran: bulk data in large fields.

RFORCE has the centrifugal force of an angular velocity, outwards, and the force
m alpha x (r - r_G) of an angular acceleration, along it, as OptiStruct documents the card: that of
inertia is of -alpha. Both are in revolutions.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from msahl.post.loads.body_cards import FIRST_NODE, BodyCards, Case, size

HEAD = """\
$ Loads of body '{body}' by msahl export loads, in m, kg, s, N and rad, in the axes of the body
$ with its B as the origin. Connect the nodes below to the mesh (RBE2, RBE3); node {centre} is the
$ mass centre. GRAV and RFORCE act on the masses of the elements, which must be those of the body.
$ The loads of a case are in balance: a determinate support has no reactions. LOAD = its number.
"""


def nastran(cards: BodyCards) -> str:
    """Return the bulk data of a body: nodes, and a set of loads for each instant."""
    lines = [HEAD.format(body=cards.body, centre=FIRST_NODE).rstrip()]
    for number, point in cards.nodes.items():
        lines += _card("GRID", (number, "", *point))
    for k, case in enumerate(cards.cases, start=1):
        lines += [f"$ case {k}: {case.time!r} s", *_case(k, case)]
    return "\n".join(lines) + "\n"


def _case(k: int, case: Case) -> Iterator[str]:
    """Yield the cards of one case: GRAV and RFORCE have sets of their own, which LOAD adds."""
    sets = [1000 * k + 1]
    for node, components in case.loads.items():
        for name, vector in (("FORCE", components[:3]), ("MOMENT", components[3:])):
            if size(vector) > 0.0:
                yield from _card(name, (sets[0], node, 0, 1.0, *vector))
    motion = case.motion
    field = motion.gravity - motion.acceleration
    if size(field) > 0.0:
        sets.append(1000 * k + 2)
        yield from _card("GRAV", (sets[-1], 0, 1.0, *field))
    for place, rates in ((3, (motion.spin, 0.0)), (4, (-motion.spin_rate, 1.0))):
        vector, is_acceleration = rates
        if size(vector) > 0.0:
            sets.append(1000 * k + place)
            revolutions = size(vector) / math.tau
            scales = (0.0, revolutions) if is_acceleration else (revolutions, 0.0)
            direction = vector / size(vector)
            yield from _card(
                "RFORCE", (sets[-1], FIRST_NODE, 0, scales[0], *direction, "", scales[1])
            )
    yield from _card("LOAD", (k, 1.0, *(part for number in sets for part in (1.0, number))))


def _card(name: str, fields: Sequence[object]) -> Iterator[str]:
    """Yield a card in lines of four fields of 16 characters."""
    words = [_word(field) for field in fields]
    for first in range(0, len(words), 4):
        head = f"{name}*" if first == 0 else "*"
        yield (f"{head:8}" + "".join(f"{word:>16}" for word in words[first : first + 4])).rstrip()


def _word(field: object) -> str:
    """Return a field: ten digits of a number fill it."""
    return f"{field:.9E}" if isinstance(field, float | np.floating) else str(field)

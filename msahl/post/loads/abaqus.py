"""Load cards of Abaqus and CalculiX.

GRAV and CENTRIF are the same in both. CalculiX has no load by an angular acceleration, so that is a
moment -J alpha at the mass centre, and not distributed.
"""

from collections.abc import Iterator

import numpy as np

from msahl.post.loads.body_cards import FIRST_NODE, BodyCards, Case, size

HEAD = """\
** Loads of body '{body}' by msahl export loads, in m, kg, s, N and rad, in the axes of the
** body with its B as the origin. Connect the nodes below to the mesh (*COUPLING, *RIGID BODY);
** node {centre} is the mass centre. GRAV and CENTRIF act on the masses of the elements of EALL,
** which must be those of the body. The moment of an angular acceleration, -J alpha, acts at the
** mass centre. The loads of a step are in balance: a determinate support has no reactions.
"""


def abaqus(cards: BodyCards) -> str:
    """Return the input of a body: nodes, and a step for each instant."""
    lines = [HEAD.format(body=cards.body, centre=FIRST_NODE).rstrip(), "*NODE, NSET=NLOADS"]
    lines += [", ".join(map(_word, (n, *point))) for n, point in cards.nodes.items()]
    for k, case in enumerate(cards.cases, start=1):
        lines += [f"** case {k}: {case.time!r} s", "*STEP", "*STATIC", *_case(cards, case)]
        lines.append("*END STEP")
    return "\n".join(lines) + "\n"


def _case(cards: BodyCards, case: Case) -> Iterator[str]:
    """Yield the loads of one case, which replace those of the step before."""
    yield "*CLOAD, OP=NEW"
    motion = case.motion
    loads = {FIRST_NODE: np.zeros(6)} | case.loads
    loads[FIRST_NODE] = loads[FIRST_NODE] + np.array(
        [0.0, 0.0, 0.0, *(-cards.inertia @ motion.spin_rate)]
    )
    for node, components in loads.items():
        for dof, value in enumerate(components, start=1):
            if value != 0.0:
                yield ", ".join(map(_word, (node, dof, value)))
    yield "*DLOAD, OP=NEW"
    field = motion.gravity - motion.acceleration
    if size(field) > 0.0:
        yield ", ".join(map(_word, ("EALL", "GRAV", size(field), *(field / size(field)))))
    speed = size(motion.spin)
    if speed > 0.0:
        place = (*cards.nodes[FIRST_NODE], *(motion.spin / speed))
        yield ", ".join(map(_word, ("EALL", "CENTRIF", speed * speed, *place)))


def _word(field: object) -> str:
    return field if isinstance(field, str) else f"{field:.15g}"

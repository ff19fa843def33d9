"""Expand a deck: put its parts into place, change numbers that options set, evaluate expressions.

    <includes> -> elements of <system> and parameters, with their prefix
    --set      -> other numbers
    {...}      -> numbers

What remains is a deck without parts, whose numbers are plain; ``<parameters>`` stay, as numbers,
for the laws of the motion that name them.
"""

from collections.abc import Sequence
from pathlib import Path

from msahl.deck.faults import Element, Faults
from msahl.deck.includes import Parts, merge_parts, unit_system_of
from msahl.deck.overrides import Setting, apply_settings
from msahl.deck.parameters import evaluate_parameters, replace_numbers
from msahl.deck.units import Parameter


def expand(
    root: Element, path: Path, settings: Sequence[Setting], faults: Faults, parts: Parts
) -> dict[str, Parameter]:
    """Expand the tree of the deck at ``path``, with ``settings`` such as ``L=80 cm`` and the files
    of ``parts`` (see ``merge_parts``); return its parameters.

    Raises ``DeckError`` if a part cannot be read, since all that refers to it would be a fault.
    """
    merge_parts(root, path, faults, parts)
    apply_settings(root, settings, faults)
    scope = evaluate_parameters(root, faults)
    replace_numbers(root, unit_system_of(root), scope, faults)
    return scope.parameters()

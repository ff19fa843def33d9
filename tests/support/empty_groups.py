"""Runs kernels as plain Python with the groups that machine code gets for those a model lacks."""

from collections import namedtuple
from typing import Any

import numpy as np

from msahl.jit.arguments import ARRAY, BOOL, FLOAT, INT, NONE, describe
from msahl.jit.general import round_up

_ZEROS = {FLOAT: 0.0, INT: 0, BOOL: False, NONE: None}


def with_empty_groups(arguments):
    """The arguments of a kernel, with groups without entries where its machine code gets them."""
    described = tuple(describe(value) for value in arguments)
    rounded = round_up(described)
    return [_filled(*pair) for pair in zip(arguments, rounded, strict=True)]


def _filled(value: Any, described: Any) -> Any:
    if value is None:
        return _empty(described)
    if not isinstance(value, tuple) or describe(value) == described:
        return value
    if not hasattr(value, "_fields"):
        return tuple(_filled(*pair) for pair in zip(value, described[1], strict=True))
    given = {name: _filled(getattr(value, name), one) for name, one in described[2]}
    return value._replace(**given)


def _empty(described: Any) -> Any:
    if isinstance(described, str):
        return _ZEROS[described]
    if described[0] == ARRAY:
        return np.zeros((0,) * described[2], described[1])
    if described[0] == "tuple":
        return tuple(map(_empty, described[1]))
    fields = described[2]
    kind = namedtuple(described[1], [name for name, _ in fields])
    return kind(*(_empty(one) for _, one in fields))

"""Numbers of many models: each member has what it has alone, or none is read at once."""

import math
import operator

import numpy as np
import pytest

from msahl.algebra.many import (
    Many,
    Unlike,
    apart,
    dist,
    hypot,
    isfinite,
    largest,
    member_of,
    nearest,
    remainder,
)
from msahl.records import record

A, B = Many((1.25, -3.0, 0.1)), Many((7.5, 2.0, -0.3))


@pytest.mark.parametrize("name", ["add", "sub", "mul", "truediv"])
def test_arithmetic_is_that_of_each_member(name):
    apply = getattr(operator, name)
    assert apply(A, B).values == tuple(map(apply, A.values, B.values))
    assert apply(A, 3.0).values == tuple(apply(a, 3.0) for a in A.values)
    assert apply(3.0, A).values == tuple(apply(3.0, a) for a in A.values)


def test_functions_are_those_of_each_member():
    assert hypot(A, 2.0, B).values == tuple(
        math.hypot(a, 2.0, b) for a, b in zip(A.values, B.values, strict=True)
    )
    assert remainder(B, 2.0).values == tuple(math.remainder(b, 2.0) for b in B.values)
    assert largest(A, B, 0.0).values == (7.5, 2.0, 0.1)
    assert dist((A, 0.0, 1.0), (B, 2.0, 1.0)).values == tuple(
        math.dist((a, 0.0, 1.0), (b, 2.0, 1.0)) for a, b in zip(A.values, B.values, strict=True)
    )
    assert nearest(Many((1.0, -2.0))).values == (1.0, -2.0)
    assert abs(-A).values == (1.25, 3.0, 0.1)
    assert apart(lambda pair: pair[0] + len(pair), (A, 1.0)).values == (3.25, -1.0, 2.1)


def test_functions_of_plain_numbers_are_those_of_python():
    assert (hypot(3.0, 4.0), largest(1.0, 2.0), dist((0.0,), (2.0,))) == (5.0, 2.0, 2.0)
    assert apart(max, 1.0, 3.0) == 3.0
    with pytest.raises(TypeError, match="must be real number"):
        hypot("3", 4.0)


def test_what_is_decided_is_decided_alike_for_all():
    assert A < 2.0
    assert not A > 2.0
    assert A != 5.0
    assert isfinite(A)
    for undecided in (lambda: A > 0.0, lambda: A == 0.1, lambda: bool(Many((0.0, 1.0)))):
        with pytest.raises(Unlike):
            undecided()


@pytest.mark.parametrize(
    "take",
    [
        float,
        math.sin,
        str,
        repr,
        "{}".format,
        "{:g}".format,
        lambda x: np.array([x]),
        lambda x: np.ones(2) * x,
    ],
)
def test_what_takes_one_number_takes_no_others(take):
    with pytest.raises(TypeError):
        take(A)


@record
class Body:
    """A record with numbers."""

    name: str
    mass: float
    place: tuple[float, float]


def test_members_are_taken_out_of_records():
    body = Body("Bob", 2.0, (A, 1.0))
    member = member_of((body, {"k": B}, "text", None, np.ones(2)))
    assert member(1)[:2] == (Body("Bob", 2.0, (-3.0, 1.0)), {"k": 2.0})
    same = Body("Rod", 1.0, (0.0, 0.0))
    assert member_of((same, 1.0)) is None
    assert member_of((same, body))(2)[0] is same


@pytest.mark.parametrize("hidden", [[A], {A}])
def test_no_member_is_taken_where_others_may_be_hidden(hidden):
    with pytest.raises(Unlike):
        member_of((1.0, hidden))

"""Kernels for the tests of the compiler; other processes find them by their names."""

import math
from typing import NamedTuple

import numpy as np

from msahl.jit.kernel import choice, kernel, optional, unit


class Inner(NamedTuple):
    table: np.ndarray
    factor: float
    present: bool


class Outer(NamedTuple):
    count: int
    nothing: None
    inner: Inner
    numbers: np.ndarray
    flags: np.ndarray


def outer(rows=2):
    return Outer(
        rows,
        None,
        Inner(np.arange(6.0).reshape(3, 2), 0.5, True),
        np.arange(4),
        np.array([True, False]),
    )


@kernel
def pair(x: float) -> tuple[float, float]:
    return x, 2.0 * x


@unit
def weigh(inner: Inner, x: float) -> float:
    total = 0.0
    for row in range(inner.table.shape[0]):
        total += inner.table[row, 1] * pair(x)[1]
    return total * inner.factor


@optional(1.0)
def scaled(inner: Inner, x: float) -> float:
    return inner.factor * x


@kernel
def everything(
    group: Outer, x: float, out: np.ndarray, wanted: bool, pair: tuple[np.ndarray, float, Inner]
) -> tuple[float, int, bool]:
    for k in range(out.size):
        out[k] = weigh(group.inner, x) + group.numbers[k % group.numbers.size]
        out[k] += pair[0][0] * pair[1] * pair[2].factor
    result = math.sin(x) + scaled(group.inner, x) + scaled(group.nothing, x)
    return result, group.count + group.numbers[1], group.inner.present and group.flags[0] == wanted


@kernel
def twice(x: float) -> float:
    return 2.0 * x


@kernel
def hopeless(x: float) -> float:
    return float(str(x) + "1")


@kernel
def half(row: np.ndarray, x: float) -> tuple[float, float]:
    return 0.5 * row[0] * x, x


@kernel
def square(row: np.ndarray, x: float) -> tuple[float, float]:
    return row[1] * x * x, x


any_of_two = choice(__name__, "any_of_two", (half, square))
same_but_reversed = choice(__name__, "any_of_two", (square, half))


@kernel
def chosen(kind: np.ndarray, table: np.ndarray, out: np.ndarray) -> None:
    for k in range(kind.size):
        out[k] = any_of_two(kind[k], table[k], 3.0)[0]

"""Records are frozen dataclasses to their users, without code generated at every start."""

import copy
import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, dataclass, field, fields, is_dataclass, replace
from functools import cached_property

import pytest

from msahl.records import record


@record
class Point:
    x: float
    name: str = field(default="P", compare=False)
    marks: list[int] = field(default_factory=list, repr=False)


@dataclass(frozen=True, slots=True)
class Plain:
    x: float
    name: str = field(default="P", compare=False)
    marks: list[int] = field(default_factory=list, repr=False)


@record
class Solid(Point):
    z: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        if self.z == (0,):
            raise ValueError("z")


@record
class Lone:
    x: float


@record
class Empty:
    pass


@record(slots=False)
class Lazy:
    x: float

    @cached_property
    def twice(self) -> float:
        return 2.0 * self.x


class Named:
    def __eq__(self, other):
        return isinstance(other, Named)

    def __hash__(self):
        return 7

    def __repr__(self):
        return "named"


@record
class Call(Named):
    x: float


def test_fields_defaults_and_words_are_those_of_a_dataclass():
    one, other = Point(1.0), Plain(1.0)
    assert is_dataclass(Point)
    assert [f.name for f in fields(Point)] == [f.name for f in fields(Plain)]
    assert repr(one) == repr(other).replace("Plain", "Point")
    assert one.marks == []
    assert Point(1.0).marks is not one.marks
    assert Point.__match_args__ == Plain.__match_args__
    assert Point(x=2.0, name="Q") == replace(one, x=2.0)
    assert replace(one, name="Q").name == "Q"


def test_records_are_equal_by_class_and_compared_values():
    assert Point(1.0, "A") == Point(1.0, "B")
    assert Point(1.0) != Point(2.0)
    assert Point(1.0) != Plain(1.0)
    assert Point(1.0) != Solid(1.0)
    assert Lone(1.0) == Lone(1.0) != Lone(2.0)
    assert Empty() == Empty() != Lone(1.0)
    assert hash(Lone(1.0)) == hash(Lone(1.0))
    assert len({Solid(1.0, z=(1,), marks=()), Solid(1.0, z=(1,), marks=())}) == 1
    with pytest.raises(TypeError, match="unhashable"):
        hash(Point(1.0))  # its list


@pytest.mark.parametrize("one", [Point(1.0), Solid(1.0), Lazy(1.0)], ids=repr)
def test_records_cannot_be_changed(one):
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'x'"):
        one.x = 2.0
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'x'"):
        del one.x
    with pytest.raises(FrozenInstanceError):
        one.another = 1.0
    assert one.x == 1.0


def test_slots_are_slots_and_records_without_can_cache():
    assert not hasattr(Point(1.0), "__dict__")
    one = Lazy(1.5)
    assert one.twice == 3.0
    assert one.twice is one.twice


@pytest.mark.parametrize("one", [Point(1.0, "A", [1]), Solid(1.0, z=(2,)), Lazy(1.0), Empty()])
def test_copies_and_pickles_are_equal(one):
    for same in (copy.copy(one), copy.deepcopy(one), pickle.loads(pickle.dumps(one))):
        assert same == one
        assert repr(same) == repr(one)
        assert type(same) is type(one)


def test_constructors_check_their_arguments_as_those_of_dataclasses():
    for kind in (Point, Plain):
        with pytest.raises(TypeError, match=rf"{kind.__name__}.__init__\(\) missing 1 required"):
            kind()
        with pytest.raises(TypeError, match="unexpected keyword argument 'y'"):
            kind(1.0, y=2.0)
    with pytest.raises(ValueError, match="z"):
        Solid(1.0, z=(0,))
    assert Solid(1.0, "A", [], (1,)).z == (1,)


def test_methods_of_the_class_or_its_bases_are_kept():
    assert Call(1.0) == Call(2.0)
    assert hash(Call(1.0)) == 7
    assert repr(Call(1.0)) == "named"
    assert pickle.loads(pickle.dumps(Call(3.0))).x == 3.0


COUNT = """
import builtins
from msahl.records import record
made = []
original = builtins.exec
builtins.exec = lambda *given: (made.append(1), original(*given))[1]
@record
class A:
    x: float
    y: float = 0.0
print(len(made))
A(1.0), A(2.0)
print(len(made) > 0)
before = len(made)
A(3.0)
print(len(made) - before)
"""


def test_no_code_is_generated_before_a_record_is_made_and_then_once():
    command = [sys.executable, "-c", COUNT]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "True", "0"]

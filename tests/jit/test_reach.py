"""The key of compiled code: it changes with all that the code depends on, and with nothing else."""

import types

import pytest

from msahl.elements.constraints import coordinates
from msahl.jit.reach import _reached, own_digest, source_digest
from msahl.schemes.collocation import newton as collocation
from msahl.schemes.midpoint import newton as midpoint
from tests.jit import kernels


def test_a_step_depends_on_what_it_reaches():
    modules, _ = _reached(midpoint.take_steps)
    assert "msahl.schemes.midpoint.newton" in modules
    assert not [name for name in modules if name.startswith(("msahl.study", "msahl.post"))]
    assert not [name for name in modules if ".collocation" in name]


def test_a_unit_is_only_known_by_its_result():
    """A change of the right-hand side of the equations leaves the loop over the steps alone."""
    modules, constants = _reached(midpoint.take_steps)
    assert "msahl.elements.constraints.products" not in modules
    assert any(".take_step -> " in text for text in constants)
    assert "msahl.elements.constraints.products" in _reached(coordinates.evaluate)[0]


def test_entries_have_different_keys():
    assert source_digest(midpoint.take_steps) != source_digest(collocation.take_steps)


def defined(text):
    """A kernel defined by ``text``, in a module of its own."""
    module = types.ModuleType("tests.jit.defined")
    vars(module).update({"pair": kernels.pair, "LIMIT": 3.0})
    exec(text, vars(module))
    return module.function


BASE = "def function(x: float) -> float:\n    return pair(x)[0] + LIMIT\n"


@pytest.mark.parametrize(
    "text",
    [
        'def function(x: float) -> float:\n    """Return it."""\n    return pair(x)[0] + LIMIT\n',
        "def function(x: float) -> float:\n    # why\n    return pair(x)[0] + LIMIT\n",
    ],
)
def test_comments_do_not_matter(text):
    assert own_digest(defined(text)) == own_digest(defined(BASE))


@pytest.mark.parametrize(
    "text",
    [
        BASE.replace("[0]", "[1]"),
        BASE.replace("+", "-"),
        BASE.replace("pair(x)", "pair(x + 1.0)"),
        "LIMIT = 4.0\n" + BASE,
    ],
)
def test_code_and_constants_matter(text):
    assert own_digest(defined(text)) != own_digest(defined(BASE))


def test_another_function_of_the_same_name_matters():
    """Where only an import changes, the bytecode is the same."""
    function, other = defined(BASE), defined(BASE)

    def pair(x: float) -> tuple[float, float]:
        return x, x

    pair.__module__, pair.__qualname__ = "tests.jit.other", kernels.pair.__qualname__
    other.__globals__["pair"] = pair
    assert own_digest(other) != own_digest(function)


def test_a_choice_depends_on_its_functions_and_their_order():
    modules, constants = _reached(kernels.chosen)
    assert "tests.jit.kernels" in modules
    assert any(".half -> " in text for text in constants)
    assert source_digest(kernels.any_of_two) != source_digest(kernels.same_but_reversed)
    assert own_digest(kernels.any_of_two) != own_digest(kernels.same_but_reversed)

"""No formula stands twice in the packages that state laws (``tools/laws.py``)."""

import ast

from tools.laws import laws, shape, stated_twice

KINETIC = "def energy(m, v):\n    return 0.5 * m[0] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])"


def parsed(text):
    return ast.parse(text).body[0]


def test_no_formula_stands_twice():
    assert not stated_twice()


def test_names_do_not_matter_and_numbers_do():
    renamed = KINETIC.replace("m[", "mass[").replace("(m,", "(mass,").replace("energy", "T")
    assert shape(parsed(KINETIC)) == shape(parsed(renamed)) != ""
    assert shape(parsed(KINETIC)) != shape(parsed(KINETIC.replace("0.5", "0.25")))


def test_the_list_has_every_law_of_force_and_joint_and_every_constraint_function():
    places = dict(laws())
    assert places["force drag"].startswith("msahl/laws/drag.py:")
    assert places["joint revolute"].startswith("msahl/joints/revolute.py:")
    functions = [place for law, place in places.items() if law.startswith("constraint function")]
    assert {place.partition(":")[0] for place in functions} == {
        "msahl/elements/beams/strain.py",
        "msahl/elements/constraints/coincide.py",
        "msahl/elements/constraints/coordinate_kinds.py",
        "msahl/elements/constraints/products.py",
    }

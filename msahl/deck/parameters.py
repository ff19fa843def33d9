"""Values of the parameters of a deck, and of the numbers that are expressions of them.

Everything is replaced in the tree: a number in braces by its value in the unit of its element, as
the shortest decimal that is read back to the same double. So what is read from the tree afterwards
is a deck of plain numbers, and what runs is the same, to the bit, as if they had been written.
"""

from collections.abc import Collection, Mapping
from dataclasses import field
from fractions import Fraction
from functools import partial
from typing import cast

from msahl.algebra.many import Many, Unlike, each, isfinite
from msahl.check.names import FORBIDDEN
from msahl.deck.faults import Element, Faults, attribute, collapsed, text
from msahl.deck.schema_types import FRACTION, NUMBERS, Content, types, with_text
from msahl.deck.units import (
    DEFAULTS,
    UNITS,
    Parameter,
    Unit,
    dimension_of,
    from_si,
    parse_unit,
    to_si_by,
)
from msahl.expressions.dimensions import ANGLE, PURE, Dimension, dimension
from msahl.expressions.evaluate import evaluate
from msahl.expressions.order import in_order, shown_circle
from msahl.expressions.syntax import (
    RESERVED,
    ExpressionError,
    Name,
    Tree,
    check_names,
    inside_braces,
    nearest,
    parse,
    postorder,
)
from msahl.records import record

LONGEST = 80
"""Characters of an expression that a message repeats."""


@record
class Scope:
    """What expressions in numbers may name: parameters with their values in SI and dimensions.
    ``faulty`` are the names of those that have a fault. ``computed`` are the texts in braces that
    were evaluated so far, since most of a deck recur."""

    values: dict[str, float] = field(default_factory=dict)
    dimensions: dict[str, Dimension] = field(default_factory=dict)
    faulty: set[str] = field(default_factory=set)
    computed: dict[str, "Value"] = field(default_factory=dict)

    def add(self, name: str, parameter: Parameter) -> None:
        """Add a parameter."""
        self.values[name], self.dimensions[name] = parameter.value, parameter.dimension

    def parameters(self) -> dict[str, Parameter]:
        """Return all parameters; those with a fault are zero, so that they are known."""
        known = {name: Parameter(v, self.dimensions[name]) for name, v in self.values.items()}
        return known | dict.fromkeys(self.faulty, Parameter(0.0, PURE))

    def compute(self, tree: Tree) -> tuple[float, Dimension]:
        """Return the value of an expression in SI and its dimension; raises ``ExpressionError``."""
        has = dimension(tree, self.dimensions, constants=self.values)
        return _evaluated(tree, self.values), PURE if has is None else has


def _evaluated(tree: Tree, values: Mapping[str, float]) -> float:
    """Return the value of an expression; of many models, if it names numbers of them."""
    names = sorted(_names(tree))
    given = [values[name] for name in names if name in values]
    if not any(isinstance(value, Many) for value in given):
        return evaluate(tree, values)

    def of_one(*numbers: float) -> float:
        return evaluate(tree, {**values, **dict(zip(names, numbers, strict=True))})

    return cast(float, each(of_one, *given))


def evaluate_parameters(root: Element, faults: Faults) -> Scope:
    """Return the parameters of a tree; their expressions are replaced by numbers."""
    elements = _named(root, faults)
    trees: dict[str, Tree] = {}
    for name, element in elements.items():
        if faults.sound(element):
            tree = _parsed(element, element.text or "", elements, faults)
            if tree is not None:
                trees[name] = tree
    scope = Scope()
    for name in _in_order(elements, trees, faults):
        element = elements[name]
        usable = faults.sound(element)
        if usable and name in trees:
            usable = not _names(trees[name]) & scope.faulty
            usable = usable and _evaluate(element, trees[name], scope, faults)
        if usable and not isfinite(_read(element, faults).value):
            faults.add(element, f"{text(element)} is too large; give a smaller number")
            usable = False
        if usable:
            scope.add(name, _read(element, faults))
        else:
            scope.faulty.add(name)
    return scope


def _read(element: Element, faults: Faults) -> Parameter:
    """Return a parameter whose value is a number, and whose unit has been checked."""
    unit = parse_unit(attribute(element, "units", "1"))
    assert unit is not None
    return Parameter(to_si_by(faults.number(element), unit.factor), unit.dimension)


def _named(root: Element, faults: Faults) -> dict[str, Element]:
    """Return the elements of the parameters by name; check names and units."""
    elements: dict[str, Element] = {}
    for element in root.iterfind("parameters/parameter"):
        name = attribute(element, "name")
        first = elements.setdefault(name, element)
        if not faults.sound(element):
            continue
        if first is not element:
            where = faults.line_in_words(first)
            faults.add(element, f"the name is taken by {where}; choose another")
            faults.doubt(first)  # which of the two is meant is not known
        if name in RESERVED:
            faults.add(element, f"'{name}' has a meaning of its own in expressions; choose another")
        if not name.isprintable() or not FORBIDDEN.isdisjoint(name):
            faults.add(element, "a name must be printable, without , ; and quotes; choose another")
        units = attribute(element, "units")
        if units and parse_unit(units) is None:
            faults.add(element, unknown_unit(units))
    return elements


def unknown_unit(units: str) -> str:
    """Return the message for a text that is no unit."""
    known = {unit: None for factors in UNITS.values() for unit in factors}
    near = nearest(units, known)
    form = "a unit is a product such as N-m-s/rad or kg/m^3"
    return f"unknown unit '{units}'{near if 'did you mean' in near else f'; {form}'}"


def _in_order(
    elements: Mapping[str, Element], trees: Mapping[str, Tree], faults: Faults
) -> list[str]:
    """Return the names of all parameters, each after those it is computed from; circles become
    faults, and what depends on them becomes doubtful."""
    graph = {name: _names(trees[name]) if name in trees else set() for name in elements}
    order, circles = in_order(graph)
    for circle in circles:
        message = f"its value depends on itself: {shown_circle(circle)}; give one of them a number"
        faults.add(elements[circle[0]], message)
    rest = graph.keys() - set(order)
    for name in rest:
        faults.doubt(elements[name])
    return [*order, *rest]


def _names(tree: Tree) -> set[str]:
    return {node.text for node in postorder(tree) if isinstance(node, Name)}


def _parsed(element: Element, given: str, known: Collection[str], faults: Faults) -> Tree | None:
    """Return the tree of a text in braces; None for a number, or with a fault."""
    inside = inside_braces(given)
    if inside is None:
        return None
    try:
        tree = parse(inside)
        check_names(tree, known)
    except ExpressionError as error:
        faults.add(element, partial(in_words, given, error))
        return None
    return tree


def in_words(given: str, error: ExpressionError) -> str:
    """Return what is wrong with a text in braces."""
    shown = collapsed(given)
    if len(shown) > LONGEST:
        shown = f"{shown[:LONGEST]}..."
    return f"in {shown}: {error.message} (at column {error.column} of the expression)"


def _evaluate(element: Element, tree: Tree, scope: Scope, faults: Faults) -> bool:
    """Replace the expression of a parameter by its value, and state its unit; return whether there
    was no fault."""
    given, units = element.text or "", attribute(element, "units")
    try:
        value, has = scope.compute(tree)
    except ExpressionError as error:
        faults.add(element, partial(in_words, given, error))
        return False
    if has.rad.denominator > 1:
        has = has._replace(rad=Fraction(0))
    unit = parse_unit(units or str(has)) if units or has != PURE else parse_unit("1")
    if unit is None:
        faults.add(element, f"{collapsed(given)} is {has}, which no unit measures")
    elif units and has != PURE and not has.fits(unit.dimension):
        message = f"{collapsed(given)} is {has}, which '{units}' does not measure"
        faults.add(element, f"{message}; correct one of them")
    elif _write(element, "", from_si(value, unit.factor) if has != PURE else value, faults):
        if has != PURE and not units:
            element.set("units", str(has))
        return True
    return False


def replace_numbers(root: Element, unit_system: str, scope: Scope, faults: Faults) -> None:
    """Replace all numbers in braces by their values; those that name a parameter with a fault
    become doubtful, without a fault of their own."""
    for element in with_text(root, "{"):
        content = types().content(element)
        if element.tag == "parameter" or not faults.sound(element):
            continue
        if content.is_number and inside_braces(element.text or "") is not None:
            found = _value(element, element.text or "", scope, faults)
            if found is not None:
                _replace_text(element, content, unit_system, found, faults)
        for name, kind in content.attributes.items():
            given = element.get(name)
            if kind in NUMBERS and given is not None and inside_braces(given) is not None:
                found = _value(element, given, scope, faults)
                if found is not None:
                    _replace_attribute(element, name, kind, found, faults)


Value = tuple[float, Dimension]
"""A value in SI and its dimension."""


def _value(element: Element, given: str, scope: Scope, faults: Faults) -> Value | None:
    """Return the value of a text in braces; None if there is none."""
    if given in scope.computed:
        return scope.computed[given]
    known = scope.dimensions | dict.fromkeys(scope.faulty, PURE) if scope.faulty else scope.values
    tree = _parsed(element, given, known, faults)
    if tree is None:
        return None
    if _names(tree) & scope.faulty:
        faults.doubt(element)
        return None
    try:
        scope.computed[given] = scope.compute(tree)
    except ExpressionError as error:
        faults.add(element, partial(in_words, given, error))
        return None
    return scope.computed[given]


def _replace_text(
    element: Element, content: Content, unit_system: str, found: Value, faults: Faults
) -> None:
    """Replace the text of an element by its value in the element's units."""
    value, has = found
    if has != PURE:
        unit = _unit(element, content, unit_system, has)
        if isinstance(unit, str):
            faults.add(element, f"{text(element)} is {has}; {unit}")
            return
        value = from_si(value, unit.factor)
    if content.text != FRACTION or _is_fraction(element, value, faults):
        _write(element, "", value, faults)


def _unit(element: Element, content: Content, unit_system: str, has: Dimension) -> Unit | str:
    """Return the unit in which an element takes a value with a dimension; or what it expects."""
    units = attribute(element, "units")
    if units:
        unit = parse_unit(units)
        if unit is None or not has.fits(unit.dimension):
            return f"expected what '{units}' measures"
        return unit
    per_second = _coefficient_unit(element, content, unit_system, has)
    if per_second is not None:
        return per_second
    quantities = content.quantities
    fitting = [q for q in quantities if has.fits(dimension_of(q))]
    if fitting:
        name = DEFAULTS[unit_system][fitting[0]]
        if any(not dimension_of(q).fits(dimension_of(fitting[0])) for q in quantities):
            element.set("units", name)  # the reader checks that it is the right one here
        return Unit(UNITS[fitting[0]][name], has)
    if not quantities and has.fits(PURE):
        return Unit(Fraction(1), has)
    wanted = " or ".join(dict.fromkeys(str(dimension_of(q)) for q in quantities))
    return f"expected {wanted or 'a pure number'}"


def _coefficient_unit(
    element: Element, content: Content, unit_system: str, has: Dimension
) -> Unit | str | None:
    """Return the unit of a polynomial's coefficient of t^k, k > 0, without ``units``; None for any
    other element. It is the unit of a law over s^k, and without rad may be of a plain number."""
    k = next((k for k in range(1, 6) if f"rad/s{f'^{k}' if k > 1 else ''}" in content.units), 0)
    if not k or "m" not in content.units or element.tag != f"c{k}":
        return None
    per_second = Dimension(s=Fraction(-k))
    if has.fits(per_second) and not has.rad:
        return Unit(Fraction(1), has)
    for quantity in ("angle", "length"):
        if has.fits(dimension_of(quantity).times(per_second)):
            name = DEFAULTS[unit_system][quantity]
            element.set("units", f"{name}/sec{'' if k == 1 else f'^{k}'}")
            return Unit(UNITS[quantity][name], has)
    return f"expected {ANGLE.times(per_second)} or {dimension_of('length').times(per_second)}"


def _replace_attribute(
    element: Element, name: str, kind: str, found: Value, faults: Faults
) -> None:
    """Replace an attribute by its value, in the element's ``units`` if it has some."""
    value, has = found
    if has != PURE:
        units = attribute(element, "units", "1")
        unit = parse_unit(units)
        if unit is None or not has.fits(unit.dimension):
            wanted = f"what '{units}' measures" if units != "1" else "a pure number"
            faults.add(element, f"{name}={attribute(element, name)} is {has}; expected {wanted}")
            return
        value = from_si(value, unit.factor)
    if kind != FRACTION or _is_fraction(element, value, faults):
        _write(element, name, value, faults)


def _is_fraction(element: Element, value: float, faults: Faults) -> bool:
    if not 0.0 <= value <= 1.0:
        faults.add(element, f"the expression is {value:g}; it goes from 0 to 1")
        return False
    return True


def _write(element: Element, name: str, value: float, faults: Faults) -> bool:
    """Write a value into the attribute ``name``, or the text, of an element; return whether it is
    finite in its units."""
    if not isfinite(value):
        faults.add(element, "the value of the expression is too large in its units")
        return False
    value += 0.0  # no minus before a zero
    if isinstance(value, Many):
        if name:
            raise Unlike
        faults.set_many(element, value)
        return True
    shortest = repr(value)
    if name:
        element.set(name, shortest)
    else:
        element.text = shortest
    return True

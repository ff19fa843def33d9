"""Whatever an expression, a parameter or an include: a fault in words, or finite numbers."""

import math

import pytest
from hypothesis import strategies as st

from msahl.deck import read_deck
from msahl.expressions.dimensions import dimension
from msahl.expressions.evaluate import evaluate
from msahl.expressions.syntax import FUNCTIONS, ExpressionError, parse, renamed
from tests.fuzz.guard import TRAPS
from tests.fuzz.test_fuzz import Example, is_judged, over
from tests.support.effective import effective_deck

NAMES = {"L": 0.5, "m": 2.0, "Crank.angle": -1e300, "x y": 0.0, "lambda": 1e-300}
UNITS = ["", "m", "cm", "kg/m^3", "rad/s", "N-m/rad", "parsec", "1", "m^", "s^-1", "-", "A"]

WORDS = st.sampled_from([
    "+", "-", "*", "/", "^", "(", ")", ",", "<", "<=", "==", "!=", "and", "or", "not", "pi", "t",
    "0", "1", "2.5", "1e-3", "1e308", ".5", "7e999", "L", "m", "Crank.angle", "'x y'", "lambda",
    " ", "__class__", "L.__dict__",
    "{", "}", "'", '"', "[", "]", "lambda:", "\0", "µ", "²", ";", "**",
    *FUNCTIONS,
])  # fmt: skip


def calls(inner):
    """Trees of operations, as text."""
    functions = st.sampled_from(sorted(FUNCTIONS.items()))
    return st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from("+-*/^<"), inner),
        st.builds("-{}".format, inner),
        functions.flatmap(
            lambda f: st.lists(inner, min_size=f[1], max_size=f[1]).map(
                lambda given: f"{f[0]}({', '.join(given)})"
            )
        ),
    )


NUMBERS = st.floats(allow_nan=False, allow_infinity=False).map(lambda x: repr(abs(x)))
GOOD = st.recursive(st.one_of(st.sampled_from(["L", "m", "2", "pi", "0"]), NUMBERS), calls)
TEXTS = st.one_of(st.lists(WORDS, max_size=40).map("".join), GOOD, st.text(max_size=60))


def read_or_fault(text, make):
    """What ``make`` returns, or None with a fault at a place in the text."""
    try:
        return make()
    except ExpressionError as error:
        fault = error
    assert 1 <= fault.column <= len(text) + 1
    assert fault.message
    return None


@pytest.mark.slow
@over(TEXTS, 400, 0.1)
def test_texts_of_expressions(text):
    """A value that is finite, or an error at a column of the text; the same with other names."""
    tree = read_or_fault(text, lambda: parse(text))
    if tree is None:
        return "no expression"
    assert parse(renamed(text, lambda name: name)) == tree
    read_or_fault(text, lambda: dimension(tree, dict.fromkeys(NAMES), None))
    value = read_or_fault(text, lambda: evaluate(tree, NAMES))
    assert value is None or math.isfinite(value)
    return "no value" if value is None else "a value"


def escaped(text):
    return "".join(
        {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;"}.get(c, c)
        for c in text
        if c >= " " and c.isprintable()
    )


def parameter(name, units, value):
    units = f' units="{units}"' if units else ""
    return f'<parameter name="{escaped(name)}"{units}>{escaped(value)}</parameter>'


IN_BRACES = st.one_of(GOOD, TEXTS).map("{{{}}}".format)
VALUES = st.one_of(IN_BRACES, NUMBERS, st.sampled_from(["{L}", "{q}", "3", "{p*L}", "{L/2}"]))
USUAL = parameter("L", "m", "2") + parameter("m", "kg", "{3*k}") + parameter("k", "kg", "1")
PARAMETERS = st.lists(
    st.builds(parameter, st.sampled_from(["L", "m", "p", "q", "x y", "sin", ""]),
              st.sampled_from(UNITS), VALUES), max_size=5,
).map("".join)  # fmt: skip
"""Others, beside the usual ones or instead of them."""
HREFS = st.one_of(
    st.sampled_from([
        "part.xml", "deck.xml", ".", "..", "../deck.xml", "/etc/passwd", str(TRAPS.pipe),
        TRAPS.address, "file:///etc/passwd", "//host/x", "part.xml/..", "%2e%2e/x", "C:\\x", "~/x",
    ]),
    st.text(max_size=10),
)  # fmt: skip


def include(href, prefix, name, value):
    given = f'<set name="{escaped(name)}">{escaped(value)}</set>'
    return f'<include href="{escaped(href)}" prefix="{escaped(prefix)}">{given}</include>'


INCLUDES = st.lists(
    st.builds(include, HREFS, st.sampled_from(["", "A.", "é", "a,b"]),
              st.sampled_from(["L", "m", "z"]), VALUES), max_size=2,
).map(lambda some: f"<includes>{''.join(some)}</includes>" if some else "")  # fmt: skip

DECK = """<data><parameters>{}</parameters>{}<system><bodies><ground><name>Base</name></ground>
<rigidBody><name>Bob</name><mass>{}</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
<initialConditions><position><x>{}</x></position></initialConditions></rigidBody></bodies></system>
<simulation damping="{}"><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation></data>"""
PART = """<part><parameters>{}</parameters><system><bodies><rigidBody><name>Bob</name>
<mass>{}</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi></rigidBody></bodies></system></part>"""


def deck(parameters, includes, mass, x, damping):
    return DECK.format(parameters, includes, *map(escaped, (mass, x, damping))).encode()


PLAIN = st.one_of(VALUES, st.just("0.5"))


def lengths(inner):
    """Expressions of lengths that are lengths."""
    pairs = (
        "({} + {})",
        "max({}, {})",
        "hypot({}, {})",
        "where({} < {}, 0, L)",
        "step(1, 0, {}, 2, {})",
    )
    single = ("({})^2/L", "sqrt({}*L)", "-({})")
    return st.one_of(
        *(st.builds(form.format, inner, inner) for form in pairs),
        *(st.builds(form.format, inner) for form in single),
    )


LENGTHS = st.recursive(st.sampled_from(["L", "2*L", "L/pi"]), lengths, max_leaves=5)
LENGTHS = LENGTHS.map("{{{}}}".format)
DECKS = st.one_of(
    st.builds(deck, PARAMETERS, INCLUDES, PLAIN, PLAIN, PLAIN),
    st.builds(deck, st.just(USUAL), st.just(""), st.sampled_from(["{m}", "{2*m}", "{7}"]),
              st.one_of(LENGTHS, PLAIN), st.sampled_from(["{k/m}", "0.1", "{sin(L/L)}"])),
)  # fmt: skip


@pytest.mark.slow
@over(DECKS, 150, 0.1)
def test_decks_with_expressions(data):
    """The deck that ran reads as the same model, without parts, and is written as it is."""
    end = is_judged(data)
    if end == "good":
        with Example(data) as example:
            model, text = example.model(), effective_deck(example.deck)
            example.deck.write_bytes(text)
            assert read_deck(example.deck) == model
            assert effective_deck(example.deck) == text
    return end


ONE_PART = """<includes><include href="part.xml" prefix="P."><set name="L" units="cm">{L}</set>
</include></includes>"""
OF_PARTS = st.tuples(
    st.one_of(INCLUDES, st.just("")),
    st.one_of(PARAMETERS, st.just(USUAL)),
    st.one_of(PLAIN, st.sampled_from(["{m}", "{m*L/L}"])),
)


@over(OF_PARTS, 100, 0.05)
def test_parts(given):
    """A part beside the deck is read, and no other file is opened."""
    includes, parameters, mass = given
    includes = includes.replace("<includes>", ONE_PART.removesuffix("</includes>")) or ONE_PART
    data = deck(USUAL, includes, "{m}", "{L}", "0.5")
    with Example(data) as example:
        (example.folder / "part.xml").write_text(PART.format(parameters, escaped(mass)))
        return "refused" if example.model() is None else "good"


SETTINGS = st.one_of(
    st.builds("{}={}".format, st.sampled_from(["L", "Bob.mass", "deltaT", "x", "Bob.x"]), VALUES),
    st.text(max_size=20),
)


@over(st.lists(SETTINGS, max_size=3), 100, 0.05)
def test_settings(changes):
    """Changes of numbers by options."""
    data = DECK.format(parameter("L", "m", "2"), "", "3", "{L/2}", "0.5").encode()
    with Example(data) as example:
        model = example.model(changes)
        if model is None:
            return "refused"
        example.deck.write_bytes(effective_deck(example.deck, settings=changes))
        assert read_deck(example.deck) == model
        return "good"

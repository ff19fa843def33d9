"""Faults in expressions of the motion: each is a message with its place, and never a traceback."""

import random
import re

import pytest

from msahl.deck import DeckError, ParsedDeck, Source, read_deck
from msahl.expressions.syntax import parse
from msahl.model.signals import SignalState

DECK = """<data>
  <parameters><parameter name="k" units="N/m">50</parameter></parameters>
  <system>
    <bodies>
      <ground><name>G</name></ground>
      <rigidBody>
        <name>A</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
      </rigidBody>
    </bodies>
    <joints>
      <prismatic>
        <name>S</name>
        <parent><name>G</name><axis><x>1</x></axis></parent>
        <child><name>A</name></child>
      </prismatic>
    </joints>
    <markers><marker><name>My mark</name><body>A</body></marker></markers>
    <signals>
      <signal name="pull" units="m">{SIGNAL}</signal>
      <state name="sum" units="m-s">{pull}</state>
      <table name="curve" units="N"><x units="m">0 1</x><values>0 2</values></table>
    </signals>
    <loads>
      <actuator>
        <name>Motor</name><joint>S</joint><coordinate>slide</coordinate>
        <expression>{FORCE}</expression>
      </actuator>
    </loads>
  </system>
  <simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>"""
GOOD = "curve(pull) + k*S.slide*sin(t) - 3*'My mark'.vx"


def read(folder, force=GOOD, signal="0.1 - S.slide"):
    path = folder / "deck.xml"
    text = DECK.replace("SIGNAL", signal).replace("FORCE", force)
    path.write_text(text.replace(" < ", " &lt; "))
    return read_deck(path)


def with_input(folder, attributes, force="push"):
    path = folder / "deck.xml"
    text = DECK.replace("SIGNAL", "0.1 - S.slide").replace("FORCE", force)
    path.write_text(text.replace("<signals>", f"<signals><input {attributes}/>"))
    return read_deck(path)


def test_an_input_is_a_state_that_keeps_its_value(tmp_path):
    model = with_input(tmp_path, 'name="push" units="N" value="-2.5"')
    assert model.states[0] == SignalState("push", parse("0"), -2.5, "N", is_input=True)
    assert with_input(tmp_path, 'name="push"').states[0].initial == 0.0
    assert ParsedDeck(Source.of_model(model)).model().signals == model.signals


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ('name="push" units="m"', "the expression is m, and kg-m/s^2 is needed"),
        ('name="push" units="kN"', "expressions of the motion are in SI; give"),
        ('name="push" units="parsec"', "unknown unit 'parsec'"),
        ('name="pull"', "the name is taken by"),
        ('name="push" value="x"', "value"),
        ('name="push" initial="1"', "initial"),
    ],
)
def test_faults_of_inputs(attributes, message, tmp_path):
    with pytest.raises(DeckError, match=re.escape(message)):
        with_input(tmp_path, attributes)


def test_the_deck_without_faults_is_read(tmp_path):
    model = read(tmp_path)
    assert [signal.name for signal in model.signals] == ["pull", "sum", "curve"]


FAULTS = {
    "unknown name": ("k*pul", "unknown name 'pul'; did you mean pull?"),
    "unknown value": ("k*S.angle", "unknown name 'S.angle'; known here: t, S.slide"),
    "unknown joint": ("k*X.slide", "unknown name 'X.slide'; did you mean S.slide"),
    "dimensions": ("k + pull", "'+' joins kg/s^2 and m; both must have the same dimension"),
    "dimension of the value": ("k*pull*S.slide", "the expression is kg-m^2/s^2, and kg-m/s^2 is"),
    "signal called": ("pull(2)", "'pull' is no function; to multiply write pull*(...)"),
    "unknown function": ("curv(2)", "unknown function 'curv'; did you mean curve"),
    "python": ("__import__('os')", "unknown function '__import__'"),
    "arguments of a table": ("curve(1, 2)", "'curve' has 1 arguments, not 2"),
    "argument's dimension": ("curve('My mark'.vx)", "an argument of 'curve' is m, not m/s"),
    "unfinished": ("k*pull +", "the expression ends too early"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_has_its_place_and_a_remedy(name, tmp_path):
    force, message = FAULTS[name]
    with pytest.raises(DeckError) as caught:
        read(tmp_path, force)
    (fault,) = caught.value.faults
    assert "load 'Motor', expression" in str(caught.value)
    assert message in str(fault)


def test_signals_that_depend_on_each_other_are_a_fault(tmp_path):
    with pytest.raises(DeckError, match=r"the signal depends on itself.*make one of them a"):
        read(tmp_path, signal="pull*2")


NAMES = ("t", "k", "pull", "sum", "S.slide", "S.slideRate", "'My mark'.x", "S.Fx", "X.y", "pi")
WORDS = (
    *NAMES,
    *"()()+-*/^,'",
    "1",
    "1e300",
    " < ",
    "==",
    "and",
    "not",
    "sin(",
    "curve(",
    "where(",
)
CALLS = (("sin", 1), ("where", 3), ("step", 5), ("min", 2), ("hypot", 2), ("curve", 1), ("pull", 1))


def expression(rng, depth=0):
    """A random expression: names and numbers combined by operators and functions."""
    choice = rng.random()
    if depth > 4 or choice < 0.3:
        return rng.choice((*NAMES, "1", "0", "2.5"))
    if choice < 0.7:
        sign = rng.choice(("+", "-", "*", "/", "^", "<", "==", "or"))
        return f"({expression(rng, depth + 1)} {sign} {expression(rng, depth + 1)})"
    function, count = rng.choice(CALLS)
    return f"{function}({', '.join(expression(rng, depth + 1) for _ in range(count))})"


@pytest.mark.parametrize("seed", range(4))
def test_any_expression_is_read_or_refused(seed, tmp_path):
    rng = random.Random(seed)
    messages = []
    for _ in range(60):
        words = " ".join(rng.choice(WORDS) for _ in range(rng.randint(1, 9)))
        text = expression(rng) if rng.random() < 0.7 else words
        try:
            read(tmp_path, **{rng.choice(("force", "signal")): text})
        except DeckError as error:
            messages.append(str(error))
    assert 0 < len(messages) < 60
    assert max(map(len, messages)) < 2000

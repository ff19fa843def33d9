"""Parameters: values, units, faults with line and remedy; the same model as with numbers."""

import math

import pytest

from msahl.deck import DeckError, listed_parameters, read_deck
from tests.support.effective import effective_deck

DECK = """\
<data>
  <parameters>
{parameters}
  </parameters>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Rod</name>
        <mass units="{mass_units}">{mass}</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions>
          <position basis="Base"><x{x_units}>{x}</x></position>
          <orientation>
            <eulerRotation><phi units="deg">{phi}</phi><u2>{u}</u2></eulerRotation>
          </orientation>
          <angularVelocity><omega2 units="rpm">{omega}</omega2></angularVelocity>
        </initialConditions>
      </rigidBody>
    </bodies>
  </system>
  <simulation damping="{damping}"><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>
"""
PARAMETERS = """\
<parameter name="L" units="cm">80</parameter>
<parameter name="r" units="mm">10</parameter>
<parameter name="rho" units="g/cm^3">7.8</parameter>
<parameter name="m">{rho*pi*r^2*L}</parameter>
<parameter name="a" units="deg">30</parameter>
<parameter name="w" units="Hz">2</parameter>
<parameter name="n">3</parameter>"""


def deck(**given):
    usual = {"parameters": PARAMETERS, "mass": "2", "mass_units": "kg", "x": "0", "phi": "0"}
    usual |= {"u": "1", "omega": "0", "damping": "0.5", "x_units": ""}
    return DECK.format(**(usual | given))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "deck.xml"


@pytest.fixture
def rod(path):
    def read(**given):
        path.write_text(deck(**given))
        return read_deck(path).bodies[0]

    return read


@pytest.fixture
def faults(path):
    def read(**given):
        path.write_text(deck(**given))
        with pytest.raises(DeckError) as error:
            read_deck(path)
        return [str(fault).removeprefix(f"{path}:") for fault in error.value.faults]

    return read


def test_values_have_the_units_of_their_elements(rod):
    mass = 7800.0 * math.pi * 0.01**2 * 0.8
    # Four operations, each rounded once.
    assert rod(mass="{m}").mass == pytest.approx(mass, rel=1e-15)
    assert rod(mass="{m}", mass_units="g").mass == pytest.approx(mass, rel=1e-15)
    assert rod(x="{L/2}").position[0] == 0.4
    assert rod(x="{L/2}", x_units=' units="in"').position[0] == 0.4
    assert rod(x="{2*n}", x_units=' units="mm"').position[0] == 0.006  # a pure number
    assert rod(omega="{w}").angular_velocity[1] == pytest.approx(4.0 * math.pi, rel=1e-15)
    assert rod(omega="{30*n}").angular_velocity[1] == pytest.approx(3.0 * math.pi, rel=1e-15)


def test_an_angle_is_not_taken_for_a_pure_number(rod):
    """A parameter in deg is an angle, whatever the unit of the element; 30 is in its unit."""
    assert rod(phi="{a}") == rod(phi="30") == rod(phi="{30}")
    assert rod(phi="{asin(0.5)}").orientation == pytest.approx(rod(phi="30").orientation, rel=1e-15)
    assert rod(phi="{2*a}") == rod(phi="60")


def test_expressions_stand_in_attributes_and_plain_numbers(rod, path):
    rod(u="{n - 1}", damping="{1/n}")
    assert read_deck(path).simulation.damping == 1.0 / 3.0


def test_white_space_and_references_to_characters(rod):
    assert rod(x=" {\n L\n /2 } ").position[0] == 0.4
    assert rod(x="&#123;L/2&#125;").position[0] == 0.4


def test_a_parameter_deck_is_the_deck_with_the_numbers_written_in(rod, path):
    parameters = rod(mass="{m}", x="{L/2}", phi="{a}", omega="{w/n}", damping="{n/4}")
    text = effective_deck(path)
    path.write_bytes(text)
    assert read_deck(path).bodies[0] == parameters
    assert effective_deck(path) == text
    mass, omega = f"{parameters.mass!r}", "40"
    written = rod(mass=mass, x="0.4", phi="30", omega=omega, damping="0.75", parameters="")
    assert written == parameters


def test_the_deck_that_ran_has_the_expressions_in_comments(rod, path):
    rod(mass="{m}", x="{L--L}", damping="{1/4}")
    text = effective_deck(path).decode()
    assert "<!-- {m} -->" in text
    assert "<x>1.6</x><!-- {L- -L} -->" in text
    assert '<simulation damping="0.25">' in text
    assert '<!-- damping="{1/4}" -->' in text
    assert '<parameter name="L" units="cm">80</parameter>' in text
    assert listed_parameters(text.encode())["a"] == {"value": 30.0, "units": "deg"}
    assert listed_parameters(text.encode())["m"]["units"] == "kg"


def test_a_title_in_braces_is_a_title(path):
    path.write_text(deck().replace("<deltaT>", "<title>{L}</title><deltaT>"))
    assert read_deck(path).simulation.title == "{L}"


def test_parameters_may_come_in_any_order_and_have_any_name(rod):
    parameters = """<parameter name="b">{'c 1'/2}</parameter>
    <parameter name="c 1" units="m">{lambda}</parameter><parameter name="lambda">5</parameter>
    <parameter name="FL.side">{b}</parameter>"""
    assert rod(parameters=parameters, x="{FL.side}").position[0] == 2.5


def test_the_unit_system_holds_for_pure_numbers_only(path):
    text = deck(mass_units="slug", x="{L}", omega="{n}").replace(
        "<parameters>", "<unitSystem>US</unitSystem><parameters>"
    )
    path.write_text(text)
    assert read_deck(path).bodies[0].position[0] == 0.8
    path.write_text(text.replace("{L}", "{n}"))
    assert read_deck(path).bodies[0].position[0] == pytest.approx(3 * 0.3048, rel=1e-15)


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ('name="x">{x}', "its value depends on itself: x -> x; give one of them a number"),
        ('name="x">{2*lenght}', "in {2*lenght}: unknown name 'lenght'; known"),
        ('name="x">{1/(n-3)}', "division by zero"),
        ('name="x">{exp(1000)}', "too large"),
        ('name="x">{L + m}', "'+' joins m and kg; both must have the same dimension"),
        ('name="x">{L + 1}', "joins m and a pure number"),
        ('name="x" units="kg">{L}', "{L} is m, which 'kg' does not measure"),
        ('name="x" units="lenghts">1', "unknown unit 'lenghts'; a unit is a product"),
        ('name="x" units="rad/sek">1', "did you mean rad/sec"),
        ('name="x">{sqrt(L)}', "which no unit measures"),
        ('name="x">{L', "'{L' is not a finite number such as 2, -0.5 or 1.5e-3; an expression is"),
        ('name="x">L/2', "an expression is written in braces"),
        ('name="x">{}', "the expression is empty"),
        ('name="L">1', "the name is taken by line 3"),
        ('name="x" units="">1', "attribute units is empty; give a unit, or delete it"),
        ('name="rho">1', "the name is taken by line"),
        ('name="x">1e400', "1e400 is too large"),
        ('name="sin">1', "has a meaning of its own"),
        ('name="t">1', "has a meaning of its own"),
        ('name="a,b">1', "must be printable"),
        (">1", "attribute name is missing"),
        ('name="x" units="m">{__import__("os")}', '\'__import__("os")'),
    ],
)
def test_faults_of_parameters(faults, parameter, message):
    parameters = f"{PARAMETERS}\n<parameter {parameter}</parameter>"
    found = faults(parameters=parameters)
    assert len(found) == 1
    if "__import__" not in message:
        assert found[0].startswith("10: parameter '")
        assert message in found[0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass": "{L}"}, "mass: {L} is m; expected what 'kg' measures"),
        ({"x": "{m*L}"}, "position/x: {m*L} is kg-m; expected m"),
        ({"x": "{M}"}, "unknown name 'M'"),
        ({"u": "{L}"}, "u2: {L} is m; expected a pure number"),
        ({"damping": "{n}"}, "the expression is 3; it goes from 0 to 1"),
        ({"damping": "{L}"}, "damping={L} is m; expected a pure number"),
        ({"x": "{L/0}"}, "division by zero"),
        ({"x": "{gas(L)}"}, "unknown function 'gas'"),
        ({"x": "{1e308*n}"}, "too large"),
        ({"x": "{1e300}", "x_units": ' units="km"'}, "too large"),
        ({"x": "{t}"}, "unknown name 't'"),
        ({"mass": "{-1}"}, "mass: "),
    ],
)
def test_faults_of_numbers(faults, given, message):
    (found,) = faults(**given)
    assert message in found
    assert ": body 'Rod'" in found or ": simulation" in found


def test_all_faults_are_given_at_once(faults):
    """What depends on a parameter with a fault has none of its own."""
    circle = '\n<parameter name="p">{q}</parameter><parameter name="q">{p*L}</parameter>'
    found = faults(parameters=PARAMETERS + circle, x="{q}", mass="{rho}", u="{zz}")
    assert [line.partition(":")[0] for line in found] == ["10", "17", "22"]
    assert "p -> q -> p" in found[0] or "q -> p -> q" in found[0]


def test_long_expressions_are_cut_in_messages(faults):
    (found,) = faults(x="{" + "+".join(["L"] * 500) + " + zz}")
    assert len(found) < 300


def test_many_circles_and_long_chains_take_time_in_proportion(faults, rod):
    """10,000 circles: with a search for each the square of that, some minutes."""
    chain = "".join(f'<parameter name="p{i}">{{p{i + 1} + 1}}</parameter>' for i in range(10_000))
    chain += '<parameter name="p10000">1</parameter>'
    assert rod(parameters=chain, mass="{p0}").mass == 10_001.0
    pairs = "".join(
        f'<parameter name="a{i}">{{b{i}}}</parameter><parameter name="b{i}">{{a{i}}}</parameter>'
        for i in range(10_000)
    )
    found = faults(parameters=pairs + '<parameter name="c">{a7 + 1}</parameter>', mass="{c}")
    assert "its value depends on itself: a0 -> b0 -> a0" in found[0]
    assert "9900 more faults are not shown" in found[-1]

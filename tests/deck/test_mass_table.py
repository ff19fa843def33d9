"""Mass tables: columns, units, frames, and every fault with the line of its row."""

import numpy as np
import pytest

from msahl.deck import DeckError, read_deck
from tests.support.effective import effective_deck

HEADER = "name,mass [kg],cx [mm],Ixx [kg-mm^2],Iyy [kg-mm^2],Izz [kg-mm^2],Ixy [kg-mm^2]"
ROW = "Arm,2,100,3000,4000,5000,-200"
DECK = """<data>
  <includes><include href="cad.csv" prefix="L."/></includes>
  <system>
    <bodies><ground><name>Base</name></ground></bodies>
    <joints>
      <revolute>
        <name>J</name>
        <parent><name>Base</name><axis><y>1</y></axis></parent>
        <child><name>L.Arm</name></child>
      </revolute>
    </joints>
  </system>
  <simulation><deltaT units="sec">0.01</deltaT><tFinal units="sec">0.1</tFinal></simulation>
</data>
"""


@pytest.fixture
def deck(tmp_path):
    """The path of a deck that includes this table."""

    def of(*lines, encoding="utf-8"):
        (tmp_path / "cad.csv").write_text("\n".join(lines) + "\n", encoding=encoding)
        path = tmp_path / "deck.xml"
        path.write_text(DECK)
        return path

    return of


def faults(path):
    with pytest.raises(DeckError) as error:
        read_deck(path)
    return str(error.value)


def test_a_row_is_a_body_in_the_units_of_the_header(deck):
    (body,) = read_deck(deck(HEADER, ROW)).bodies
    assert (body.name, body.mass, body.r_BG) == ("L.Arm", 2.0, (0.1, 0.0, 0.0))
    expected = [[3e-3, -2e-4, 0.0], [-2e-4, 4e-3, 0.0], [0.0, 0.0, 5e-3]]
    assert np.array(body.inertia) == pytest.approx(np.array(expected))


def test_order_separator_and_empty_cells_are_free(deck):
    lines = (
        "mass (g);name;Izz (g-cm^2);Iyy (g-cm^2);Ixx (g-cm^2);Iyz (g-cm^2)",
        "2000;Arm;30;20;20;",
        "",
    )
    (body,) = read_deck(deck(*lines, encoding="utf-8-sig")).bodies
    assert body.mass == 2.0
    assert np.diag(body.inertia) == pytest.approx([2e-6, 2e-6, 3e-6])


def test_a_tensor_about_the_reference_point_is_taken_to_the_mass_centre(deck):
    header = HEADER.replace(" [kg-mm^2]", "B [kg-mm^2]")
    (body,) = read_deck(deck(header, "Arm,2,100,3000,24000,25000,0")).bodies
    assert np.diag(body.inertia) == pytest.approx([3e-3, 4e-3, 5e-3])


def test_a_body_has_its_place_and_orientation(deck):
    header = f"{HEADER},x [m],z [mm],phi [deg],u3"
    (body,) = read_deck(deck(header, f"{ROW},0,0,90,1")).bodies
    # The parameters of a quarter about z: 4 tan(90 deg/4).
    assert body.orientation == pytest.approx((0.0, 0.0, 4.0 * np.tan(np.pi / 8.0)))


def test_the_deck_of_a_run_needs_no_table(deck, tmp_path):
    path = deck(HEADER, ROW)
    model = read_deck(path)
    text = effective_deck(path)
    (tmp_path / "cad.csv").unlink()
    path.write_bytes(text)
    assert read_deck(path) == model


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ((HEADER.replace("mass [kg]", "mass"), ROW), ":1: part: column 'mass': expected a unit of"),
        ((HEADER.replace("cx [mm]", "cx [kg]"), ROW), "column 'cx [kg]': expected a unit of m"),
        ((HEADER.replace("cx", "dx"), ROW), "column 'dx [mm]' is unknown"),
        ((HEADER.replace("cx [mm]", "mass [kg]"), ROW), "column 'mass' is given twice"),
        ((HEADER.replace("Izz", "IzzB"), ROW), "the tensor is given about two points"),
        (("name,mass [kg]", "Arm,2"), "column 'Ixx' is missing"),
        ((HEADER, ROW, "B,x,0,1,1,1,0"), ":3: body 'B', mass: 'x' is not a finite number"),
        ((HEADER, ROW, "B,1,0,,1,1,0"), ":3: body 'B': it has no Ixx"),
        ((HEADER, ROW, "B,1,0,1,1,3,0"), ":3: body 'L.B', moi: principal moments"),
        ((HEADER, ROW, f"{ROW},7"), ":3: body 'Arm': the row has 8 cells, the header 7"),
        ((HEADER, ROW, ROW), "the name is taken"),
        ((HEADER,), "the table has no bodies"),
        (("",), "the file is empty"),
        ((HEADER, ROW, "B\x01,1,0,1,1,1,0"), r":3: the character '\x01' is not text; delete it"),
        ((HEADER, "Arm,1\uffff,0,1,1,1,0"), r":2: the character '\uffff' is not text"),
        ((HEADER, "Arm,-2,0,1,1,1,0"), "the mass is -2 kg"),
    ],
)
def test_faults_have_the_line_of_their_row(deck, lines, message):
    assert message in faults(deck(*lines))

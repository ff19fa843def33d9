"""Elastic bodies in decks: reading, writing, and faults with place and remedy."""

import re

import numpy as np
import pytest

from msahl.check import check
from msahl.deck import DeckError, read_deck
from msahl.deck.source import Source
from msahl.deck.write_model import write_deck
from msahl.reduction.body import body_bytes
from tests.support.elastic import reduced_box
from tests.support.models import simulate

DECK = """<data>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <elasticBody {file}>
        <name>Box</name>{inside}
      </elasticBody>
      {bodies}
    </bodies>
    {others}
  </system>
  <simulation><title>t</title><deltaT>1e-5</deltaT><tFinal>1e-5</tFinal></simulation>
</data>"""
MODE = '<mode number="{n}"><amplitude units="mm">3</amplitude><rate>0.5</rate></mode>'
OTHER = """<rigidBody><name>Box.Tip</name><mass>1</mass>
  <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi></rigidBody>"""
JOINT = """<joints><rigid><name>J</name><parent><name>Base</name></parent>
  <child><name>{child}</name></child></rigid></joints>"""
MODES = """<modes><stiffness>1 2</stiffness><damping>0 {damping}</damping><frame>{frame}</frame>
  <follower name="a">1 1 0 0 0 {shape}</follower></modes>"""


@pytest.fixture(scope="module")
def bodies(tmp_path_factory):
    """A folder with files of elastic bodies."""
    folder = tmp_path_factory.mktemp("elastic")
    (folder / "box.npz").write_bytes(body_bytes(reduced_box()))
    (folder / "root.npz").write_bytes(body_bytes(reduced_box(frame="Root")))
    (folder / "text.npz").write_text("nothing")
    return folder


def written(folder, file='file="box.npz"', inside="", bodies="", others=""):
    path = folder / "deck.xml"
    path.write_text(DECK.format(file=file, inside=inside, bodies=bodies, others=others))
    return path


def test_the_start_is_that_of_the_modes(bodies):
    start = """<initialConditions><position basis="inertial"><x>1</x><y>2</y></position>
      <velocity><v3>4</v3></velocity></initialConditions>"""
    model = read_deck(written(bodies, inside=MODE.format(n=4) + start), thorough=True)
    assert check(model) == []
    by_name = {one.name: one for one in model.bodies}
    carrier, frame = by_name["Box.modes 4 to 6"], by_name["Box"]
    assert frame.position == (1.0, 2.0, 0.0)
    centre = np.array(frame.position) + frame.r_BG
    assert carrier.position == pytest.approx(centre + np.array([0.003, 0.0, 0.0]), abs=1e-15)
    assert carrier.velocity == pytest.approx([0.5, 0.0, 4.0], abs=1e-15)
    # The start satisfies the equations, also of nodes that rotate with the mode.
    # Of single differences of places, to some machine epsilons of these.
    assert simulate(model).report.extremes["constraintViolationMax"] < 1e-14


def test_written_decks_read_back_to_equal_records(bodies):
    inside = "<dampingRatio>0.02</dampingRatio>" + MODE.format(n=1)
    model = read_deck(written(bodies, inside=inside))
    assert Source.of(write_deck(model)).model() == model


def test_a_deck_as_it_ran_needs_no_file(bodies, tmp_path):
    source = Source.of_file(written(bodies))
    text = source.text({})
    (tmp_path / "deck.xml").write_bytes(text)
    assert read_deck(tmp_path / "deck.xml") == source.model()


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"file": ""}, "its file is missing; give the one of msahl reduce"),
        ({"file": 'file="other.npz"'}, "other.npz' cannot be read: No such file"),
        ({"file": 'file="../box.npz"'}, "is not accepted; name a file beside this one"),
        ({"file": 'file="text.npz"'}, "is no .npz of numbers"),
        ({"file": 'file="root.npz"'}, "its frame is fixed to Root; reduce it with --frame mean"),
        ({"inside": MODE.format(n=9)}, "there is no mode 9; number them from 1 to 8"),
        ({"inside": "<dampingRatio>-1</dampingRatio>"}, "it is less than zero"),
        ({"bodies": OTHER}, "'Box.Tip' is the name of another body"),
        ({"others": JOINT.format(child="Box.Middle")}, "'Box.Middle' is not a body"),
        (
            {"file": "", "inside": MODES.format(damping=0, frame="1 1 0 0", shape="1 0 0 1 0 0")},
            "a <frame> does not have 5 numbers",
        ),
        (
            {"file": "", "inside": MODES.format(damping="", frame="1 1 0 0 0", shape="0 " * 6)},
            "do not fit together",
        ),
        (
            {"file": "", "inside": MODES.format(damping=0, frame="1 1 0 0 0", shape="0 " * 6)},
            "amplitude 1 is not the displacement of its carrier",
        ),
        (
            {"file": "", "inside": MODES.format(damping=0, frame="0 1 0 0 0", shape="1 0 0 1 0 0")},
            "the mass is 0 kg",
        ),
    ],
)
def test_faults_have_place_and_remedy(bodies, parts, message):
    with pytest.raises(DeckError) as caught:
        read_deck(written(bodies, **parts))
    found = str(caught.value)
    assert message in found, found
    assert re.search(r"deck\.xml:\d+: ", found)

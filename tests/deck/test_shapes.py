"""Shapes of bodies and grounds in the deck: read, checked, expanded, and no part of the physics."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.check import check
from msahl.deck import DeckError, ParsedDeck, Source, deck_digest, read_deck
from msahl.deck.write import without_shapes
from msahl.model.shapes import Shape

DECK = """<?xml version="1.0" encoding="UTF-8"?>
<data>
  <parameters><parameter name="a" units="cm">20</parameter></parameters>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Bob</name>
        <mass>2</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions>
          <orientation>
            <eulerRotation><phi units="deg">90</phi><u3>1</u3></eulerRotation>
          </orientation>
        </initialConditions>
      </rigidBody>
    </bodies>
  </system>
  <simulation><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation>
</data>
"""
SHAPES = """<shapes>
          <box colour="#AABBCC">
            <x>{a}</x><y units="mm">30</y><z>{a/2}</z>
            <position basis="Base"><x>1</x></position>
          </box>
          <cylinder><radius>{a/4}</radius><length>1</length><axis><y>-2</y></axis></cylinder>
          <mesh href="meshes/part.stl" units="mm">
            <orientation>
              <eulerRotation><phi units="deg">90</phi><u3>1</u3></eulerRotation>
            </orientation>
          </mesh>
          <!-- </shapes> is no end in here -->
        </shapes>"""
MOI_END = "</Izz></moi>"
WITH = DECK.replace(MOI_END, f"{MOI_END}\n        {SHAPES}")


def effective_deck(path):
    return Source.of(path).text({})


def read(tmp_path, text, name="deck.xml"):
    path = tmp_path / name
    path.write_text(text)
    return read_deck(path)


def test_shapes_are_read_in_the_axes_of_the_body(tmp_path):
    model = read(tmp_path, WITH)
    box, cylinder, mesh = model.shapes
    assert box == Shape("Bob", "box", (0.2, 0.03, 0.1), box.position, colour="#aabbcc")
    assert np.allclose(box.position, (0, -1, 0), rtol=0, atol=1e-15)
    assert cylinder.size == (0.05, 1)
    assert cylinder.axes[2] == (0, -1, 0)
    assert (mesh.size, mesh.file) == ((0.001,), "meshes/part.stl")  # the file need not be there
    assert np.allclose(mesh.axes, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], rtol=0, atol=1e-15)
    assert check(model) == []


def test_shapes_of_a_ground_and_default_units(tmp_path):
    shapes = '<shapes><sphere><radius>1</radius></sphere><mesh href="a.OBJ"/></shapes>'
    text = DECK.replace("Base</name>", f"Base</name>{shapes}")
    assert read(tmp_path, text).shapes[0] == Shape("Base", "sphere", (1.0,))
    us = read(tmp_path, text.replace("<data>", "<data><unitSystem>US</unitSystem>"))
    assert [shape.size for shape in us.shapes] == [(0.3048,), (0.3048,)]


def test_the_model_and_the_digest_are_those_without_shapes(tmp_path):
    plain, drawn = read(tmp_path, DECK), read(tmp_path, WITH, "drawn.xml")
    assert replace(drawn, shapes=()) == plain
    assert without_shapes(WITH.encode()) == DECK.encode()
    decks = [effective_deck(tmp_path / name) for name in ("deck.xml", "drawn.xml")]
    assert b"<shapes>" in decks[1]  # the deck of the results keeps them
    assert deck_digest(decks[0]) == deck_digest(decks[1])
    digests = [ParsedDeck(Source.of(text.encode())).digest() for text in (DECK, WITH)]
    assert digests[0] == digests[1]  # by which a sweep compares decks
    assert deck_digest(decks[0]) != deck_digest(DECK.replace("<mass>2", "<mass>3").encode())


@pytest.mark.parametrize(
    "shapes",
    ["<shapes/>", "<shapes></shapes>", "\n  <shapes ><box/></shapes >", "<shapes>é&#62;</shapes>"],
)
def test_every_form_of_shapes_is_omitted_from_the_digest(shapes):
    head = DECK.replace("Base</name>", f"Base</name>{shapes}")
    both = head.replace(MOI_END, f"{MOI_END}{shapes}")
    assert without_shapes(both.encode()) == DECK.encode()


def test_the_digest_counts_what_only_looks_like_shapes():
    comment = DECK.replace("<bodies>", "<bodies><!-- <shapes><box/></shapes> -->")
    assert without_shapes(comment.encode()) == comment.encode()
    strange = b'<?xml version="1.0" encoding="x-unknown"?><shapes>'
    assert without_shapes(strange) == strange


def test_shapes_of_a_part(tmp_path):
    (tmp_path / "parts").mkdir()
    body = WITH[WITH.index("<rigidBody>") : WITH.index("</rigidBody>") + len("</rigidBody>")]
    parameters = '<parameters><parameter name="a" units="cm">20</parameter></parameters>'
    part = f"<part>{parameters}<system><bodies>{body}</bodies></system></part>"
    (tmp_path / "parts" / "bob.xml").write_text(part)
    includes = "".join(
        f'<include href="parts/bob.xml" prefix="{p}."><set name="a">{v}</set></include>'
        for p, v in (("L", 10), ("R", 30))
    )
    deck = DECK.replace("<system>", f"<includes>{includes}</includes><system>")
    model = read(tmp_path, deck)
    boxes = {s.body: s.size[0] for s in model.shapes if s.kind == "box"}
    assert boxes == pytest.approx({"L.Bob": 0.1, "R.Bob": 0.3})
    files = {s.file for s in model.shapes if s.kind == "mesh"}
    assert files == {"parts/meshes/part.stl"}  # from the folder of the deck
    expanded = effective_deck(tmp_path / "deck.xml")
    (tmp_path / "expanded.xml").write_bytes(expanded)
    assert read_deck(tmp_path / "expanded.xml") == model
    (tmp_path / "parts" / "bob.xml").write_text(part.replace(f"\n        {SHAPES}", ""))
    assert deck_digest(effective_deck(tmp_path / "deck.xml")) == deck_digest(expanded)


FAULTS = [
    ("<length>1<", "<length>0<", 16, "shapes/cylinder/length: it is 0 m; it must be greater than"),
    ("#AABBCC", "red", 12, "shapes/box: 'red' is not a colour; give red green blue in hex"),
    ("meshes/part.stl", "../part.stl", 17, "shapes/mesh: '../part.stl' is not accepted; name a"),
    ("meshes/part.stl", "/etc/passwd.stl", 17, "is not accepted; name a file beside the deck"),
    ("meshes/part.stl", "part.step", 17, "is not an STL or OBJ file; name one that ends in .stl"),
    ("meshes/part.stl", " ", 17, "attribute href is empty; name a file"),
    ("<y>-2</y>", "<y>0</y>", 16, "shapes/cylinder/axis: the axis is zero; give a direction"),
    ("<radius>{a/4}</radius>", "", 16, "<radius> is missing; add it to <cylinder>"),
    ("{a/2}", "{a/b}", 13, "shapes/box/z: in {a/b}: unknown name 'b'"),
    ("{a/2}", "{a^2}", 13, "shapes/box/z: {a^2} is m^2; expected m"),
    ("<orientation>\n              <euler", "<axis><x>1</x></axis><orientation><euler", 17,
     "<axis> is given beside <orientation>; keep one"),
    ('basis="Base"', 'basis="Bace"', 14, "basis 'Bace' is not a body"),
    ("<box ", "<cuboid ", 12, "unknown element <cuboid> in <shapes>"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "line", "message"), FAULTS, ids=[f[1] for f in FAULTS])
def test_faults(tmp_path, old, new, line, message):
    assert old in WITH
    text = WITH.replace(old, new)
    text = text.replace("</box>", "</cuboid>") if new == "<cuboid " else text
    with pytest.raises(DeckError) as caught:
        read(tmp_path, text)
    fault = caught.value.faults[0]
    assert "body 'Bob'" in fault.where
    assert message in str(fault)
    assert fault.line == line


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (Shape("Bob", "blob", ()), "shapes/blob: 'blob' is not a kind of shape"),
        (Shape("Bob", "box", (1.0,)), "shapes/box: a box has the sizes x, y, z"),
        (Shape("Bob", "sphere", (float("nan"),)), "shapes/sphere/radius: it is nan m"),
        (Shape("Bob", "sphere", (1.0,), colour="x"), "colour: 'x' is not a colour"),
        (Shape("Nob", "sphere", (1.0,)), "'Nob' is not"),
        (Shape("Bob", "mesh", (1.0,), file="a\\b.stl"), "is not accepted"),
        (Shape("Bob", "sphere", (1.0,), (0.0, 0.0, float("inf"))), "must be finite"),
    ],
)
def test_check_of_records(tmp_path, shape, message):
    model = replace(read(tmp_path, DECK), shapes=(shape,))
    assert message in "\n".join(map(str, check(model)))

"""Mutants of files: text and trees with numbers, names and elements exchanged, lost or repeated."""

import random

from lxml import etree

WORDS = (
    "", " ", "0", "-1", "1e300", "1e-300", "nan", "inf", "0 0 0", "1 2", "0x10", "1_0", "true",
    "free", "ball", "slide", "mesh", "planar", "floating", "fixed", "world", "../../etc/passwd",
    "package://x/y.stl", "\u2028", "a" * 400, "1 0 0 0", "-0.0", "1e15", "radian", "{t}", "'",
)  # fmt: skip
BYTES = (b"<", b">", b"&", b'"', b"/", b"\x00", b"\xff", b"<!DOCTYPE a [<!ENTITY b 'c'>]>", b"&b;")


def mutant(data: bytes, number: int) -> bytes:
    """The mutant of this number."""
    chance = random.Random(number)
    if chance.random() < 0.25:
        return of_text(data, chance)
    root = etree.fromstring(data, etree.XMLParser(remove_comments=True))
    for _ in range(chance.randint(1, 4)):
        of_tree(root, chance)
    return etree.tostring(root)


def of_text(data: bytes, chance: random.Random) -> bytes:
    """Bytes cut, put in, or exchanged."""
    at, length = chance.randrange(len(data)), chance.randint(0, 12)
    return data[:at] + chance.choice(BYTES) + data[at + length * chance.randint(0, 1) :]


def of_tree(root: etree._Element, chance: random.Random) -> None:
    """One change of an attribute or an element."""
    elements = list(root.iter())
    element = chance.choice(elements)
    kind = chance.randrange(6)
    if kind <= 2 and element.attrib:
        name = chance.choice(sorted(element.attrib))
        other = chance.choice(elements)
        values = (*WORDS, *other.attrib.values())
        element.set(name, chance.choice(values))
        if chance.random() < 0.2:
            del element.attrib[name]
    elif kind == 3 and element is not root:
        element.getparent().remove(element)
    elif kind == 4:
        other = chance.choice(elements)
        if other not in (element, *element.iterancestors()):
            element.append(other)
    elif len(elements) < 200:
        chance.choice(elements).append(etree.fromstring(etree.tostring(element)))

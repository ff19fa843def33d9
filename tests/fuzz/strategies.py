"""Decks gone wrong: mutants of good ones, trees of the schema's words, models of extreme numbers,
and bytes that are no deck at all.
"""

import copy
from functools import cache

from hypothesis import strategies as st
from lxml import etree

from msahl.deck.schema import schema_bytes
from msahl.deck.units import UNITS
from msahl.joints.registry import KINDS
from tests.fuzz.guard import TRAPS
from tests.support.models import DECKS

NUMBERS = (
    "0", "-0", "1", "-1", "2", "0.5", "1e-7", "1e-50", "1e-99", "-1e-100", "1e-101", "1e-300",
    "5e-324", "1e-400",
    "1e7", "1e50", "-1e99", "1e100", "1.1e100", "1e154", "1e300", "1.7976931348623157e308", "1e400",
    "NaN", "nan", "INF", "-INF", "inf", "Infinity", "+1", "1.", ".5", ".", "-", "", " ", "1 2",
    "1_000", "0x10", "1e", "1d5", "1,5", "\u0661", "\uff11", "\xa01", "1\u2003", "1\u2212", "\n3\t",
    "0." + "0" * 400 + "1", "9" * 400, "3." + "1415926535" * 200, "1e" + "9" * 50,
)  # fmt: skip
"""Texts for a number, good, extreme and bad."""

LONG = "x" * 10**6
WORDS = (
    "", " ", "\xa0", "\u3000", "\u2028", "time", "scheme", "0", "None", "G", "Bob", "a.x",
    "a/b", "../x",
    "..", "$x_{", "\\frac", "_", "__class__", "%s", "{0}", "*", "|", "<b>", "&", "a,b", "a;b",
    '"', "'", "`",
    "[a](b)", "\x85", "\x9b31m", "\u202eabc", "\ud7ff", "\ufffd", "\U0001f600",
    "\u4e2d\u6587", "e\u0301",
    "line\nline", "tab\there", "SI", "US", "angle", "slide", "linear", "cubic", "periodic", "flat",
    "roller", "-", "=1+1", "#", "x" * 300, LONG,
)  # fmt: skip
"""Texts for a name or another word."""


@cache
def tags() -> tuple[str, ...]:
    """Every element the schema has, and some it does not."""
    root = etree.fromstring(schema_bytes())
    known = {e.get("name") for e in root.iter("{*}element") if e.get("name")}
    return (
        *sorted(known),
        "foo",
        "Data",
        "{urn:a}mass",
        "{http://www.w3.org/2001/XInclude}include",
    )


@cache
def attributes() -> dict[str, tuple[str, ...]]:
    """Values for every attribute the schema has, and for some it does not."""
    units = sorted({unit for factors in UNITS.values() for unit in factors})
    location = "{http://www.w3.org/2001/XMLSchema-instance}"
    return {
        "units": (*units, "stone", "M", "", " m ", LONG),
        "basis": WORDS,
        "node": ("first", "last", "1", "3", "0", "999999", "x", ""),
        "station": NUMBERS,
        "theory": ("timoshenko", "eulerBernoulli", "inextensible", "rigid"),
        "colour": ("#112233", "red"),
        "about": ("G", "B", "b", ""),
        "interpolation": ("linear", "cubic", "periodic", "spline"),
        "scheme": ("preserving", "decaying", "magic"),
        "damping": NUMBERS,
        "reactions": ("mean", "instantaneous", "none"),
        "position": ("check", "project", ""),
        "velocity": ("keepAngular", "massWeighted", "asGiven", "refuse", "x"),
        "href": (str(TRAPS.pipe), TRAPS.address),
        f"{location}schemaLocation": (f"urn:a {TRAPS.address}", f"urn:a {TRAPS.pipe}"),
        f"{location}noNamespaceSchemaLocation": (TRAPS.address, str(TRAPS.pipe)),
        f"{location}type": ("number", "xs:string"),
        f"{location}nil": ("true",),
        "{http://www.w3.org/XML/1998/namespace}base": (TRAPS.address,),
    }


def _of(draw, things):
    return draw(st.sampled_from(things))


def _drop(draw, element):
    if element.getparent() is not None:
        element.getparent().remove(element)


def _double(draw, element):
    if element.getparent() is not None:
        element.getparent().append(copy.deepcopy(element))


def _move(draw, element):
    if element.getparent() is not None:
        inside = set(element.iter())
        others = [e for e in element.getroottree().getroot().iter() if e not in inside]
        target = _of(draw, others)
        element.getparent().remove(element)
        target.append(element)


def _rename(draw, element):
    element.tag = _of(draw, tags())


def _add(draw, element):
    etree.SubElement(element, _of(draw, tags())).text = _of(draw, NUMBERS)


def _retext(draw, element):
    element.text = _of(draw, NUMBERS + WORDS)


def _renumber(draw, element):
    leaves = [e for e in element.iter() if not len(e) and _is_number(e.text)]
    if leaves:
        _of(draw, leaves).text = _of(draw, NUMBERS)


def _swap(draw, element):
    other = _of(draw, list(element.getroottree().getroot().iter()))
    if not len(element) and not len(other):
        element.text, other.text = other.text, element.text


def _reattribute(draw, element):
    name = _of(draw, tuple(attributes()))
    element.set(name, _of(draw, attributes()[name]))


def _unattribute(draw, element):
    element.attrib.clear()


def _reunit(draw, element):
    """Another unit of the same quantity."""
    for other in element.iter():
        for factors in UNITS.values():
            if other.get("units") in factors:
                other.set("units", _of(draw, tuple(factors)))
                return


CHANGES = (
    _drop,
    _double,
    _move,
    _rename,
    _add,
    _retext,
    _swap,
    _reattribute,
    _unattribute,
    _reunit,
)
EXPRESSIONS = (
    "{{-3*{joint}.{coordinate} - 0.1*{joint}.{coordinate}Rate}}",
    "{{sqrt({joint}.{coordinate}) + log(t)/{joint}.{coordinate}Rate}}",
    "{{exp({joint}.{coordinate}*1e9)}}",
    "{{where({joint}.{coordinate} &gt; 0, 1e9, -1e9)}}",
    "{{{joint}.Fx*{joint}.slide1 - mod(t, {joint}.{coordinate})}}",
    "{{1/0}}",
    "{{{joint}.nothing + x}}",
)
"""Laws of actuators: with values that do not exist, that overflow or jump, and names unknown."""

GENTLE = (_renumber, _renumber, _reunit, _swap, _double)
"""Changes that leave most decks valid."""


def _is_number(text: str | None) -> bool:
    try:
        float(text or "")
    except ValueError:
        return False
    return True


@cache
def _seeds(folder: str = "") -> tuple[bytes, ...]:
    return tuple(path.read_bytes() for path in DECKS if folder in ("", path.parent.name))


@st.composite
def mutants(draw, changes=CHANGES + GENTLE, most=4, folder="") -> bytes:
    """A deck of the collection, or of a ``folder`` of it, changed in one to ``most`` places."""
    parser = etree.XMLParser(remove_comments=True)
    root = etree.fromstring(_of(draw, _seeds(folder)), parser)
    for _ in range(draw(st.integers(1, most))):
        change = _of(draw, changes)
        change(draw, _of(draw, list(root.iter())))
    return etree.tostring(root)


def gentle_mutants(most=2, folder=""):
    """Decks with a few numbers changed, most of which run."""
    return mutants(GENTLE, most, folder)


@st.composite
def trees(draw) -> bytes:
    """Any tree of the schema's words under ``<data>``."""

    def grow(parent, depth):
        for _ in range(draw(st.integers(0, 4))):
            child = etree.SubElement(parent, _of(draw, tags()))
            if draw(st.booleans()):
                name = _of(draw, tuple(attributes()))
                child.set(name, _of(draw, attributes()[name]))
            if depth and draw(st.booleans()):
                grow(child, depth - 1)
            else:
                child.text = _of(draw, NUMBERS + WORDS)

    root = etree.Element("data")
    for workspace in ("bodies", "joints", "motions", "loads"):
        parent = root.find("system")
        parent = etree.SubElement(root, "system") if parent is None else parent
        grow(etree.SubElement(parent, workspace), 3)
    grow(etree.SubElement(root, "simulation"), 2)
    return etree.tostring(root)


ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "cp037",
             "cp1252", "shift_jis", "utf-7", "gb18030", "koi8-r")  # fmt: skip
DECLARED = (*ENCODINGS, "ascii", "US-ASCII", "UCS-4", "EBCDIC-CP-US", "HTML", "nonsense",
    "utf8", "UTF-8 ",
            "x" * 1000)  # fmt: skip
PROLOGS = (
    "<!DOCTYPE data>",
    f'<!DOCTYPE data SYSTEM "{TRAPS.address}">',
    f'<!DOCTYPE data SYSTEM "file://{TRAPS.pipe}">',
    f'<!DOCTYPE data [<!ENTITY x SYSTEM "file://{TRAPS.pipe}">]>',
    f'<!DOCTYPE data [<!ENTITY % x SYSTEM "{TRAPS.address}">%x;]>',
    '<!DOCTYPE data [<!ENTITY a "'
    + "a" * 1000
    + '"><!ENTITY b "'
    + "&a;" * 1000
    + '"><!ENTITY c "'
    + "&b;" * 1000
    + '">]>',
    f'<?xml-stylesheet href="{TRAPS.address}"?>',
    f'<?xml-model href="file://{TRAPS.pipe}"?>',
    "<!-- a -->",
)
PIECES = (
    f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" href="file://{TRAPS.pipe}"/>',
    f'<xi:include xmlns:xi="http://www.w3.org/2001/XInclude" parse="text" href="{TRAPS.address}"/>',
    f'<xs:import xmlns:xs="http://www.w3.org/2001/XMLSchema" schemaLocation="{TRAPS.address}"/>',
    "&x;", "&c;", "&#0;", "&#x1b;[31m", "&#155;31m", "&#1114112;", "&#xD800;", "&lt;",
    "<![CDATA[1]]>", "]]>",
    "<?php ?>", "<!-- -- -->", "\x00", "\x1b[2J", "\ufffe", "<a:b/>", "<a b=1/>",
    "<a b='1' b='2'/>", "</data>",
    "<data>" * 300, "<a>" * 250 + "</a>" * 250, "<a/>" * 3000,
    "<a " + " ".join(f"b{i}='1'" for i in range(2000)) + "/>",
)  # fmt: skip


@st.composite
def files(draw) -> bytes:
    """A deck's bytes with something done to them that no tree could say."""
    text = _of(draw, _seeds()).decode()
    text = text[text.find("<data") :]
    if draw(st.booleans()):
        at = draw(st.integers(0, len(text)))
        text = text[:at] + _of(draw, PIECES) + text[at:]
    if draw(st.booleans()):
        text = _of(draw, PROLOGS) + text
    if draw(st.booleans()):
        text = f'<?xml version="1.0" encoding="{_of(draw, DECLARED)}"?>' + text
    data = text.encode(_of(draw, ENCODINGS), errors="ignore")
    for _ in range(draw(st.integers(0, 2))):
        at = draw(st.integers(0, len(data)))
        cut = draw(st.sampled_from([0, 0, 1, 4, len(data)]))
        data = data[:at] + draw(st.binary(max_size=8)) + data[at + cut :]
    return data


extreme = st.one_of(
    st.sampled_from([0.0, 1.0, -1.0, 1e-100, 1e100, -1e100, 1e-12, 1e12, 1e-30, 1e30]),
    st.floats(-2.0, 2.0),
    st.builds(lambda m, e: m * 10.0**e, st.floats(-9.0, 9.0), st.integers(-99, 98)),
)
tame = st.floats(-10.0, 10.0).map(lambda x: round(x, 6))
numbers = st.one_of(tame, tame, tame, extreme)
sizes = numbers.map(abs).filter(bool)
"""Numbers greater than zero."""


@st.composite
def models(draw) -> bytes:
    """One to three bodies with joints, couplings, motions and loads of any kind and number."""
    count = draw(st.integers(1, 3))
    names = ["G", *(f"B{i}" for i in range(count))]
    bodies = "<ground><name>G</name></ground>" + "".join(_body(draw, n) for n in names[1:])
    joints, kinds = [], {}
    for i in range(draw(st.integers(0, 3))):
        kind = _of(draw, tuple(KINDS))
        kinds[f"J{i}"] = kind
        joints.append(_joint(draw, f"J{i}", kind, names))
    if kinds and draw(st.booleans()):
        joints.append(_coupling(draw, tuple(kinds)))
    motions = [
        _motion(draw, f"M{i}", names[1:], tuple(kinds)) for i in range(draw(st.integers(0, 1)))
    ]
    loads = [_load(draw, f"L{i}", names, tuple(kinds)) for i in range(draw(st.integers(0, 3)))]
    scheme = _of(draw, ("preserving", "decaying"))
    reactions = _of(draw, ("mean", "instantaneous"))
    position = _of(draw, ("project", "project", "check"))
    velocity = _of(draw, ("keepAngular", "massWeighted", "asGiven", "refuse"))
    return (
        f"<data><system>{_vector(draw, 'gravity', 'g1 g2 g3')}<bodies>{bodies}</bodies>"
        f"<joints>{''.join(joints)}</joints><motions>{''.join(motions)}</motions>"
        f"<loads>{''.join(loads)}</loads></system>"
        f"<simulation scheme='{scheme}' reactions='{reactions}'><title>t</title>"
        f"<deltaT>{draw(sizes)!r}</deltaT><tFinal>1e100</tFinal>"
        f"<assembly position='{position}' velocity='{velocity}'/></simulation></data>"
    ).encode()


def _number(draw, tag, numbers=numbers):
    return f"<{tag}>{draw(numbers)!r}</{tag}>"


def _vector(draw, tag, components="x y z", attributes=""):
    parts = "".join(_number(draw, c) for c in components.split() if draw(st.booleans()))
    return f"<{tag}{attributes}>{parts}</{tag}>"


def _maybe(draw, make, *arguments):
    return make(draw, *arguments) if draw(st.booleans()) else ""


def _body(draw, name):
    size = draw(sizes)
    moments = "".join(f"<{tag}>{size!r}</{tag}>" for tag in ("Ixx", "Iyy", "Izz"))
    return (
        f"<rigidBody><name>{name}</name>{_number(draw, 'mass', sizes)}"
        f"{_maybe(draw, _vector, 'rGB')}"
        f"<moi>{moments}</moi><initialConditions>{_maybe(draw, _vector, 'position')}"
        f"{_maybe(draw, _rotation)}{_maybe(draw, _vector, 'velocity', 'v1 v2 v3')}"
        f"{_maybe(draw, _vector, 'angularVelocity', 'omega1 omega2 omega3')}"
        "</initialConditions></rigidBody>"
    )


def _rotation(draw):
    rotation = _number(draw, "phi") + _number(draw, "u1") + _number(draw, "u3")
    return f"<orientation><eulerRotation>{rotation}</eulerRotation></orientation>"


def _ends(draw, names, axes=0):
    child = _of(draw, names[1:])
    parent = _of(draw, [name for name in names if name != child])
    sides = []
    for side, name in (("parent", parent), ("child", child)):
        with_axis = axes == 2 or (axes == 1 and side == "parent")
        axis = _vector(draw, "axis") if with_axis else ""
        sides.append(
            f"<{side}><name>{name}</name>{_maybe(draw, _vector, 'position')}{axis}</{side}>"
        )
    return "".join(sides)


def _joint(draw, name, kind, names):
    record = KINDS[kind]
    ends = _ends(draw, names[:1] + names[1:], record.axes)
    parameters = "".join(_number(draw, parameter[0], sizes) for parameter in record.parameters)
    return f"<{kind}><name>{name}</name>{ends}{parameters}</{kind}>"


def _coupling(draw, joints):
    tag, number = _of(draw, (("gear", "ratio"), ("rackAndPinion", "radius")))
    first, second = _of(draw, joints), _of(draw, joints)
    return (
        f"<{tag}><name>C</name><first>{first}</first><second>{second}</second>"
        f"{_number(draw, number)}</{tag}>"
    )


def _law(draw):
    kind = _of(draw, ("constant", "polynomial", "sine", "ramp", "table"))
    if kind == "constant":
        return f"<law>{_number(draw, kind)}</law>"
    if kind == "table":
        return f"<law>{_table(draw, 't', 'value')}</law>"
    tags = {
        "polynomial": ("c0", "c1", "c5"),
        "sine": ("amplitude", "frequency", "phase"),
        "ramp": ("from", "to", "start", "end"),
    }[kind]
    return f"<law><{kind}>{''.join(_number(draw, tag) for tag in tags)}</{kind}></law>"


def _table(draw, argument, value):
    places = sorted({draw(numbers) for _ in range(draw(st.integers(2, 6)))})
    entries = [
        f"<entry><{argument}>{x!r}</{argument}>{_number(draw, value)}</entry>" for x in places
    ]
    way = _of(draw, ("linear", "cubic"))
    return f"<table interpolation='{way}'>{''.join(entries)}</table>"


def _motion(draw, name, bodies, joints):
    if joints and draw(st.booleans()):
        coordinate = _of(draw, ("angle", "slide"))
        return (
            f"<jointMotion><name>{name}</name><joint>{_of(draw, joints)}</joint>"
            f"<coordinate>{coordinate}</coordinate>{_law(draw)}</jointMotion>"
        )
    return (
        f"<pointMotion><name>{name}</name><body>{_of(draw, bodies)}</body>"
        f"{_vector(draw, 'direction')}{_law(draw)}</pointMotion>"
    )


def _load(draw, name, names, joints):
    body = f"<name>{name}</name><body>{_of(draw, names[1:])}</body>"
    kinds = ["concentrated", "bodyForce", "distributed", "springDamper", "bushing", "drag"]
    kind = _of(
        draw,
        kinds
        + ["torsionalSpringDamper", "slideSpringDamper", "friction", "actuator"] * bool(joints),
    )
    basis = f" basis='{_of(draw, names)}'"
    if kind == "concentrated":
        force = _vector(draw, "force", "xForce yForce zForce", basis)
        moment = _maybe(draw, _vector, "moment", "xMoment yMoment zMoment")
        inside = body + _maybe(draw, _vector, "position") + force + moment + _maybe(draw, _law)
    elif kind == "bodyForce":
        inside = body + _vector(draw, "acceleration", "a1 a2 a3", basis)
    elif kind == "distributed":
        places = "".join(_vector(draw, tag) for tag in ("start", "end", "direction"))
        inside = body + places + _number(draw, "startLoad") + _number(draw, "endLoad")
    elif kind == "drag":
        inside = body + _number(draw, "coefficient", sizes)
    elif kind == "springDamper":
        law = _table(draw, "length", "force") if draw(st.booleans()) else _number(draw, "stiffness")
        ends = _ends(draw, names)
        inside = f"<name>{name}</name>{ends}{law}" + _maybe(draw, _number, "damping", sizes)
    elif kind == "bushing":
        rates = "".join(_vector(draw, tag) for tag in ("stiffness", "damping", "angularStiffness"))
        inside = f"<name>{name}</name>{_ends(draw, names)}{rates}"
    elif kind == "actuator":
        joint, coordinate = _of(draw, joints), _of(draw, ("angle", "slide"))
        law = _of(draw, EXPRESSIONS).format(joint=joint, coordinate=coordinate)
        inside = (
            f"<name>{name}</name><joint>{joint}</joint><coordinate>{coordinate}</coordinate>"
            f"<expression>{law}</expression>"
        )
    elif kind == "friction":
        coordinate, radius = _of(draw, (("angle", _number(draw, "radius", sizes)), ("slide", "")))
        rest = _number(draw, "coefficient", sizes) + radius + _number(draw, "width", sizes)
        joint = f"<joint>{_of(draw, joints)}</joint><coordinate>{coordinate}</coordinate>"
        inside = f"<name>{name}</name>{joint}{rest}"
    else:
        tags = ("angle", "moment") if kind[0] == "t" else ("length", "force")
        law = _table(draw, *tags) if draw(st.booleans()) else _number(draw, "stiffness")
        damping = _maybe(draw, _number, "damping", sizes)
        inside = f"<name>{name}</name><joint>{_of(draw, joints)}</joint>{law}{damping}"
    return f"<{kind}>{inside}</{kind}>"

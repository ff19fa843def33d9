"""Put the parts that a deck includes from other files into its place.

    <include href="wheel.xml" prefix="FL."><set name="side">1</set></include>

Every name that the part defines gets the prefix, wherever the part uses it: elements, parameters,
names in expressions. Other names mean what they mean in the file that includes the part. So all
names stand in one space afterwards, and ``FL.side`` is a parameter of the deck.

A mass table in CSV (``msahl.deck.mass_table``) is a part, too.

A part is a file beside the including one or below, never elsewhere. Depth, number and size of parts
are bounded.
"""

from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from lxml import etree
from lxml.etree import SubElement

from msahl.check.names import FORBIDDEN
from msahl.deck.faults import DeckError, Element, Faults, attribute, collapsed, text
from msahl.deck.mass_table import read_mass_table
from msahl.deck.parameters import unknown_unit
from msahl.deck.parse import PART, parse, read_bytes
from msahl.deck.schema import check_schema
from msahl.deck.schema_types import EXPRESSION, NAME, NUMBERS, types
from msahl.deck.units import parse_unit
from msahl.expressions.syntax import inside_braces, nearest, renamed

TABLE = ".csv"
"""Ending of mass tables."""
MOST_DEEP = 8
"""Parts inside one another."""
MOST_PARTS = 1000
BODIES = "system/bodies"
MOST_BYTES = 64 * 2**20
"""Size of all parts, each counted as often as it is used."""


Parts = dict[Path, bytes]
"""Files of parts that have been read, by their paths."""


@dataclass(slots=True)
class _Work:
    """The files that are open, from the deck on, and those that are ``known``; number and size of
    all parts so far."""

    files: list[Path]
    known: Parts
    parts: int = 0
    size: int = 0


def merge_parts(root: Element, path: Path, faults: Faults, parts: Parts) -> None:
    """Replace ``<includes>`` in the tree of the deck at ``path`` by the contents of the parts, and
    put the numbers of their files into elastic bodies; raises ``DeckError`` with all faults if one
    cannot be read.

    Files are taken from ``parts`` if they are there, and put there when they are read.
    """
    work = _Work([path], parts)
    if root.find("includes") is not None and not _merge_all(root, work, faults):
        faults.raise_if_any()
    for element in root.iterfind(f"{BODIES}/elasticBody"):
        if element.get("file") and element.find("modes") is None and faults.sound(element):
            _read_elastic_body(element, work, faults)
            if not faults.sound(element):  # its bodies would be unknown everywhere
                faults.raise_if_any()


def _read_elastic_body(element: Element, work: _Work, faults: Faults) -> None:
    """Put the numbers of the file of an elastic body into its element."""
    from msahl.deck.elastic_files import read_elastic_file  # which few decks need

    file = _file(element, "file", "arm.npz", work, faults)
    if file is not None:
        work.known[file] = read_elastic_file(element, file, work.known.get(file), faults)


def _merge_all(root: Element, work: _Work, faults: Faults) -> bool:
    """Merge all parts that ``root``, the tree of the last open file, includes; return whether none
    of them had a fault."""
    good = True
    used: set[tuple[str, str]] = set()
    for includes in root.findall("includes"):
        for include in includes.findall("include"):
            part = (attribute(include, "href"), attribute(include, "prefix"))
            if part in used:
                prefix = "another prefix" if part[1] else "a prefix"
                faults.add(include, f"'{part[0]}' is included twice; give this one {prefix}")
            used.add(part)
            if faults.sound(include):
                _merge(root, include, work, faults)
            good = good and faults.sound(include)
        root.remove(includes)
    return good


def _merge(root: Element, include: Element, work: _Work, faults: Faults) -> None:
    """Merge one part into the tree ``root``."""
    prefix = attribute(include, "prefix")
    if not prefix.isprintable() or not FORBIDDEN.isdisjoint(prefix):
        faults.add(include, "the prefix must be printable, without , ; and quotes")
    file = _file(include, "href", "wheel.xml", work, faults)
    if file is None or not faults.sound(include):
        return
    own = Faults(str(file))
    try:
        part = _read(file, unit_system_of(root), work, own)
        work.files.append(file)
        _merge_all(part, work, own)
        work.files.pop()
        own.raise_if_any()
    except DeckError as error:
        faults.take(error.faults, include)
        return
    _add_prefix(part, prefix)
    _move_files(part, str(PurePosixPath(attribute(include, "href")).parent))
    _set_parameters(part, include, prefix, faults)
    faults.origins.update(own.origins)
    _move(part, root, str(file), faults)


def _file(include: Element, key: str, example: str, work: _Work, faults: Faults) -> Path | None:
    """Return the path of the file that an attribute names; None with a fault."""
    href = attribute(include, key)
    parts = PurePosixPath(href).parts
    if href.startswith("/") or ".." in parts or set(":\\") & set(href) or not href.isprintable():
        where = f"a file beside this one or below it, such as {example} or parts/{example}"
        faults.add(include, f"'{href}' is not accepted; name {where}")
        return None
    folder = work.files[-1].parent
    file = folder.joinpath(*parts)
    if file in work.known and file not in work.files and len(work.files) <= MOST_DEEP:
        return file  # it was accepted when it was read
    try:
        real = file.resolve(strict=True)
        if not real.is_relative_to(folder.resolve()):
            faults.add(include, f"'{href}' leads out of the folder of this file; copy it there")
        elif not real.is_file():
            faults.add(include, f"'{href}' is no file; name one such as {example}")
        elif real in [open_file.resolve() for open_file in work.files]:
            names = " -> ".join(p.name for p in (*work.files, file))
            faults.add(include, f"a file includes itself: {names}; delete one of these includes")
        elif len(work.files) > MOST_DEEP:
            faults.add(include, f"more than {MOST_DEEP} parts inside one another")
        else:
            return file
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        faults.add(include, f"'{href}' cannot be read: {reason}; name a file such as {example}")
    return None


def _read(file: Path, unit_system: str, work: _Work, faults: Faults) -> Element:
    """Return the tree of a part; raises ``DeckError`` if it is not well-formed or too large."""
    data = work.known.get(file)
    if data is None:
        data = work.known[file] = read_bytes(file, faults)
    work.parts += 1
    work.size += len(data)
    if work.parts > MOST_PARTS or work.size > MOST_BYTES:
        most = f"{MOST_PARTS} parts or {MOST_BYTES // 2**20} MiB"
        faults.stop(f"the deck includes more than {most}; include fewer")
    if file.suffix.lower() == TABLE:
        part = read_mass_table(data, unit_system, faults)
    else:
        part = parse(data, faults, PART)
    check_schema(part, faults)
    faults.raise_if_any()
    if unit_system_of(part) != unit_system:
        message = f"the deck that includes it has the unitSystem {unit_system}; use the same"
        faults.add(part, message)
    for gravity in part.iterfind("system/gravity"):
        faults.add(gravity, "gravity acts on all parts; move it to the deck")
    return part


def unit_system_of(root: Element) -> str:
    """Return the unit system of a deck or part."""
    return "US" if text(root.find("unitSystem")) == "US" else "SI"


def _defined(part: Element) -> set[str]:
    """Return the names of all parameters and elements that a part defines."""
    records = [*part.iterfind("system/*/*"), *part.iterfind("parameters/parameter")]
    names = {text(record.find("name")) or attribute(record, "name") for record in records}
    return names - {""}


def _add_prefix(part: Element, prefix: str) -> None:
    """Put ``prefix`` before all names that the part defines, wherever they stand."""
    defined = _defined(part)
    several = (*part.iterfind(f"{BODIES}/beam/name"), *part.iterfind(f"{BODIES}/elasticBody/name"))
    beams = set(map(text, several))

    def named(name: str) -> str:
        """Return a name, or the name of a value of an element, as it is in the deck."""
        known = name in defined or name.rpartition(".")[0] in defined
        return prefix + name if known else name

    def with_prefix(given: str, kind: str) -> str:
        """Return a text of a simple type of the schema."""
        if kind == NAME:
            name = collapsed(given)  # of an element, or of a node of a beam or elastic body
            known = name in defined or name.rpartition(".")[0] in beams
            return prefix + name if known else given
        if kind == EXPRESSION or (kind in NUMBERS and inside_braces(given) is not None):
            inside = inside_braces(given)
            return renamed(given, named) if inside is None else f"{{{renamed(inside, named)}}}"
        return given

    for element in part.iter(etree.Element):
        content = types().content(element)
        if content.text:
            element.text = with_prefix(element.text or "", content.text)
        for name, given in element.attrib.items():
            kind = content.attributes.get(str(name), "")
            element.set(name, with_prefix(str(given), kind))


def _move_files(part: Element, folder: str) -> None:
    """Put the ``folder`` of a part, from that of the including file, before the files of meshes
    and elastic bodies, which are given from the folder of the part."""
    if folder == ".":
        return
    for mesh in part.iterfind(f"{BODIES}/*/shapes/mesh"):
        mesh.set("href", f"{folder}/{attribute(mesh, 'href')}")
    for body in part.iterfind(f"{BODIES}/elasticBody[@file]"):
        body.set("file", f"{folder}/{attribute(body, 'file')}")


def _set_parameters(part: Element, include: Element, prefix: str, faults: Faults) -> None:
    """Put the values that an include sets in place of the defaults of the part's parameters."""
    defaults = {attribute(e, "name"): e for e in part.iterfind("parameters/parameter")}
    known = [name.removeprefix(prefix) for name in defaults]
    for given in include.findall("set"):
        name = attribute(given, "name")
        default = defaults.pop(prefix + name, None)
        if default is None:
            twice = name in known
            message = (
                "is set twice; keep one" if twice else f"is no parameter{nearest(name, known)}"
            )
            faults.add(given, f"'{name}' {message}")
            continue
        units = attribute(default, "units")
        message = unit_message(attribute(given, "units"), units)
        if message:
            faults.add(given, message)
        elif units and not attribute(given, "units"):
            given.set("units", units)
        given.tag = "parameter"
        given.set("name", prefix + name)
        holder = default.getparent()
        assert holder is not None
        holder.replace(default, given)
        faults.origins[given] = faults.file


def unit_message(units: str, default: str) -> str:
    """Return what is wrong with ``units`` of a value that replaces one in ``default`` units; both
    may be empty."""
    unit, of_default = parse_unit(units or "1"), parse_unit(default or "1")
    if unit is None:
        return unknown_unit(units)
    if units and default and of_default and not unit.dimension.fits(of_default.dimension):
        return f"'{units}' does not fit; the parameter is given in {default}"
    return ""


def _move(part: Element, root: Element, file: str, faults: Faults) -> None:
    """Move parameters and elements of a part into the tree ``root``."""
    for source, target in (("parameters", root), ("system", root.find("system"))):
        found = part.find(source)
        if found is None or target is None:
            continue
        for group in [found] if source == "parameters" else list(found):
            place = target.find(str(group.tag))
            if place is None:
                place = SubElement(target, str(group.tag))
            for element in list(group):
                faults.origins.setdefault(element, file)
                place.append(element)

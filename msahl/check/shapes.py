"""Rules about shapes: sizes are positive, colours are colours, files are beside the deck."""

import math
import re
from collections.abc import Iterator

from msahl.check.ends import frame_findings
from msahl.check.faults import LARGEST, Finding
from msahl.model.shapes import SIZES, Shape

COLOUR = re.compile(r"#[0-9A-Fa-f]{6}\Z")
FILES = (".stl", ".obj")
"""Endings of the files of meshes."""


def shape_findings(shape: Shape) -> Iterator[Finding]:
    """Find sizes that are not positive and finite, an unknown colour, and a path that leads out of
    the folder of the deck."""
    names = SIZES.get(shape.kind)
    if names is None:
        known = ", ".join(SIZES)
        yield Finding("", f"'{shape.kind}' is not a kind of shape; expected one of {known}")
        return
    if len(names) != len(shape.size):
        yield Finding("", f"a {shape.kind} has the sizes {', '.join(names)}; give these")
    for name, value in zip(names, shape.size, strict=False):
        if not 0.0 < value <= LARGEST:
            yield Finding(name, f"it is {value:g} m; it must be greater than zero")
    if not all(map(math.isfinite, shape.position)):
        yield Finding("position", "its components must be finite; give finite ones")
    yield from frame_findings(shape.axes, "axes")
    if shape.colour and not COLOUR.match(shape.colour):
        message = f"'{shape.colour}' is not a colour; give red green blue such as #4e79a7"
        yield Finding("colour", message)
    if shape.kind == "mesh":
        yield from file_findings(shape.file)


def file_findings(file: str) -> Iterator[Finding]:
    """Find a path of a mesh that is not below the folder of the deck, or of an unknown format."""
    outside = file.startswith("/") or ".." in file.split("/") or set(":\\") & set(file)
    if not file or outside or not file.isprintable():
        where = "a file beside the deck or below it, such as arm.stl or meshes/arm.stl"
        yield Finding("file", f"'{file}' is not accepted; name {where}")
    elif not file.lower().endswith(FILES):
        yield Finding(
            "file", f"'{file}' is not an STL or OBJ file; name one that ends in .stl or .obj"
        )

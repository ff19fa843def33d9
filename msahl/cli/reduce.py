"""The command ``msahl reduce``: reduce an elastic body of finite elements to few modes."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.console import say, stop, writing
from msahl.cli.options import NumberType, quiet_option
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.reduction.mesh.reduce import MeshSummary
    from msahl.reduction.reduce import Reduction, Wishes

FILE = click.Path(path_type=Path)
UNITS = ("m-kg", "mm-t", "mm-kg", "in-lbf")


@click.command("reduce", short_help="Reduce finite elements to few modes.")
@click.argument("file", type=FILE)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path, dir_okay=False),
    metavar="BODY",
    help="Write this file (default: FILE's name with _body.npz).",
)
@click.option("--overwrite", is_flag=True, help="Replace the output if it exists.")
@click.option(
    "--interface",
    "interfaces",
    multiple=True,
    metavar="NODE",
    help="Let joints and loads attach to this node, such as 12, Tip=12, or Hub=3,4,10:20 for nodes "
    "tied to a rigid point, or Hub=BOLTS for a named set of a mesh; repeat for more (default: the "
    "interface that FILE names).",
)
@click.option(
    "--modes",
    type=click.IntRange(0, 2000),
    metavar="N",
    help="Keep the N lowest normal modes with the interface fixed (default: 10).",
)
@click.option(
    "--up-to",
    "frequency",
    type=NumberType(0.0, min_open=True),
    metavar="HZ",
    help="Keep all normal modes up to this frequency instead.",
)
@click.option(
    "--frame",
    default="mean",
    metavar="NAME",
    help="Fix the floating frame to this interface (default: mean, its mean axes).",
)
@click.option(
    "--units",
    type=click.Choice(UNITS),
    default=UNITS[0],
    help="Set the units of FILE's lengths and masses; times are in s (default: m-kg).",
)
@click.option(
    "--mass", type=FILE, metavar="FILE", help="Take the mass from this file (default: beside FILE)."
)
@click.option(
    "--nodes",
    type=FILE,
    metavar="FILE",
    help="Take the nodes from this file (default: beside FILE).",
)
@click.option(
    "--material",
    default="",
    metavar="TEXT",
    help="Set the material of a mesh, such as 'E=210e9, nu=0.3, rho=7850', or its file.",
)
@click.option(
    "--section",
    default="",
    metavar="TEXT",
    help="Set the cross-section of a mesh of beams, such as 'radius=0.01', or its file.",
)
@click.option(
    "--stiffening",
    is_flag=True,
    help="Add geometric stiffening, by which loads in a body change its stiffness, of meshes of "
    "beams.",
)
@quiet_option
def reduce(
    file: Path,
    output: Path | None,
    overwrite: bool,
    quiet: bool,
    interfaces: tuple[str, ...],
    **given: Any,
) -> None:
    """Reduce the elastic body of FILE to the modes of a floating frame.

    FILE is an .npz, the stiffness of an Abaqus or CalculiX job (.mtx, .sti), DMIG cards of Nastran
    (.pch), a modal file of MBDyn (.fem), or a mesh of solids or beams by Gmsh (.msh), Abaqus
    (.inp), Nastran (.bdf) or VTK (.vtk, .vtu). Reports the modes and the error of the reduction,
    and of the mesh.

    Example: msahl reduce arm_STIF1.mtx --interface Hub=1:12 --interface 40 --up-to 2000
    """
    target = output or Path(f"{file.stem}_body.npz")
    if target.exists() and (not overwrite or (file.exists() and target.samefile(file))):
        stop(f"{shown_path(target)} exists; choose another file with -o, or --overwrite")
    found, mesh = _reduced(file, interfaces, given)
    from msahl.reduction.body import body_bytes
    from msahl.reduction.report import report

    if not quiet:
        echo("\n".join(printable(line) for line in report(found, mesh)))
    with writing(target, "choose another file with -o"):
        target.write_bytes(body_bytes(found.body))
    say(f"{shown_path(target)}: the reduced body")


def _reduced(
    file: Path, interfaces: tuple[str, ...], given: dict[str, Any]
) -> tuple["Reduction", "MeshSummary | None"]:
    """Return the reduced body, and of a mesh its summary; faults end the program."""
    if given["modes"] is not None and given["frequency"] is not None:
        stop("give --modes or --up-to, not both")
    from msahl.reduction import Files, ReductionError, reduce_file
    from msahl.reduction.mesh.reduce import is_mesh, reduce_mesh

    names = ("mass", "nodes", "units", "material", "section")
    try:
        wishes = _wishes(interfaces, given)
        files = Files(file, *(given[name] for name in names))
        return reduce_mesh(files, wishes) if is_mesh(files) else (reduce_file(files, wishes), None)
    except ReductionError as error:
        stop(printable(str(error)))


def _wishes(interfaces: tuple[str, ...], given: dict[str, Any]) -> "Wishes":
    from msahl.reduction.interfaces import interface_of
    from msahl.reduction.normal_modes import Wanted
    from msahl.reduction.reduce import DEFAULT, Wishes

    number, frequency = given["modes"], given["frequency"]
    wanted = DEFAULT if number is None and frequency is None else Wanted(number, frequency)
    return Wishes(
        tuple(interface_of(text) for text in interfaces),
        wanted,
        str(given["frame"]),
        bool(given["stiffening"]),
    )

"""Lists the compiled code that commands need, for every kind of model."""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import click

from msahl.analysis.equilibria.static_equations import Statics
from msahl.analysis.equilibria.static_newton import newton
from msahl.analysis.linearised.point import at_start
from msahl.deck import DeckError, read_deck
from msahl.events.margins import Span, build_margins
from msahl.jit.arguments import Description, describe
from msahl.jit.by_size import compiled_at_any_size
from msahl.jit.compiled import Call, prepare
from msahl.jit.general import round_up
from msahl.model import Model, Options, resolve
from msahl.model.scheme import AUTO, EXPONENTIAL
from msahl.model.settings import INSTANTANEOUS, OFF
from msahl.resources import example_deck, example_decks
from msahl.run.setup import build_setup
from msahl.start.velocities import StartError
from msahl.system import evaluate
from msahl.system.arrays import System, new_system_workspace
from msahl.system.build import build_system
from msahl.system.reductions import plane_normal
from msahl.system.state import build_state
from msahl.system.subsystems import split
from msahl.system.tree import tree_kind

ALONE = Options(error=OFF)
"""Options without a companion run, which would be half of what is built. At given steps its code is
that of the run, or of a run without accelerations: so one variant with a companion is enough."""
VARIANTS: tuple[tuple[dict[str, Any], Options], ...] = (
    ({}, Options()),
    ({}, replace(ALONE, solver="root")),
    ({"reactions": INSTANTANEOUS}, ALONE),
    ({"rotation_update": EXPONENTIAL}, ALONE),
    ({"rotation_update": EXPONENTIAL, "reactions": INSTANTANEOUS}, ALONE),
    ({"scheme": "gauss"}, ALONE),
    ({"scheme": "radau"}, ALONE),
    ({"scheme": "gauss"}, replace(ALONE, solver="root")),
    ({"scheme": AUTO}, Options(solver="newton")),
    ({"scheme": AUTO}, Options(solver="newton", full=True)),
)
"""Changes of a deck's simulation, and options, that need different code; decaying runs that of
preserving, radau that of gauss in absolute coordinates, and degrees, steps and damping change
nothing."""
COMMANDS = ("energy", "constraints")
"""Commands of ``msahl-post`` that need compiled code."""
TYPICAL = ("joints/spherical.xml", "joints/revolute.xml")
"""Decks without and with scalar constraint equations."""


def calls_of_run(model: Model, options: Options) -> list[Call]:
    """Return the compiled functions that a run calls, with arguments."""
    return build_setup(model, resolve(model.simulation, options), None).calls


def compile_everything(tell: Callable[[str], Any]) -> None:
    """Compile all kernels for every kind of model: of runs, analyses, reports and studies."""
    tell("compiling the kernels of all kinds of models")
    models = list(_models())
    # All are built as large ones, which need the code of small ones and more.
    with compiled_at_any_size():
        # In one go, so that no core waits for the last kernel of a model.
        prepare([call for model in models for call in _calls(model)])
        for model in models:
            with suppress(StartError):
                at = at_start(model)
                newton(Statics(at.system, at.state), at.state, most=1)
    tell("compiling the kernels of reports and studies")
    _use_results()


def _models() -> Iterator[Model]:
    """Yield the smallest of the example decks that are installed, one of each kind of model."""
    read: list[Model] = []
    for path in example_decks():
        with suppress(DeckError):
            read.append(read_deck(path))
    known: set[Description] = set()
    for model in sorted(read, key=lambda model: len(model.bodies)):
        kinds = {kind_of(part) for part in (model, *split(model))}
        if not kinds <= known:
            known |= kinds
            yield model


def kind_of(model: Model) -> Description:
    """Return what the machine code of a model depends on: the types of the arrays of its system, of
    its margins if it has events in steps of low or high order, whether it has joint coordinates,
    and loops in these, and whether it has beams in a plane.
    """
    system, span = build_system(model), Span(model.simulation.t_final)
    margins = (build_margins(system, order, span) for order in (2, 4))
    beams = system.beams is not None and _is_planar(model, system)
    return round_up((describe((system, *margins, tree_kind(model, system), beams and (True,))),))


def _is_planar(model: Model, system: System) -> bool:
    state = build_state(model, system)
    start = new_system_workspace(system, state)
    evaluate.prepare(system, state, start)
    return plane_normal(system, start) is not None


def _calls(model: Model) -> Iterator[Call]:
    """Yield the calls of runs of a model in all variants."""
    for changes, options in VARIANTS:
        changed = replace(model, simulation=replace(model.simulation, **changes))
        with suppress(StartError):
            yield from calls_of_run(changed, options)


def _use_results() -> None:
    """Run some decks for a moment, and evaluate and study them."""
    from msahl.cli.main import main
    from msahl.post.cli import main as post

    with silence(), tempfile.TemporaryDirectory() as folder:
        for name in TYPICAL:
            deck, out = str(example_deck(name)), f"{folder}/{Path(name).stem}"
            call(main, "run", deck, "-q", "-o", out, "--t-final", "0.05")
            for command in COMMANDS:
                call(post, command, out)
            study = ("--t-final", "0.2", "--budget", "1", "--reference", "independent")
            call(main, "study", deck, "-o", f"{out}-study", *study)


@contextmanager
def silence() -> Iterator[None]:
    """Discard what commands print."""
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        yield


def call(command: click.Command, *words: str) -> None:
    """Carry out a command in this process, however it ends."""
    with suppress(SystemExit, click.exceptions.Exit):
        command.main(list(words), standalone_mode=False)

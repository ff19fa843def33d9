"""What running a scene takes, in words: ``msahl explain``."""

from collections.abc import Iterator

import numpy as np

from msahl.model import Model
from msahl.run import Grid
from msahl.solve.freedom import constraint_rank
from msahl.solve.island import Runner
from msahl.system.islands import Island, split
from msahl.system.reduce import all_unknowns

AXES = "xyz"


def explain(model: Model) -> list[str]:
    """Lines about bodies, freedoms, unknowns, what is left out, and what will be loaded."""
    runners = [Runner(island, "newton", full=False, chunk=1) for island in split(model)]
    grid = Grid.of(model.simulation)
    return [
        model.simulation.title or "(no title)",
        f"  {_count(len(model.bodies), 'body', 'bodies')}, {_count(len(model.joints), 'joint')}, "
        f"{_count(len(model.loads), 'load')}, {_count(len(model.grounds), 'ground')}; "
        f"{grid.n} steps of {grid.h:g} s",
        *_freedoms(model, runners),
        *_unknowns(model, runners),
        *(line for runner in runners for line in _island(runner, alone=len(runners) == 1)),
        *_left_out(model, runners),
        *_loaded(),
    ]


def _count(n: int, one: str, many: str = "") -> str:
    return f"{n or 'no'} {one if n == 1 else many or one + 's'}"


def _freedoms(model: Model, runners: list[Runner]) -> Iterator[str]:
    bodies, equations = 6 * len(model.bodies), 3 * len(model.joints)
    rank = sum(constraint_rank(runner.scene.system, runner.scene.state) for runner in runners)
    yield f"degrees of freedom: by count {bodies} - {equations} = {bodies - equations}, " + (
        f"by rank {bodies} - {rank} = {bodies - rank}"
    )
    if rank < equations:
        yield (
            f"  {equations - rank} joint equations follow from the others: motion and energy are "
            "unique, the reactions of some joints are not"
        )


def _unknowns(model: Model, runners: list[Runner]) -> Iterator[str]:
    bodies, joints = len(model.bodies), len(model.joints)
    solved = sum(runner.scene.unknowns.free.size for runner in runners)
    full = sum(all_unknowns(runner.scene.system).size for runner in runners)
    yield (
        f"unknowns of a step: {12 * bodies + 3 * joints} (displacements, turns and their rates, "
        f"multipliers), {full} after using up the rates, {solved} solved for"
    )


def _island(runner: Runner, alone: bool) -> Iterator[str]:
    island, scene = runner.island, runner.scene
    head = "" if alone else f"island of {_members(island)}: "
    lu = scene.unknowns.elimination
    if runner.axis is not None:
        yield (
            f"{head}planar: nothing ever happens along {AXES[runner.axis]}, so each body has "
            "three unknowns and each joint two"
        )
    flying = [
        body.name
        for body, ballistic in zip(island.model.bodies, scene.system.bodies.ballistic, strict=False)
        if ballistic
    ]
    if flying:
        yield (
            f"{head}nothing but gravity touches {', '.join(flying)}: the mass centre moves by "
            "h v + h^2 g/2 exactly, only the turn is solved for"
        )
    yield f"{head}elimination: {lu.order.size} pivots, {lu.target.size} multiplications"


def _members(island: Island) -> str:
    names = [body.name for body in island.model.bodies]
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"... ({len(names)} bodies)"])


def _left_out(model: Model, runners: list[Runner]) -> Iterator[str]:
    if len(runners) > 1:
        yield f"{len(runners)} islands, solved apart: no joint and no load couples them"
    absent = {
        "gravity (zero)": not np.any(model.gravity),
        "joints (none)": not model.joints,
        "loads (none)": not model.loads,
    }
    names = [name for name, missing in absent.items() if missing]
    if names:
        yield f"not in this scene, and without cost: {', '.join(names)}"


def _loaded() -> Iterator[str]:
    from msahl.compiled import is_kept
    from msahl.solve import newton

    yield (
        "a run loads numpy, lxml, orjson and numba; scipy.optimize for the first step and hard "
        "ones (--solver auto), never with --solver newton; neither pandas nor matplotlib"
    )
    kept = is_kept(newton.march)
    yield (
        "the step is compiled and kept on disk"
        if kept
        else ("the first run compiles the step, once (some ten seconds)")
    )

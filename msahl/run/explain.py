"""What running a scene takes, in words: ``msahl explain``."""

from collections.abc import Iterator

import numpy as np

from msahl.jit.compiled import is_kept
from msahl.model import Model, decays, degree_of, is_exponential, order_of
from msahl.run.loop import Grid
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.verdict import describe_shared
from msahl.system.arrays import multiplier_count
from msahl.system.reductions import all_unknowns
from msahl.system.subsystems import split

AXES = "xyz"


def explain(model: Model) -> list[str]:
    """Lines about bodies, freedoms, unknowns, what is left out, and what will be loaded."""
    with np.errstate(all="ignore"):  # as in a run
        integrators = [
            SubsystemIntegrator(subsystem, "newton", full=False, chunk=1)
            for subsystem in split(model)
        ]
    grid = Grid.of(model.simulation)
    return [
        model.simulation.title or "(no title)",
        f"  {_count(len(model.bodies), 'body', 'bodies')}, {_count(len(model.joints), 'joint')}, "
        f"{_count(len(model.couplings), 'coupling')}, {_count(len(model.motions), 'motion')}, "
        f"{_count(len(model.loads), 'load')}, {_count(len(model.grounds), 'ground')}; "
        f"{grid.n} steps of {grid.h:g} s",
        f"scheme: {_scheme(model)}",
        *_freedoms(model, integrators),
        *_unknowns(model, integrators),
        *(
            line
            for integrator in integrators
            for line in _island(integrator, alone=len(integrators) == 1)
        ),
        *_left_out(model, integrators),
        *_loaded(integrators),
    ]


def _count(n: int, one: str, many: str = "") -> str:
    return f"{n or 'no'} {one if n == 1 else many or one + 's'}"


def _scheme(model: Model) -> str:
    """The scheme in words: name, order, what it does to the energy."""
    name, degree = model.simulation.scheme, degree_of(model)
    if decays(model):
        energy = "takes energy from what is quicker than the step"
    else:
        energy = "keeps the energy nearly" if degree else "keeps the energy"
    if is_exponential(model):
        energy += "; a step's turn is by its angle"
    named = f"{name} of degree {degree}" if degree else name
    return f"{named}, of order {order_of(model)}; {energy}"


def _freedoms(model: Model, integrators: list[SubsystemIntegrator]) -> Iterator[str]:
    bodies = 6 * len(model.bodies)
    rank = sum(integrator.rank for integrator in integrators)
    equations = rank + sum(integrator.redundant for integrator in integrators)
    yield f"degrees of freedom: by count {bodies} - {equations} = {bodies - equations}, " + (
        f"by rank {bodies} - {rank} = {bodies - rank}"
    )
    shared = {
        name: columns for integrator in integrators for name, columns in integrator.shared.items()
    }
    if shared:
        yield (
            f"  {equations - rank} joint equations follow from the others: motion and energy are "
            f"unique, but not these reactions: {describe_shared(shared)}"
        )
    names = [joint.name for joint in model.joints] + [c.name for c in model.couplings]
    unique = [name for name in names if name not in shared]
    if shared and unique:
        yield f"  all components unique: {', '.join(unique)}"


def _unknowns(model: Model, integrators: list[SubsystemIntegrator]) -> Iterator[str]:
    bodies = len(model.bodies)
    equations = sum(multiplier_count(integrator.workspace.system) for integrator in integrators)
    solved = sum(integrator.workspace.unknowns.free.size for integrator in integrators)
    full = sum(all_unknowns(integrator.workspace.system).size for integrator in integrators)
    yield (
        f"unknowns of a step: {12 * bodies + equations} (displacements, turns and their rates, "
        f"multipliers), {full} after using up the rates, {solved} solved for"
    )


def _island(integrator: SubsystemIntegrator, alone: bool) -> Iterator[str]:
    scene = integrator.workspace
    head = "" if alone else f"island of {_members(integrator.model)}: "
    lu = scene.unknowns.elimination
    if integrator.axis is not None:
        yield (
            f"{head}planar: nothing ever happens along {AXES[integrator.axis]}, so each body has "
            "three unknowns, and equations that hold by symmetry are left out"
        )
    flying = [
        body.name
        for body, ballistic in zip(
            integrator.model.bodies, scene.system.frames.ballistic, strict=False
        )
        if ballistic
    ]
    if flying:
        yield (
            f"{head}nothing but gravity touches {', '.join(flying)}: the mass centre moves by "
            "h v + h^2 g/2 exactly, only the turn is solved for"
        )
    yield f"{head}elimination: {lu.order.size} pivots, {lu.target.size} multiplications"


def _members(subsystem: Model) -> str:
    names = [body.name for body in subsystem.bodies]
    return ", ".join(names if len(names) <= 4 else [*names[:3], f"... ({len(names)} bodies)"])


def _left_out(model: Model, integrators: list[SubsystemIntegrator]) -> Iterator[str]:
    if len(integrators) > 1:
        yield f"{len(integrators)} islands, solved apart: no joint and no load couples them"
    absent = {
        "gravity (zero)": not np.any(model.gravity),
        "joints (none)": not model.joints,
        "equations along quantities: axes, slides, springs (none)": all(
            integrator.workspace.system.scalar is None for integrator in integrators
        ),
        "loads (none)": not model.loads,
    }
    names = [name for name, missing in absent.items() if missing]
    if names:
        yield f"not in this scene, and without cost: {', '.join(names)}"


def _loaded(integrators: list[SubsystemIntegrator]) -> Iterator[str]:
    yield (
        "a run loads numpy, lxml, orjson and numba; scipy.optimize for the first step and hard "
        "ones (--solver auto), never with --solver newton; neither pandas nor matplotlib"
    )
    kept = all(is_kept(f"{integrator.stepper.kind}-auto") for integrator in integrators)
    yield (
        "the step is compiled and kept on disk"
        if kept
        else ("the first run compiles the step for this kind of scene, once (10 to 40 seconds)")
    )

"""msahl as one of the codes: the loop of ``msahl run`` without the writing."""

from dataclasses import replace

import numpy as np

from benchmarks.motion import Motion
from msahl.model import Model, Options
from msahl.model.scheme import EXPONENTIAL, choices, split
from msahl.model.settings import OFF
from msahl.run.loop import run
from msahl.run.report import Report
from msahl.run.tables import STATES, MemorySink

VARIANTS = {
    "msahl newton": Options(solver="newton", error=OFF),
    "msahl auto": Options(solver="auto", error=OFF),
    "msahl root": Options(solver="root", error=OFF),
    "msahl newton --full": Options(solver="newton", full=True, error=OFF),
    "msahl newton --rotation-update exponential": Options(solver="newton", error=OFF),
}
SETTINGS = {
    "msahl newton": "the compiled loop, reductions as found",
    "msahl auto": "the default: scipy.optimize.root for the first step and for hard ones",
    "msahl root": "scipy.optimize.root (hybr) for every step; at most 10 bodies",
    "msahl newton --full": "the compiled loop with the complete equations",
    "msahl newton --rotation-update exponential": "the compiled loop, rotations updated by the "
    "exponential map (see docs/deck.md, Scheme)",
}
AUTO = "auto"
"""The scheme that takes a tolerance and chooses its degree and its steps."""
SCHEMES = tuple(f"msahl {word}" for word in choices() if word != AUTO)
"""Every other scheme a run can choose, by the compiled loop."""
BY_TOLERANCE = ("msahl by tolerance",) if AUTO in choices() else ()


def loop_report(model: Model, h: float, steps: int, options: Options) -> Report:
    """Report of ``steps`` steps of which only the last is published."""
    return run(_lasting(model, h, steps), replace(options, every=steps), MemorySink(only=()))


def loop_seconds(model: Model, h: float, steps: int, variant: str) -> float:
    """Seconds in the loop; it monitors energy and constraint violation at every step, as always."""
    report = loop_report(of_scheme(model, variant), h, steps, _options(variant))
    if report.status != "completed":
        raise RuntimeError(report.message)
    return report.seconds["loop"]


def motion(
    model: Model, h: float, steps: int, variant: str, every: int = 1, accuracy: float | None = None
) -> Motion:
    """A scheme that is given an ``accuracy`` has rows every ``h`` and steps of its own."""
    rows, options = MemorySink(only=(STATES,)), replace(_options(variant), every=every)
    chosen = _lasting(of_scheme(model, variant), h, steps)
    if variant in BY_TOLERANCE:
        by_tolerance = replace(
            chosen.simulation,
            scheme=AUTO,
            local_tolerance=accuracy,
            output_interval=h,
            dt=min(model.simulation.dt, h * steps),
        )
        chosen = replace(chosen, simulation=by_tolerance)
    report = run(chosen, options, rows)
    if report.status != "completed":
        raise RuntimeError(report.message)
    table = rows.table(STATES)
    states = table[:, 1:].reshape(len(table), len(model.bodies), 4, 3)
    R = _matrices(states[:, :, 1])
    v = np.einsum("tbij,tbj->tbi", R, states[:, :, 2])
    counted = report.seconds["loop"], report.steps, report.iterations
    x = states[:, :, 0] + np.einsum("tbij,bj->tbi", R, [body.r_BG for body in model.bodies])
    return Motion(table[:, 0], x, R, v, states[:, :, 3], *counted)


def _options(variant: str) -> Options:
    return VARIANTS.get(variant, VARIANTS["msahl newton"])


def of_scheme(model: Model, variant: str) -> Model:
    """The model with the scheme that a variant names, if it names one."""
    simulation = model.simulation
    if variant.endswith("--rotation-update exponential"):
        return replace(model, simulation=replace(simulation, rotation_update=EXPONENTIAL))
    if variant not in SCHEMES:
        return model
    scheme, degree = split(variant.removeprefix("msahl "))
    chosen = replace(simulation, scheme=scheme, degree=degree or simulation.degree)
    return replace(model, simulation=chosen)


def _lasting(model: Model, h: float, steps: int) -> Model:
    return replace(model, simulation=replace(model.simulation, dt=h, t_final=steps * h))


def _matrices(p: np.ndarray) -> np.ndarray:
    """Rotation matrices of Wiener-Milenkovic parameters p = 4 tan(phi/4) n, all at once."""
    square = np.sum(p * p, axis=-1, keepdims=True) / 16.0
    q0, q = (1.0 - square) / (1.0 + square), 0.5 * p / (1.0 + square)
    eye = np.eye(3)
    rotated = [e + 2.0 * np.cross(q, np.cross(q, e) + q0 * e) for e in eye]
    return np.stack(rotated, axis=-1)

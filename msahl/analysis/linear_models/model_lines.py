"""A linearised model in words and numbers: the lines that a command prints."""

import numpy as np

from msahl.analysis.linear_models.model import LinearModel, Quantity
from msahl.analysis.modes.mode_lines import counted, title_line

MOST = 12
"""States, inputs, outputs and poles that are printed; a file has all."""


def report(model: LinearModel) -> list[str]:
    """Return what was linearised, where, and how it reacts."""
    m = len(model.states)
    return [
        title_line(model.title, model.time, model.equilibrium),
        f"{counted(m, 'state')} ({model.chosen}, condition {model.accuracy.condition:.1f}), "
        f"{counted(len(model.inputs), 'input')}, {counted(len(model.outputs), 'output')}; "
        f"{counted(model.redundant, 'redundant constraint equation')}",
        f"agrees with differences of the nonlinear equations to {model.accuracy.disagreement:.1e}",
        "",
        *_table("state", model.states),
        *_table("input", model.inputs),
        *_table("output", model.outputs),
        "",
        *_poles(model.poles),
        *_gains(model),
    ]


def _table(kind: str, each: tuple[Quantity, ...]) -> list[str]:
    """Lines of names with their values at the point."""
    lines = [
        f"{kind:>6}  {variable.name} = {variable.value:.9g} {variable.unit}"
        for variable in each[:MOST]
    ]
    return lines + ([f"        and {len(each) - MOST} more"] if len(each) > MOST else [])


def _poles(poles: np.ndarray) -> list[str]:
    """Lines of poles, of a conjugate pair once."""
    upper = poles[poles.imag >= 0.0]
    lines = []
    for pole in upper[:MOST]:
        pair = f" +- {pole.imag:.9g} i" if pole.imag > 0.0 else ""
        lines.append(f"  pole  {pole.real:.9g}{pair} 1/s")
    return lines + ([f"        and {len(upper) - MOST} more"] if len(upper) > MOST else [])


def _gains(model: LinearModel) -> list[str]:
    """Lines of steady outputs by constant inputs."""
    if not model.D.size:
        return []
    gains = model.gains()
    if np.isnan(gains).any():
        return ["  no steady gains: a pole is zero"]
    shown = [
        f"  gain  {output.name} by {given.name}: {gains[o, i]:.9g}"
        for o, output in enumerate(model.outputs)
        for i, given in enumerate(model.inputs)
    ]
    return shown[:MOST] + ([f"        and {len(shown) - MOST} more"] if len(shown) > MOST else [])

"""Pack the modes of a model for the viewer, which plays one period of each.

The motion that is shown is exact in the phase and linear in the amplitude a:

    x(t) = x_0 + a Re(u e^(i w t)) ,   R(t) = exp([a Re(theta e^(i w t))]^) R_0

The packed data, which ``modes.js`` reads, is

    {
      "poses": [x, y, z, w, x, y, z, ...],     # of all bodies at rest
      "unit": float,                           # of the integers of ``shapes``
      "shapes": {...},                         # (modes, 12 bodies) of ``pack_integers``: real and
                                               # imaginary parts of x, y, z [m], rx, ry, rz [rad]
      "modes": [{"name": str, "facts": str, "frequency", "damping": float}],
      "first": int,                            # the mode that is shown first
    }
"""

from pathlib import Path
from typing import Any

import numpy as np

from msahl.algebra.rotation_arrays import quaternions
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.point import Point
from msahl.analysis.modes.mode_lines import largest_parts
from msahl.analysis.modes.solution import Modes
from msahl.post.scene import build_scene
from msahl.post.view.packing import pack_integers
from msahl.post.view.viewer import Shown

NUMBERS = 400_000
"""Most numbers of shapes that a page contains: some 800 kB of it."""
CERTAIN = 10.0
"""Multiple of its error by round-off beyond which a frequency is one."""
SLOW = 1e-6
"""Frequency relative to the largest below which a mode is a rigid-body motion."""
ROUNDING = 2.0**-20
"""What a shape is rounded to, relative to the largest part of all."""


def show_modes(point: Point, found: Modes, deck: Path) -> Shown:
    """Return the modes at a ``point`` for the viewer, without rigid-body modes; raises
    ``ValueError`` if there are no others.
    """
    rows = np.arange(found.zeros, found.value.size)
    # Modes of auxiliary states alone move no body.
    rows = rows[np.abs(found.shape[rows]).max(axis=(1, 2), initial=0.0) > 0.0]
    if not rows.size:
        raise ValueError("no mode moves a body, apart from rigid-body modes")
    most = max(NUMBERS // (12 * len(point.model.bodies)), 1)
    kept = rows[:most]
    note = "Shapes of the linear equations: with a large amplitude they violate the joints."
    if len(kept) < len(rows):
        note += f" The first {len(kept)} of {len(rows)} modes are shown."
    if found.zeros:
        note += " Rigid-body modes are not shown."
    scene = build_scene(point.model, deck.stem, [deck.parent])
    return Shown(scene=scene, name="modes", note=note, modes=_packed(point, found, kept))


def _packed(point: Point, found: Modes, kept: np.ndarray) -> dict[str, Any]:
    """Return the data of the modes in the rows ``kept``."""
    states = state_row(point).reshape(len(point.model.bodies), -1)
    poses = np.concatenate([states[:, :3], quaternions(states[:, 3:6])], axis=1)
    shapes = found.shape[kept]
    parts = np.stack([shapes.real, shapes.imag], axis=3).reshape(len(kept), -1)
    unit = ROUNDING * float(np.abs(parts).max())
    return {
        "poses": poses.reshape(-1).tolist(),
        "unit": unit,
        "shapes": pack_integers(np.rint(parts / unit).astype(np.int64)),
        "modes": [_described(point, found, int(m)) for m in kept],
        "first": _first_vibration(found, kept),
    }


def _first_vibration(found: Modes, kept: np.ndarray) -> int:
    """Return the place among the rows ``kept`` of the first mode that oscillates, 0 if none does:
    those that creep, or are slow by round-off alone, come before it and show little."""
    oscillation = found.value[kept].imag
    vibrates = oscillation > np.maximum(CERTAIN * found.error[kept], SLOW * oscillation.max())
    return int(np.argmax(vibrates))


def _described(point: Point, found: Modes, m: int) -> dict[str, Any]:
    """Return name and figures of a mode."""
    value, damping = complex(found.value[m]), float(found.damping[m])
    grows = value.real > max(float(found.error[m]), 1e-9)
    hertz = float(found.frequency[m])
    if value.imag > 0.0:
        name = f"{m + 1}: {hertz:.6g} Hz"
        facts = f"{hertz:.9g} Hz, damping ratio {damping:.5f}" + (", grows" if grows else "")
    else:
        name = f"{m + 1}: {value.real:.6g} 1/s"
        facts = f"{'grows' if grows else 'decays'} without oscillation"
    complete = f"{value.real:.9g}" + (f" ± {value.imag:.9g} i" if value.imag else "")
    return {
        "name": name,
        "facts": f"{facts}; eigenvalue {complete} 1/s, error {found.error[m]:.0e}; "
        f"{largest_parts(point, found, m)}",
        "frequency": hertz,
        "damping": damping,
    }

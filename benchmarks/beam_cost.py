"""Measure the cost of a step per node of a beam against that per body of a chain with bushings.

    python -m benchmarks.beam_cost                # results/beam_cost.md, some minutes
    python -m benchmarks.beam_cost --planar       # results/planar_beams.md: a plane against space
    python -m benchmarks.beam_cost --quick -o DIR # smoke test

The beam and the chain have the same mass, stiffness and number of nodes or bodies, are clamped at
one end, and swing under gravity at the same step size. They are measured in turn, in one process,
by runs without output between the first and the last step. Times are those of the processor, of
additional steps: a long run less a short one.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import ours
from benchmarks.machine import describe
from benchmarks.mechanisms.clock import processor_time
from msahl.algebra.vector import IDENTITY, ZERO, Vector
from msahl.elements.beams.build import Line, build_beam, node_shares
from msahl.elements.beams.shape import node_stations
from msahl.model import Bushing, Ground, Joint, Model, Options, RigidBody, Section, Simulation
from msahl.model.settings import OFF
from msahl.run.report import Report

RESULTS = Path(__file__).with_name("results")
GRAVITY, IN_PLANE = (0.3, 0.4, -9.80665), (0.3, 0.0, -9.80665)
STIFFNESS = (1e4, 4e3, 4e3, 10.0, 12.0, 15.0)
"""EA, GA2, GA3 [N], GJ, EI2, EI3 [N m^2]; length 1 m, mass 1 kg."""
INERTIA = (2e-3, 1e-3, 1e-3)
"""Rotary inertia per length [kg m]."""
SCHEMES = {"preserving": 2e-3, "decaying": 2e-3, "gauss2": 2e-4, "radau2": 2e-4}
"""Schemes and their step sizes [s]: with longer ones, gauss2 and radau2 cannot solve the steps of
the chain without subdividing them, as its bushings are stiff."""
DEGREES = (1, 2, 3, 4)
ELEMENTS = 24
"""Of degree 1; 24/p of degree p, and 25 bodies of the chain."""
GROUND = Ground("Base")


def beam(degree: int, elements: int, gravity: Vector = GRAVITY) -> Model:
    """Return a straight beam along x of elements of a degree."""
    lengths = np.full(elements, 1.0 / elements)
    stations = node_stations(degree, lengths)
    positions = stations[:, None] * np.array([1.0, 0.0, 0.0])
    line = Line(degree, lengths, positions, np.tile(np.eye(3), (stations.size, 1, 1)))
    compliance = _rows(np.diag(1.0 / np.array(STIFFNESS)))
    section = Section(compliance, 1.0, _rows(np.diag(INERTIA)))
    record, nodes = build_beam("Beam", line, section)
    return replace(_model(nodes, beams=(record,)), gravity=gravity)


def chain(bodies: int) -> Model:
    """Return rigid bodies with bushings of a beam's stiffness between neighbours."""
    lengths = np.full(bodies - 1, 1.0 / (bodies - 1))
    shares, length = node_shares(1, lengths), float(lengths[0])
    links = [
        RigidBody(
            f"Body.{k + 1}",
            mass=float(share),
            r_BG=ZERO,
            inertia=_rows(share * np.diag(INERTIA)),
            position=(k * length, 0.0, 0.0),
            orientation=ZERO,
            velocity=ZERO,
            angular_velocity=ZERO,
        )
        for k, share in enumerate(shares)
    ]
    middle = 0.5 * length
    stiffness: Any = tuple(k / length for k in STIFFNESS)
    undamped: Any = (0.0,) * 6
    bushings = [
        Bushing(
            f"Bushing.{k + 1}",
            links[k].name,
            links[k + 1].name,
            (middle, 0.0, 0.0),
            (-middle, 0.0, 0.0),
            IDENTITY,
            IDENTITY,
            stiffness,
            undamped,
        )
        for k in range(bodies - 1)
    ]
    return _model(links, loads=tuple(bushings))


def _model(bodies: list[RigidBody] | tuple[RigidBody, ...], **others: Any) -> Model:
    clamp = Joint("Clamp", "rigid", GROUND.name, bodies[0].name, ZERO, ZERO)
    loads = others.pop("loads", ())
    parts = (GROUND,), tuple(bodies), (clamp,), loads
    return Model(GRAVITY, *parts, Simulation("", 1e-3, 1.0), **others)


def _rows(array: np.ndarray) -> Any:
    return tuple(tuple(row) for row in array.tolist())


@dataclass(slots=True)
class Row:
    """A model with a scheme, and its samples."""

    name: str
    model: Model
    scheme: str
    full: bool = False  # without model reductions
    samples: list[float] = field(default_factory=list)  # microseconds per step and node
    iterations: float = 0.0  # per step

    @property
    def cost(self) -> float:
        """Median microseconds per step and node."""
        return statistics.median(self.samples)

    def take(self, steps: int) -> None:
        """Take a sample: processor time of additional steps."""
        few, many = (self._seconds(n) for n in (steps // 4, steps))
        self.samples.append(1e6 * (many - few) / ((steps - steps // 4) * len(self.model.bodies)))

    def take_loop(self, steps: int) -> None:
        """Take a sample: processor time of the time loop alone."""
        with processor_time():
            seconds = self._report(steps).seconds["loop"]
        self.samples.append(1e6 * seconds / (steps * len(self.model.bodies)))

    def _seconds(self, steps: int) -> float:
        before = time.process_time()
        report = self._report(steps)
        self.iterations = report.iterations / steps
        return time.process_time() - before

    def _report(self, steps: int) -> Report:
        """Run the model for so many steps."""
        options = Options(solver="newton", error=OFF, full=self.full)
        model = ours.of_scheme(self.model, f"msahl {self.scheme}")
        report = ours.loop_report(model, SCHEMES[self.scheme], steps, options)
        if report.status != "completed":
            raise RuntimeError(report.message)
        return report


def measure(rows: list[Row], steps: Callable[[Row], int], repeats: int) -> None:
    """Take samples of all ``rows`` in turn; the first of each compiles and is dropped."""
    for repeat in range(repeats + 1):
        for row in rows:
            row.take(max(8, steps(row) // (10 if repeat == 0 else 1)))
            if repeat == 0:
                row.samples.clear()


def page(schemes: list[Row], sizes: list[Row]) -> str:
    """Return the results as Markdown."""
    steps = ", ".join(f"{scheme} {h:g} s" for scheme, h in SCHEMES.items())
    lines = [
        "# Cost of beams per node",
        "",
        *(f"- {line}" for line in describe()),
        "",
        f"Beam of {ELEMENTS + 1} nodes and chain of {ELEMENTS + 1} rigid bodies with a bushing "
        "between neighbours, of the same mass and stiffness. Microseconds of the processor per "
        "step and node or body (medians of samples taken in turn), the ratio to the chain with the "
        "same scheme, and Newton iterations per step in parentheses.",
        "",
        f"Step sizes: {steps}.",
        "",
        "| scheme | chain | " + " | ".join(f"degree {p}" for p in DEGREES) + " |",
        "|" + "---|" * (2 + len(DEGREES)),
    ]
    for scheme in dict.fromkeys(row.scheme for row in schemes):
        chain_row, *beams = [row for row in schemes if row.scheme == scheme]
        cells = [f"{chain_row.cost:.2f} ({chain_row.iterations:.1f})"]
        cells += [
            f"{r.cost:.2f}, {r.cost / chain_row.cost:.2f} ({r.iterations:.1f})" for r in beams
        ]
        lines.append(f"| {scheme} | " + " | ".join(cells) + " |")
    lines += [
        "",
        "Against the number of nodes, degree 3, preserving scheme:",
        "",
        "| nodes | µs/step/node |",
        "|---|---|",
        *(f"| {len(row.model.bodies)} | {row.cost:.2f} |" for row in sizes),
        "",
    ]
    return "\n".join(lines)


def planar_page(rows: list[Row]) -> str:
    """Return the results of beams in a plane as Markdown; forms in space follow those in it. Of the
    samples the least counts: a time loop is never faster than it is.
    """
    lines = [
        "# Cost of beams in a plane",
        "",
        *(f"- {line}" for line in describe()),
        "",
        "Straight beams, clamped at one end, that swing under gravity in a plane: microseconds of "
        "the processor per step and node of the time loop, in the plane (default) and in space "
        "(`--full`); the least of samples that are taken in turn.",
        "",
        "| scheme | beam | nodes | plane | space | ratio |",
        "|---|---|---|---|---|---|",
    ]
    for one, other in zip(rows[::2], rows[1::2], strict=True):
        plane, space = min(one.samples), min(other.samples)
        lines.append(
            f"| {one.scheme} | {one.name} | {len(one.model.bodies)} | {plane:.2f} | {space:.2f} | "
            f"{plane / space:.2f} |"
        )
    return "\n".join([*lines, ""])


def _planar_rows() -> list[Row]:
    """Return beams of 25 nodes of each degree, and a longer one, in the plane and in space."""
    sizes = [*((p, ELEMENTS // p) for p in DEGREES[::2]), (3, 64)]
    return [
        Row(f"degree {p}", beam(p, n, IN_PLANE), scheme, full)
        for scheme in SCHEMES
        for p, n in sizes
        for full in (False, True)
    ]


def main() -> None:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--planar", action="store_true")
    parser.add_argument("-o", type=Path, default=RESULTS)
    given = parser.parse_args()
    repeats, work = (1, 1_000) if given.quick else (5, 10_000)
    given.o.mkdir(parents=True, exist_ok=True)
    if given.planar:
        rows = _planar_rows()
        # Of five samples on a loaded machine the least was up to 1.7 times that of twelve.
        for _ in range(1 if given.quick else 12):
            for row in rows:
                row.take_loop(max(50, work // (2 * len(row.model.bodies))))
        (given.o / "planar_beams.md").write_text(planar_page(rows))
        return
    schemes = [
        Row(name, model, scheme)
        for scheme in SCHEMES
        for name, model in (
            ("chain", chain(ELEMENTS + 1)),
            *((f"degree {p}", beam(p, ELEMENTS // p)) for p in DEGREES),
        )
    ]
    sizes = [Row(f"{n} elements", beam(3, n), "preserving") for n in (4, 16, 64, 128)]
    for rows in (schemes, sizes):
        measure(rows, lambda row: max(100, work // len(row.model.bodies)), repeats)
    (given.o / "beam_cost.md").write_text(page(schemes, sizes))


if __name__ == "__main__":
    main()

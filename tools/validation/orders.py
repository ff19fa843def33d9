"""Write docs/validation/orders.md: observed orders of the schemes of higher order.

python -m tools.validation.orders        # a quarter of an hour: steps of 18 digits are uncompiled
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.model.loads import SpringDamper
from msahl.model.scheme import COLLOCATION, choices, split
from msahl.post.document import Block, Heading, Items, Paragraph
from msahl.post.table import Cell, Column, Table
from msahl.study.dynamics import Dynamics
from msahl.study.errors import state_errors
from msahl.study.independent import solve
from msahl.study.order import AGREE, LEAST_POINTS, Fit, fit_order
from msahl.study.runs import run_in_memory, with_step
from tools.validation import longdouble
from tools.validation.generated import write_generated
from tools.validation.longdouble import LONG
from tools.validation.thesis_runs import OUT, ROOT

WORDS = tuple(word for word in choices() if split(word)[0] in COLLOCATION)
"""The schemes whose order is observed."""
LADDER = (
    *range(1, 8),
    *range(8, 32, 2),
    *range(32, 64, 8),
    *range(64, 256, 32),
    *range(256, 2049, 256),
)
"""Numbers of steps between two of the times at which errors are taken."""
BEST = 64
"""That number for the reference."""
QUANTITIES = ("position", "orientation", "velocity", "angular_velocity", "reaction")
COARSE = 0.1
"""Largest error of a fit, over the size of the quantity: larger errors show no order yet."""
CLEAR = 100.0
"""Smallest ratio of an error of a fit and its rounding error."""
LEAST = 1e-11, 4e-14
"""Smallest error of a fit in double precision, up to order 6 and above: low orders take more steps,
each solved to 1e-14 of its motion."""
NEAR = 0.15
"""Largest difference of an observed order from the theoretical one."""
SLOW = 0.06
"""Difference from which on a comment is given."""


def order_of(word: str) -> int:
    """Return the theoretical order of a scheme."""
    name, degree = split(word)
    assert degree is not None
    return 2 * degree - COLLOCATION[name].decays


def number_of(word: str) -> type:
    """Return the type of numbers in which the errors of a scheme show their order: above order 6
    the machine's longest, because errors in double precision are rounding errors too soon.
    """
    return LONG if order_of(word) > 6 and longdouble.ROUND_OFF < 1.0 else float


@dataclass(frozen=True)
class Case:
    """A model, its duration [s], and the number of times at which errors are taken."""

    description: str
    make: Callable[[], Model]
    t_final: float
    outputs: int = 4

    @property
    def times(self) -> np.ndarray:
        """Return the times at which errors are taken [s]."""
        return self.t_final / self.outputs * np.arange(1, self.outputs + 1)

    def step(self, per_output: int) -> float:
        """Return the step size for a number of steps per output time [s]."""
        return self.t_final / (self.outputs * per_output)

    @cached_property
    def model(self) -> Model:
        """Return the model."""
        return self.make()


def _deck(place: str) -> Callable[[], Model]:
    return lambda: read_deck(ROOT / "decks" / f"{place}.xml")


def asymmetric_top() -> Model:
    """The thesis's first top with three different inertias, its spin inclined to their axes."""
    model = _deck("thesis/top_1")()
    (top,) = model.bodies
    inertia = ((0.4, 0.0, 0.0), (0.0, 0.6, 0.0), (0.0, 0.0, 0.75))
    return replace(model, bodies=(replace(top, inertia=inertia, angular_velocity=(1.0, 2.0, 5.0)),))


def thrown_on_a_spring() -> Model:
    """The deck's body, thrown and turning, on a spring and damper fixed off its centre."""
    model = _deck("forces/spring_damper")()
    (body,), (spring,) = model.bodies, model.loads
    assert isinstance(spring, SpringDamper)
    inertia = ((0.01, 0.0, 0.0), (0.0, 0.02, 0.0), (0.0, 0.0, 0.025))
    thrown = replace(
        body, inertia=inertia, velocity=(0.3, 1.0, 0.5), angular_velocity=(2.0, 1.0, 3.0)
    )
    return replace(
        model, bodies=(thrown,), loads=(replace(spring, child_point=(0.05, 0.08, 0.02)),)
    )


CASES = {
    "double pendulum": Case("from 89 degrees", _deck("thesis/double_pendulum_89"), 2.4),
    "asymmetric top": Case("heavy, of three different inertias", asymmetric_top, 1.6),
    "four-bar": Case(
        "a closed loop with redundant joints", _deck("mechanisms/four_bar_sketched"), 0.6
    ),
    "spring": Case("a body thrown on a spring and damper", thrown_on_a_spring, 1.2),
    "Andrews": Case("the squeezer mechanism", _deck("mechanisms/andrews_squeezer"), 0.016),
}


@dataclass(frozen=True)
class Results:
    """States (m, 12 n) and reactions (m, k) at the times at which errors are taken."""

    states: np.ndarray
    reactions: np.ndarray


def run_case(case: Case, word: str, number: type, per_output: int) -> Results | None:
    """Run a case with a number of steps per output time, in numbers of a type; return None if a
    step does not converge.
    """
    model = with_step(case.model, case.step(per_output), case.t_final, word)
    if number is LONG:
        found = longdouble.run(model, case.outputs * per_output, case.outputs)
        return Results(*found) if found else None
    report, run = run_in_memory(model, Options(solver="newton", every=per_output))
    if report.status != "completed" or report.subdivisions:
        return None
    forces = (
        np.zeros((case.outputs, 0)) if run.reactions is None else run.reactions.to_numpy()[1:, 1:]
    )
    return Results(run.states.to_numpy()[1:, 1:], forces)


def errors(results: Results, true: Results) -> dict[str, float]:
    """Return root mean square errors over the size of the quantity, by quantity."""
    found = {}
    zero = np.zeros_like(true.states)
    sizes = state_errors(true.states, zero)
    for key, series in state_errors(results.states, true.states).items():
        size = 1.0 if key == "orientation" else _norm(sizes[key])
        if size > 0.0:
            found[key] = _norm(series) / size
    if results.reactions.any():
        found["reaction"] = _norm(results.reactions - true.reactions) / _norm(true.reactions)
    return found


def _norm(array: np.ndarray) -> float:
    return float(np.sqrt((array**2).mean()))


@cache
def truth(name: str, number: type, per_output: int) -> Results:
    """Return the results of gauss5 at a step size at which only rounding errors remain."""
    results = run_case(CASES[name], "gauss5", number, per_output)
    assert results is not None, name
    return results


@cache
def round_off(name: str, number: type, per_output: int) -> dict[str, float]:
    """Return by how much such references differ, by quantity; of two pairs the larger."""
    true = truth(name, number, per_output)
    differences = [errors(truth(name, number, per_output * part // 16), true) for part in (14, 15)]
    return {key: max(found[key] for found in differences) for key in differences[0]}


@dataclass(frozen=True)
class Ladder:
    """Step sizes [s] and errors of a scheme's runs by quantity, without those that are too large or
    that rounding errors dominate.
    """

    word: str
    known: dict[str, list[tuple[float, float]]]

    def fit(self, quantity: str) -> Fit | None:
        """Return the order of a quantity from slopes that agree; None if none do."""
        known = self.known.get(quantity, [])
        return fit_order([h for h, _ in known], [error for _, error in known])

    def mean_slope(self, quantity: str) -> float | None:
        """Return the slope of the least-squares line of all known errors."""
        known = self.known.get(quantity, [])
        if len(known) < LEAST_POINTS:
            return None
        x, y = np.log(np.array(known, dtype=float)).T
        return float(np.polyfit(x, y, 1)[0])


def climb(
    name: str, word: str, number: type, ladder: Sequence[int] = LADDER, best: int = BEST
) -> Ladder:
    """Run a case in numbers of a type at smaller and smaller steps until only rounding errors are
    left; ``best`` is the number of steps per output time of the reference.
    """
    case, found = CASES[name], Ladder(word, {})
    true, least = truth(name, number, best), round_off(name, number, best)
    floor = LEAST[order_of(word) > 6]
    if number is LONG:
        floor *= longdouble.ROUND_OFF
    for per_output in ladder:
        results = run_case(case, word, number, per_output)
        if results is None:
            continue
        now = errors(results, true)
        # Rounding errors grow with the number of steps.
        grown = CLEAR * max(1.0, per_output / best) ** 0.5
        clear = {key: e for key, e in now.items() if e > max(grown * least[key], floor)}
        for key, error in clear.items():
            if error <= COARSE:
                found.known.setdefault(key, []).append((case.step(per_output), error))
        if not clear:
            break
    return found


def main() -> None:
    """Run all cases and write the page."""
    ladders = {}
    for name in CASES:
        for word in WORDS:
            ladders[name, word] = climb(name, word, number_of(word))
            print(name, word, *_cells(ladders[name, word]), flush=True)
    write_generated(OUT / "orders.md", "tools.validation.orders", build(ladders))


def build(ladders: dict[tuple[str, str], Ladder]) -> Iterator[Block]:
    """Yield the blocks of the page."""
    yield Heading(1, "Observed orders of the schemes of higher order")
    yield Paragraph(
        "In theory the order is 2s for gauss and 2s - 1 for radau of degree s, for all "
        "quantities. Errors are taken at a few times that all runs of a case have in common: the "
        "root mean square error over that of the quantity (orientations: in rad), of the body "
        "with the largest error or of all reactions. The reference is gauss5 at a step size at "
        "which only rounding errors are left; its difference from the independent solution "
        "(scipy's DOP853 at 1e-13, constraint violation removed at each step) is given below. The "
        f"order is the slope of the longest range of at least three errors, from {COARSE:g} down "
        f"to rounding errors, whose slopes agree within {AGREE:g} and that ends at the finest "
        "step; +- is the 95 % interval of the least-squares fit. If there is no such range, the "
        "slope of the least-squares line of all errors is given, with a ~."
    )
    yield Paragraph(
        f"Schemes above order 6 run with {_digits(LONG)} digits (numpy's longdouble) if the "
        f"machine has more than {_digits(float)}, and so does their reference: in double precision "
        "their errors fall from those of a too large step to rounding errors within a factor of "
        "two or three of the step size. They use the same kernels, uncompiled, with all digits of "
        "the quadrature rule, and each step is solved to correspondingly more digits."
    )
    for name, case in CASES.items():
        yield Heading(2, name[0].upper() + name[1:])
        description = case.description[0].upper() + case.description[1:]
        yield Paragraph(f"{description}; run for {case.t_final:g} s.")
        yield _table({word: ladders[name, word] for word in WORDS})
    yield Heading(2, "Agreement with the theory")
    yield Items(tuple(_remarks(ladders)))
    yield Heading(2, "Difference of the reference and the independent solution")
    yield _agreement()


def _digits(number: type) -> int:
    return int(np.finfo(number).precision)


def _cells(ladder: Ladder) -> Iterator[Cell]:
    for quantity in QUANTITIES:
        fit, slope = ladder.fit(quantity), ladder.mean_slope(quantity)
        if fit:
            yield f"{fit.order:.2f} +- {fit.uncertainty:.2f}"
        else:
            yield None if slope is None else f"~ {slope:.1f}"


def _table(ladders: dict[str, Ladder]) -> Table:
    columns = (
        Column("scheme", "scheme"),
        Column("theory", "theory", form="d"),
        Column("digits", "digits", form="d"),
        *(Column(quantity, quantity, missing="") for quantity in QUANTITIES),
        Column("coarsest", "fitted from [s]", form=".2g", missing=""),
        Column("finest", "to [s]", form=".2g", missing=""),
    )
    rows = []
    for word, ladder in ladders.items():
        fit = ladder.fit("velocity")
        span = (fit.coarsest, fit.finest) if fit else (None, None)
        rows.append((word, order_of(word), _digits(number_of(word)), *_cells(ladder), *span))
    return Table(columns, tuple(rows))


def _remarks(ladders: dict[tuple[str, str], Ladder]) -> Iterator[tuple[str, str]]:
    """Yield how many orders agree with the theory, which of them least, and which do not."""
    near, slow, far = 0, list[tuple[str, str]](), list[tuple[str, str]]()
    for (name, word), ladder in ladders.items():
        for quantity, known in ladder.known.items():
            fit, cell = ladder.fit(quantity), f"{name}, {word}, {quantity}"
            if fit is None or abs(fit.order - order_of(word)) > NEAR:
                found = f"{fit.order:.2f}" if fit else "slopes that do not agree"
                far.append((cell, f"{found}; errors {' '.join(f'{e:.0e}' for _, e in known)}"))
                continue
            near += 1
            if abs(fit.order - order_of(word)) > SLOW:
                slope = np.diff(np.log(known[-2:]), axis=0)[0]
                slow.append((cell, f"{fit.order:.2f}; {slope[1] / slope[0]:.2f}"))
    yield "", f"{near} of {near + len(far)} observed orders are within {NEAR:g} of the theory."
    if slow:
        yield (
            "",
            f"These differ from it by more than {SLOW:g}; the second number is the slope between "
            "the two finest errors. In the largest errors of a fit the next power of the step "
            "size counts, the smallest contain up to a hundredth of rounding error.",
        )
    yield from slow
    if far:
        yield "", "These do not agree with it; the errors of the fit are given."
    yield from far


def _agreement() -> Table:
    """Return a table of relative differences of references and independent solutions."""
    columns = (
        Column("case", "case"),
        *(Column(quantity, quantity, form=".0e", missing="") for quantity in QUANTITIES),
    )
    rows = []
    for name, case in CASES.items():
        dynamics = Dynamics(case.model)
        table = dynamics.publish(solve(dynamics, case.times, 1e-13))
        true = truth(name, number_of("gauss5"), BEST)
        differences = errors(Results(table, np.zeros((case.outputs, 0))), true)
        rows.append((name, *(differences.get(quantity) for quantity in QUANTITIES)))
    return Table(columns, tuple(rows))


if __name__ == "__main__":
    main()

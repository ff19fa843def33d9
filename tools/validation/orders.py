"""Observed orders of the schemes of higher order: docs/validation/orders.md.

python tools/validation/orders.py        # a quarter of an hour: steps of 18 digits are uncompiled
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import longdouble
import numpy as np
from longdouble import LONG
from measured import OUT, ROOT

from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.model.loads import SpringDamper
from msahl.model.scheme import COLLOCATION, choices, split
from msahl.post.document import Block, Heading, Items, Paragraph, as_markdown
from msahl.post.table import Cell, Column, Table
from msahl.study.dynamics import Dynamics
from msahl.study.errors import state_errors
from msahl.study.independent import solve
from msahl.study.order import AGREE, LEAST_POINTS, Fit, fit_order
from msahl.study.runs import run_in_memory, with_step

WORDS = tuple(word for word in choices() if split(word)[0] in COLLOCATION)
"""The schemes measured."""
LADDER = (
    *range(1, 8),
    *range(8, 32, 2),
    *range(32, 64, 8),
    *range(64, 256, 32),
    *range(256, 2049, 256),
)
"""Steps from one of the times where errors are taken to the next."""
BEST = 64
"""Such steps of the reference."""
QUANTITIES = ("position", "orientation", "velocity", "spin", "reaction")
COARSE = 0.1
"""Largest error fitted, over the quantity's own size: beyond it a step shows no order yet."""
CLEAR = 100.0
"""Times its round-off that the smallest error fitted must be."""
LEAST = 1e-11, 4e-14
"""Smallest error fitted in double precision, to order 6 and beyond: the former take more steps,
each solved to 1e-14 of its motion."""
NEAR = 0.15
"""How near the order of the theory an observed one must be."""
SLOW = 0.06
"""How far from it one may be without a word."""


def order_of(word: str) -> int:
    """Order in theory of a scheme."""
    name, degree = split(word)
    assert degree is not None
    return 2 * degree - COLLOCATION[name].decays


def number_of(word: str) -> type:
    """Numbers in which the errors of a scheme show their order before they are round-off: beyond
    order 6 the longest of the machine.
    """
    return LONG if order_of(word) > 6 and longdouble.ROUND_OFF < 1.0 else float


@dataclass(frozen=True)
class Scene:
    """A scene, how it is made, how long it is followed [s], and at how many times on its way errors
    are taken.
    """

    words: str
    make: Callable[[], Model]
    t_final: float
    rows: int = 4

    @property
    def times(self) -> np.ndarray:
        """Where errors are taken."""
        return self.t_final / self.rows * np.arange(1, self.rows + 1)

    def step(self, per_row: int) -> float:
        """Size of so many steps from row to row [s]."""
        return self.t_final / (self.rows * per_row)

    @cached_property
    def model(self) -> Model:
        """The scene itself."""
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


SCENES = {
    "double pendulum": Scene("from 89 degrees", _deck("thesis/double_pendulum_89"), 2.4),
    "asymmetric top": Scene("heavy, of three different inertias", asymmetric_top, 1.6),
    "four-bar": Scene(
        "a closed loop with redundant joints", _deck("mechanisms/four_bar_sketched"), 0.6
    ),
    "spring": Scene("a body thrown on a spring and damper", thrown_on_a_spring, 1.2),
    "Andrews": Scene("the squeezer mechanism", _deck("mechanisms/andrews_squeezer"), 0.016),
}


@dataclass(frozen=True)
class Rows:
    """States (m, 12 n) and reactions (m, k) at the times where errors are taken."""

    states: np.ndarray
    reactions: np.ndarray


def run_rows(scene: Scene, word: str, number: type, per_row: int) -> Rows | None:
    """A run of so many steps from row to row, in numbers of a kind; None if it does not come to its
    end.
    """
    model = with_step(scene.model, scene.step(per_row), scene.t_final, word)
    if number is LONG:
        found = longdouble.run(model, scene.rows * per_row, scene.rows)
        return Rows(*found) if found else None
    report, run = run_in_memory(model, Options(solver="newton", every=per_row))
    if report.status != "completed" or report.subdivisions:
        return None
    forces = (
        np.zeros((scene.rows, 0)) if run.reactions is None else run.reactions.to_numpy()[1:, 1:]
    )
    return Rows(run.states.to_numpy()[1:, 1:], forces)


def errors(rows: Rows, true: Rows) -> dict[str, float]:
    """Root of the mean square over the rows, over the quantity's own size, by quantity."""
    found = {}
    zero = np.zeros_like(true.states)
    sizes = state_errors(true.states, zero)
    for key, series in state_errors(rows.states, true.states).items():
        size = 1.0 if key == "orientation" else _norm(sizes[key])
        if size > 0.0:
            found[key] = _norm(series) / size
    if rows.reactions.any():
        found["reaction"] = _norm(rows.reactions - true.reactions) / _norm(true.reactions)
    return found


def _norm(array: np.ndarray) -> float:
    return float(np.sqrt((array**2).mean()))


@cache
def truth(name: str, number: type, per_row: int) -> Rows:
    """The scene by gauss5 at a step below which only round-off changes."""
    rows = run_rows(SCENES[name], "gauss5", number, per_row)
    assert rows is not None, name
    return rows


@cache
def round_off(name: str, number: type, per_row: int) -> dict[str, float]:
    """By how much such references differ, by quantity; two of them may be near by chance."""
    true = truth(name, number, per_row)
    apart = [errors(truth(name, number, per_row * part // 16), true) for part in (14, 15)]
    return {key: max(found[key] for found in apart) for key in apart[0]}


@dataclass(frozen=True)
class Ladder:
    """Steps [s] and errors of a scheme's runs by quantity, where they are neither too coarse nor
    spoilt by round-off.
    """

    word: str
    known: dict[str, list[tuple[float, float]]]

    def fit(self, quantity: str) -> Fit | None:
        """Order of a quantity, where neighbouring slopes agree; None if they do nowhere."""
        known = self.known.get(quantity, [])
        return fit_order([h for h, _ in known], [error for _, error in known])

    def mean_slope(self, quantity: str) -> float | None:
        """Slope of the straight line nearest to all known errors."""
        known = self.known.get(quantity, [])
        if len(known) < LEAST_POINTS:
            return None
        return float(np.polyfit(*np.log(known).T, 1)[0])


def climb(
    name: str, word: str, number: type, ladder: Sequence[int] = LADDER, best: int = BEST
) -> Ladder:
    """Runs in numbers of a kind, at smaller and smaller steps until nothing but round-off is left;
    ``best`` tells the reference's.
    """
    scene, found = SCENES[name], Ladder(word, {})
    true, least = truth(name, number, best), round_off(name, number, best)
    floor = LEAST[order_of(word) > 6]
    if number is LONG:
        floor *= longdouble.ROUND_OFF
    for per_row in ladder:
        rows = run_rows(scene, word, number, per_row)
        if rows is None:
            continue
        now = errors(rows, true)
        # The more the steps, the more there is of it.
        grown = CLEAR * max(1.0, per_row / best) ** 0.5
        clear = {key: e for key, e in now.items() if e > max(grown * least[key], floor)}
        for key, error in clear.items():
            if error <= COARSE:
                found.known.setdefault(key, []).append((scene.step(per_row), error))
        if not clear:
            break
    return found


def main() -> None:
    """Measure all and write the page."""
    ladders = {}
    for name in SCENES:
        for word in WORDS:
            ladders[name, word] = climb(name, word, number_of(word))
            print(name, word, *_cells(ladders[name, word]), flush=True)
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "orders.md").write_text(as_markdown(list(build(ladders))))


def build(ladders: dict[tuple[str, str], Ladder]) -> Iterator[Block]:
    """The page."""
    yield Heading(1, "Observed orders of the schemes of higher order")
    yield Paragraph(
        "Theory: 2s for gauss and 2s - 1 for radau of degree s, in everything. Errors are taken at "
        "a few times that all runs of a scene have in common: the root of their mean square over "
        "the quantity's own (turns: in rad), of the worst body or of all reactions. The reference "
        "is gauss5 at a step where nothing but round-off is left; how far the independent solution "
        "(scipy's DOP853 at 1e-13, joints closed at each step) is from it stands below. The order "
        f"is the slope of the longest stretch of at least three errors, from {COARSE:g} down to "
        f"round-off, whose slopes agree within {AGREE:g} and that ends at the finest; +- is the 95 "
        "% interval of the least squares. Where no such stretch is, the slope of the line nearest "
        "to all of them stands, with a ~. Made by python tools/validation/orders.py."
    )
    yield Paragraph(
        f"Schemes beyond order 6 run with {_digits(LONG)} digits (numpy's longdouble) where the "
        f"machine has more than {_digits(float)}, and so does their reference: in double precision "
        "their errors pass from a step too long for the motion to round-off within a factor of two "
        "or three of it. These are the same kernels, uncompiled, on the same scene, with the "
        "rule's numbers to all digits, each step solved to as many more as there are."
    )
    for name, scene in SCENES.items():
        yield Heading(2, name[0].upper() + name[1:])
        words = scene.words[0].upper() + scene.words[1:]
        yield Paragraph(f"{words}; followed for {scene.t_final:g} s.")
        yield _table({word: ladders[name, word] for word in WORDS})
    yield Heading(2, "Near the theory")
    yield Items(tuple(_remarks(ladders)))
    yield Heading(2, "The reference against the independent solution")
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
    """How many orders are near the theory, which of them least, and which are not."""
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
            f"Farther than {SLOW:g} from it are these, the slope between the two finest errors "
            "beside them: in the largest errors that are fitted the next power of the step counts, "
            "in the smallest up to a hundredth is round-off.",
        )
    yield from slow
    if far:
        yield "", "The others follow, with the errors that were fitted."
    yield from far


def _agreement() -> Table:
    """Largest differences of the references from the independent solution, over their sizes."""
    columns = (
        Column("scene", "scene"),
        *(Column(quantity, quantity, form=".0e", missing="") for quantity in QUANTITIES),
    )
    rows = []
    for name, scene in SCENES.items():
        dynamics = Dynamics(scene.model)
        table = dynamics.publish(solve(dynamics, scene.times, 1e-13))
        true = truth(name, number_of("gauss5"), BEST)
        apart = errors(Rows(table, np.zeros((scene.rows, 0))), true)
        rows.append((name, *(apart.get(quantity) for quantity in QUANTITIES)))
    return Table(columns, tuple(rows))


if __name__ == "__main__":
    main()

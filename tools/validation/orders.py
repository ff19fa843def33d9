"""Observed orders of the schemes of higher order: docs/validation/orders.md.

python tools/validation/orders.py
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from measured import OUT, ROOT

from msahl.deck import read_deck
from msahl.forces.records import SpringDamper
from msahl.model import Model
from msahl.post.document import Block, Heading, Items, Paragraph, as_markdown
from msahl.post.table import Cell, Column, Table
from msahl.run import Options
from msahl.schemes import HIGHER, choices, split
from msahl.study.dynamics import Dynamics
from msahl.study.errors import state_errors
from msahl.study.independent import solve
from msahl.study.order import AGREE, LEAST_POINTS, Fit, fit_order
from msahl.study.runs import run_in_memory, with_step

WORDS = tuple(word for word in choices() if split(word)[0] in HIGHER)
"""The schemes measured."""
LADDER = (
    *range(1, 8),
    *range(8, 16, 2),
    *range(16, 32, 4),
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
CLEAR = {10: 30.0}
"""Times the round-off of gauss5 that the smallest error fitted must be, by order, else a hundred:
errors of order 10 leave no room for more."""
LEAST = {8: 4e-14, 10: 0.0}
"""Smallest error fitted by order, else 1e-11: the others take more steps, each solved to 1e-14 of
its motion."""
NEAR = 0.15
"""How near the order of the theory an observed one must be."""


def order_of(word: str) -> int:
    """Order in theory of a scheme."""
    name, degree = split(word)
    assert degree is not None
    return 2 * degree - HIGHER[name].decays


@dataclass(frozen=True)
class Span:
    """How long a scene is followed [s], and at how many times on its way errors are taken."""

    t_final: float
    rows: int

    @property
    def times(self) -> np.ndarray:
        """Where errors are taken."""
        return self.t_final / self.rows * np.arange(1, self.rows + 1)


@dataclass(frozen=True)
class Scene:
    """A scene, how it is made, and how long it is followed; by the highest degree, whose steps are
    long and whose errors soon are round-off, shorter.
    """

    words: str
    make: Callable[[], Model]
    long: Span
    short: Span

    def span(self, word: str) -> Span:
        """What a scheme is measured over."""
        return self.short if order_of(word) > 8 else self.long

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
    "double pendulum": Scene(
        "from 89 degrees", _deck("thesis/double_pendulum_89"), Span(2.4, 4), Span(1.4, 2)
    ),
    "asymmetric top": Scene(
        "heavy, of three different inertias", asymmetric_top, Span(1.6, 4), Span(3.2, 4)
    ),
    "four-bar": Scene(
        "a closed loop with redundant joints",
        _deck("mechanisms/four_bar_sketched"),
        Span(0.6, 4),
        Span(0.2, 2),
    ),
    "spring": Scene(
        "a body thrown on a spring and damper", thrown_on_a_spring, Span(1.2, 4), Span(0.25, 2)
    ),
    "Andrews": Scene(
        "the squeezer mechanism",
        _deck("mechanisms/andrews_squeezer"),
        Span(0.012, 4),
        Span(0.008, 2),
    ),
}


@dataclass(frozen=True)
class Rows:
    """States (m, 12 n) and reactions (m, k) at the times where errors are taken."""

    states: np.ndarray
    reactions: np.ndarray


def run_rows(scene: Scene, span: Span, word: str, per_row: int) -> Rows | None:
    """A run of so many steps from row to row; None if it does not come to its end."""
    model = with_step(scene.model, span.t_final / (span.rows * per_row), span.t_final, word)
    report, run = run_in_memory(model, Options(solver="newton", every=per_row))
    if report.status != "completed" or report.halvings:
        return None
    forces = np.zeros((span.rows, 0)) if run.reactions is None else run.reactions.to_numpy()[1:, 1:]
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
def truth(name: str, span: Span) -> Rows:
    """The scene by gauss5 at a step below which only round-off changes."""
    rows = run_rows(SCENES[name], span, "gauss5", BEST)
    assert rows is not None, name
    return rows


@cache
def round_off(name: str, span: Span) -> dict[str, float]:
    """By how much two such references differ, by quantity."""
    other = run_rows(SCENES[name], span, "gauss5", BEST * 7 // 8)
    assert other is not None, name
    return errors(other, truth(name, span))


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


def climb(name: str, word: str, ladder: Sequence[int] = LADDER) -> Ladder:
    """Runs at smaller and smaller steps until nothing but round-off is left."""
    scene = SCENES[name]
    span = scene.span(word)
    least, found = round_off(name, span), Ladder(word, {})
    for per_row in ladder:
        rows = run_rows(scene, span, word, per_row)
        if rows is None:
            continue
        now = errors(rows, truth(name, span))
        # The more the steps, the more there is of it.
        grown = CLEAR.get(order_of(word), 100.0) * max(1.0, per_row / BEST) ** 0.5
        floor = LEAST.get(order_of(word), 1e-11)
        clear = {key: e for key, e in now.items() if e > max(grown * least[key], floor)}
        for key, error in clear.items():
            if error <= COARSE:
                h = span.t_final / (span.rows * per_row)
                found.known.setdefault(key, []).append((h, error))
        if not clear:
            break
    return found


def main() -> None:
    """Measure all and write the page."""
    ladders = {}
    for name in SCENES:
        for word in WORDS:
            ladders[name, word] = climb(name, word)
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
    for name, scene in SCENES.items():
        yield Heading(2, name[0].upper() + name[1:])
        words, spans = scene.words[0].upper() + scene.words[1:], (scene.long, scene.short)
        ends = ", by gauss5 ".join(f"{span.t_final:g} s" for span in spans)
        yield Paragraph(f"{words}; followed for {ends}.")
        yield _table({word: ladders[name, word] for word in WORDS})
    yield Heading(2, "Near the theory")
    yield Items(tuple(_remarks(ladders)))
    yield Heading(2, "The reference against the independent solution")
    yield _agreement()


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
        *(Column(quantity, quantity, missing="") for quantity in QUANTITIES),
        Column("coarsest", "fitted from [s]", form=".2g", missing=""),
        Column("finest", "to [s]", form=".2g", missing=""),
    )
    rows = []
    for word, ladder in ladders.items():
        fit = ladder.fit("velocity")
        span = (fit.coarsest, fit.finest) if fit else (None, None)
        rows.append((word, order_of(word), *_cells(ladder), *span))
    return Table(columns, tuple(rows))


def _remarks(ladders: dict[tuple[str, str], Ladder]) -> Iterator[tuple[str, str]]:
    """How many orders are near the theory, and which are not."""
    near, far = 0, list[tuple[str, str]]()
    for (name, word), ladder in ladders.items():
        for quantity in ladder.known:
            fit = ladder.fit(quantity)
            if fit and abs(fit.order - order_of(word)) <= NEAR:
                near += 1
            else:
                known = " ".join(f"{error:.0e}" for _, error in ladder.known[quantity])
                found = f"{fit.order:.2f}" if fit else "slopes that do not agree"
                far.append((f"{name}, {word}, {quantity}", f"{found}; errors {known}"))
    yield "", f"{near} of {near + len(far)} observed orders are within {NEAR:g} of the theory."
    if far:
        yield (
            "",
            "The others follow, with the errors that were fitted. An error of order 8 or 10 passes "
            "from the first steps that are short for the motion to round-off within a factor of "
            "two or three of the step; where the motion has quick moments little of the theory's "
            "slope is left between the two.",
        )
    yield from far


def _agreement() -> Table:
    """Largest differences of the references from the independent solution, over their sizes."""
    columns = (
        Column("scene", "scene"),
        *(Column(quantity, quantity, form=".0e", missing="") for quantity in QUANTITIES),
    )
    rows = []
    for name, scene in SCENES.items():
        times, dynamics = scene.long.times, Dynamics(scene.model)
        table = dynamics.publish(solve(dynamics, times, 1e-13))
        apart = errors(Rows(table, np.zeros((len(times), 0))), truth(name, scene.long))
        rows.append((name, *(apart.get(quantity) for quantity in QUANTITIES)))
    return Table(columns, tuple(rows))


if __name__ == "__main__":
    main()

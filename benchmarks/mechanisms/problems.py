"""The nine mechanisms, each with the motion that is compared."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from benchmarks.mechanisms.gears import gear_train
from benchmarks.mechanisms.net import net
from benchmarks.mechanisms.robot import robot
from benchmarks.mechanisms.suspension import suspension
from benchmarks.problems import Problem
from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.run.loop import run
from msahl.run.tables import STATES, MemorySink

DECKS = Path(__file__).parents[2] / "decks" / "mechanisms"


def _deck(name: str) -> Callable[[], Model]:
    """Return a function that reads the deck, without its motors: not every program has them."""
    return lambda: replace(read_deck(DECKS / f"{name}.xml"), motions=())


MODELS: dict[str, tuple[Callable[[], Model], float, int]] = {
    "four-bar": (_deck("four_bar"), 0.1, 10),
    "slider-crank": (_deck("spatial_slider_crank"), 0.1, 10),
    "squeezer": (_deck("andrews_squeezer"), 0.003, 10),
    "governor": (_deck("flyball_governor"), 0.05, 20),
    "robot": (robot, 0.05, 20),
    "suspension": (suspension, 0.05, 20),
    "Bricard": (_deck("bricard"), 0.1, 20),
    "gear train": (gear_train, 0.1, 10),
    "net": (net, 0.05, 10),
}
"""By name: the model, the interval of output times [s] and how many of these are run."""

ABOUT = {
    "four-bar": "The deck `four_bar.xml` without its motor: crank and rocker, planar, released at "
    "one revolution per second under gravity; 1 s.",
    "slider-crank": "The deck `spatial_slider_crank.xml`: hinge, ball, universal joint and slider "
    "in one loop, under gravity; 1 s.",
    "squeezer": "Andrews' squeezer, the deck `andrews_squeezer.xml`: seven bodies in three planar "
    "loops, a stiff spring and a constant moment; 0.03 s, in which the crank makes two and a half "
    "revolutions.",
    "governor": "The stiff flyball governor, the deck `flyball_governor.xml`: a tree of hinges and "
    "a slider, with two spring-dampers (8e5 N/m, 4e4 N s/m) whose motions fade within 1e-4 s; 1 s.",
    "robot": "A serial robot of six revolutes under gravity, with viscous friction in all joints "
    "(4, 6, 4, 0.4, 0.3 and 0.1 N m s/rad): not every program has the same law of dry friction; "
    "1 s.",
    "suspension": "The corner of a car: double wishbone with an inclined hinge, tie rod, "
    "spring-damper and tyre; five bodies, hinges, slider, universal joint and three balls, two "
    "loops; dropped, 1 s.",
    "Bricard": "Bricard's mechanism, the deck `bricard.xml`: five bars and six hinges in a loop "
    "that moves although its equations are redundant; from rest, 2 s.",
    "gear train": "A planetary gear train (sun, carrier, three planets, fixed ring) that lifts an "
    "eccentric load by a constant moment on the sun; 1 s.",
    "net": "A hinged net of 10 x 10 meshes, which swings in its plane: 210 bodies, 100 loops, 310 "
    "hinges; each loop is closed by the two equations of a hinge that the others do not imply "
    "(msahl: `pointOnLine`); 0.5 s.",
}
"""What each one is, for the page."""
SERIES = {"net": 10}
"""Bodies one after the other, where this is not all of them."""


def mechanism(name: str) -> Problem:
    """Return one of the ``MODELS`` as a problem, with velocities that are consistent."""
    build, grid, rows = MODELS[name]
    model, span = consistent(build()), grid * rows
    return Problem(name, model, (), span, span, grid, rows, SERIES.get(name, 0))


def described(name: str) -> Problem:
    """Return a mechanism as its deck or module gives it, to read results of it."""
    build, grid, rows = MODELS[name]
    return Problem(name, build(), (), grid * rows, grid * rows, grid, rows)


@lru_cache(maxsize=len(MODELS))
def consistent(model: Model) -> Model:
    """Return the model with the velocities that msahl starts from, which all programs are given."""
    rows = MemorySink(only=(STATES,))
    short = replace(model.simulation, dt=1e-6, t_final=1e-6)
    run(replace(model, simulation=short), Options(solver="newton", error=OFF), rows)
    start = rows.table(STATES)[0, 1:].reshape(len(model.bodies), 4, 3)
    bodies = (
        replace(body, velocity=tuple(state[2].tolist()), angular_velocity=tuple(state[3].tolist()))
        for body, state in zip(model.bodies, start, strict=True)
    )
    return replace(model, bodies=tuple(bodies))

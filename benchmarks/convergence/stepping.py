"""Take steps of the element by MINPACK's hybrid method, with or without each weakness."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize._minpack_py import _minpack

from benchmarks.convergence.element import Chain, Start, State, jacobian, matrix, residual
from msahl.algebra.rotation import compose
from msahl.deck import read_deck
from msahl.study.dynamics import first_state
from msahl.system.build import build_system
from msahl.system.state import build_state

DECKS = Path(__file__).parents[2] / "decks" / "thesis"


@dataclass(frozen=True)
class Program:
    """``scaled`` unknowns and rows; a true Jacobian or finite ``differences``; ``total``
    parameters; velocities ``as_given``; the ``tolerance`` asked of the solver, a relative change;
    and if given, an ``absolute`` bound on every row in SI units that decides in its stead."""

    name: str
    scaled: bool = True
    differences: bool = False
    total: bool = False
    as_given: bool = False
    tolerance: float = 1e-8
    absolute: float | None = None


def read_chain(deck: str, as_given: bool = False) -> tuple[Chain, State]:
    """Chain and first state of a deck; the velocities consistent unless ``as_given``."""
    model = read_deck(DECKS / f"{deck}.xml")
    state = build_state(model, build_system(model)) if as_given else first_state(model)[1]
    n = len(model.bodies)
    up, down = np.zeros((n, 3)), np.zeros((n, 3))
    for b, joint in enumerate(model.joints):
        up[b] = joint.child_point
        if b:
            down[b - 1] = joint.parent_point
    mass = np.array([body.mass for body in model.bodies])
    inertia = np.array([body.inertia for body in model.bodies])
    chain = Chain(mass, inertia, up, down, np.array(model.gravity, dtype=float))
    return chain, State(*(a[:n].copy() for a in (state.x, state.p, state.v, state.w)))


def scales(chain: Chain, h: float) -> tuple[np.ndarray, np.ndarray]:
    """Sizes of the unknowns and of the equations, lengths in arms, velocities by h."""
    n, length = chain.mass.size, np.linalg.norm(chain.up, axis=1)
    columns, rows = np.ones(15 * n), np.ones(15 * n)
    for b in range(n):
        m, size = chain.mass[b], length[b]
        k = 12 * b
        columns[k : k + 12] = np.repeat([size, 1.0, size / h, 1.0 / h], 3)
        rows[k : k + 12] = np.repeat([1 / size, 1.0, h / (2 * m * size), h / (2 * m * size**2)], 3)
        columns[12 * n + 3 * b : 12 * n + 3 * b + 3] = 2 * m * size / h**2
        rows[12 * n + 3 * b : 12 * n + 3 * b + 3] = 1 / size
    return columns, rows


class Stepper:
    """The state of a chain between two steps."""

    def __init__(self, chain: Chain, state: State, h: float, program: Program) -> None:
        self.chain, self.state, self.h, self.program = chain, state, h, program
        n = chain.mass.size
        self.lam = np.zeros(3 * n)
        self.columns, self.rows = np.ones(15 * n), np.ones(15 * n)
        if program.scaled:
            self.columns, self.rows = scales(chain, h)
        self.evaluations = 0

    def start(self) -> Start:
        s = self.state
        R0 = np.stack([matrix(p) for p in s.p])
        return Start(self.chain, R0, s.p, s.x, s.v, s.w, self.h, self.program.total)

    def guess(self) -> np.ndarray:
        """The state goes on with its velocities, the multipliers as they were."""
        s, h = self.state, self.h
        rotation = s.p.copy() if self.program.total else h * s.w
        parts = [np.stack([s.x + h * s.v, rotation, s.v, s.w], axis=1).reshape(-1), self.lam]
        return np.concatenate(parts)

    def step(self) -> tuple[bool, float]:
        """Take one step; whether the solver was content."""
        start, size = self.start(), 15 * self.chain.mass.size
        F = np.empty(size)

        def fun(z: np.ndarray) -> np.ndarray:
            residual(start, z * self.columns, F)
            self.evaluations += 1
            return F * self.rows

        def jac(z: np.ndarray) -> np.ndarray:
            return np.ascontiguousarray(
                (jacobian(start, z * self.columns) * self.columns) * np.reshape(self.rows, (-1, 1))
            )

        guess, xtol = self.guess() / self.columns, self.program.tolerance
        if self.program.differences:
            most = 200 * (size + 1)
            z, _, info = _minpack._hybrd(
                fun, guess, (), 1, xtol, most, size - 1, size - 1, 0.0, 100.0, None
            )
        else:
            z, _, info = _minpack._hybrj(fun, jac, guess, (), 1, 0, xtol, 100 * size, 100.0, None)
        error = float(np.abs(fun(z) / self.rows).max())
        self.accept(z * self.columns)
        absolute = self.program.absolute
        content = info == 1 if absolute is None else error <= absolute
        return bool(content and np.isfinite(error)), error

    def accept(self, z: np.ndarray) -> None:
        n = self.chain.mass.size
        x, rotation, v, w = np.moveaxis(z[: 12 * n].reshape(n, 4, 3), 1, 0)
        if self.program.total:
            p = rotation.copy()
        else:
            p = np.array(
                [compose(tuple(a), tuple(c)) for a, c in zip(self.state.p, rotation, strict=True)]
            )
        self.state = State(x.copy(), p, v.copy(), w.copy())
        self.lam = z[12 * n :].copy()

    def energy(self) -> float:
        s, c = self.state, self.chain
        kinetic = 0.5 * (c.mass @ (s.v**2).sum(axis=1))
        kinetic += 0.5 * np.einsum("bi,bij,bj->", s.w, c.inertia, s.w)
        return float(kinetic - c.mass @ (s.x @ c.gravity))


def reach(deck: str, h: float, t_final: float, program: Program) -> tuple[float, str, float, float]:
    """Time reached [s], why it ended, the energy error over the weight's work down an arm, and the
    largest row [SI] that the last step left."""
    chain, state = read_chain(deck, program.as_given)
    stepper = Stepper(chain, state, h, program)
    first, error = stepper.energy(), 0.0
    weight = float(chain.mass.sum() * np.linalg.norm(chain.gravity) * np.abs(chain.up).max())
    steps = round(t_final / h)
    for k in range(steps):
        content, residual = stepper.step()
        if not content:
            return k * h, "the solver gave up", error, residual
        error = max(error, abs(stepper.energy() - first) / weight)
        if not error < 0.1:
            return (k + 1) * h, "energy lost", error, residual
    return t_final, "", error, residual


def condition(deck: str, h: float, scaled: bool) -> float:
    """Condition number of the Jacobian at the first step."""
    chain, state = read_chain(deck)
    stepper = Stepper(chain, state, h, Program("", scaled=scaled))
    J = jacobian(stepper.start(), stepper.guess())
    return float(np.linalg.cond(J * stepper.columns * np.reshape(stepper.rows, (-1, 1))))

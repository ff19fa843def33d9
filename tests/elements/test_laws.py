"""Laws that every element keeps, in random states of random models.

A new element needs one entry in the tables of ``elements``; a kind without one fails here.
"""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.deck import read
from msahl.elements.constraints import coincide
from msahl.formulations.absolute import rigid_body
from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.compiled import compiled
from msahl.joints.registry import KINDS
from msahl.laws.registry import POINT_LAWS
from msahl.linalg import dense, sparse_lu
from msahl.model.couplings import COORDINATES
from msahl.model.scheme import EXPONENTIAL, ORDER_TWO
from msahl.ports import concentrated, forces
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common.workspace import new_workspace
from msahl.schemes.midpoint import equations, free_equations, newton
from msahl.system import evaluate
from msahl.system.arrays import new_system_workspace, node_count
from msahl.system.build import build_system
from msahl.system.names import joint_columns
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose
from tests.support.element_samples import (
    CONTACTS,
    COUPLINGS,
    ELEMENTS,
    JOINTS,
    LOADS,
    MOTIONS,
    POINTS,
    everything,
)
from tests.support.models import (
    chain,
    jointed,
    ladder,
    loaded,
    moved,
    path,
    random_vector,
    ring,
    simulate,
    star,
)

SEEDS = range(3)
H = 0.1

ABSOLUTE = ("actuator, markers", "concentrated, expression")
"""Elements whose laws contain places or directions in inertial axes."""
RELATIVE = {name: make for name, make in ELEMENTS.items() if name not in ABSOLUTE}

every_element = pytest.mark.parametrize("make", ELEMENTS.values(), ids=ELEMENTS)
every_relative_element = pytest.mark.parametrize("make", RELATIVE.values(), ids=RELATIVE)
every_point = pytest.mark.parametrize(
    "make", [*POINTS.values(), loaded], ids=[*POINTS, "concentrated"]
)
every_seed = pytest.mark.parametrize("seed", SEEDS)
SCHEMES = (*ORDER_TWO, EXPONENTIAL)
DECAYING = "decaying"
every_scheme = pytest.mark.parametrize("scheme", SCHEMES)


def with_scheme(model, scheme):
    how = {"rotation_update": EXPONENTIAL} if scheme == EXPONENTIAL else {"scheme": scheme}
    return replace(model, simulation=replace(model.simulation, **how))


class Step:
    """The step's equations of a model in plain Python."""

    def __init__(self, model, h=H, reaction=None):
        self.h = h
        self.system = build_system(model)
        self.dt2 = evaluate.dt2(self.system, h)
        self.state = build_state(model, self.system)
        if reaction is not None:
            self.state.reaction[:] = reaction(self.state.reaction.shape)
        self.start = new_system_workspace(self.system, self.state)
        evaluate.prepare(self.system, self.state, self.start)
        self.unknowns = choose(self.system, all_unknowns(self.system))
        self.shape = (node_count(self.system), 3)
        equations.set_loads(self.system, self.state, self.start, h)

    def random(self, rng):
        """Unknowns of a step of large rotations; those that are not free stay where they are."""
        Z = np.zeros(self.shape)
        Z.reshape(-1)[self.unknowns.free] = 0.5 * rng.normal(size=self.unknowns.free.size)
        return Z

    def by_laws(self, Z):
        """The unknowns with those loads of springs in the compliance form that their laws give."""
        springs = self.system.forces.compliance
        if springs is not None:
            at = (first_multiplier(self.system.frames) + springs.place[:, 0], springs.place[:, 1])
            F = self.residual(Z)[at]
            Z[at] += 1.0
            # Each equation is linear in its own load.
            Z[at] -= 1.0 + F / (self.residual(Z)[at] - F)
        return Z

    def residual(self, Z):
        F = np.zeros(self.shape, dtype=Z.dtype)
        equations.residual(self.system, self.state, self.start, self.h, Z, F)
        return F

    def jacobian(self, Z):
        """Dense, in all the unknowns."""
        size = self.unknowns.free.size
        A, values = np.zeros(size * size), np.zeros_like(self.system.constant)
        self.residual(Z)
        equations.jacobian(self.system, self.start, self.h, Z, values)
        dense.scatter_matrix(self.unknowns.dense_to, self.unknowns.dense_from, values, A)
        return A.reshape(size, size)

    def free(self, F):
        return F.reshape(-1)[self.unknowns.free]

    def rotated(self, F, A):
        """Rows or unknowns of the model rotated by ``A``: numbers of joints' rows stay."""
        first = first_multiplier(self.system.frames) + self.system.coincide.a.size
        return np.concatenate([F[:first] @ A.T, F[first:]])

    def pushes(self, residual, step, *group):
        """Forces and moments (n, 3) that one kind of element puts on the bodies; ``step`` is the
        number that its residual takes.
        """
        F = np.zeros(self.shape)
        residual(*group, self.system.frames, step, self.Z, F)
        return self.as_pushes(F)

    def all_pushes(self):
        """Forces and moments (n, 3) of all elements."""
        inertia = np.zeros(self.shape)
        system, start = self.system, self.start
        given = (system.bodies, system.frames, start.bodies, start.frames, self.h, self.dt2)
        rigid_body.residual(*given, self.Z, inertia)
        return self.as_pushes(self.residual(self.Z) - inertia)

    def as_pushes(self, F):
        frames = self.system.frames
        c = self.dt2 * frames.inverse_mass[:-1, None]
        force, moment = F[frames.displacement[:-1]], F[frames.rotation[:-1]]
        return -force / c, -moment * frames.length[:-1, None] / c

    def work(self, force, moment):
        """Work of forces at the mass centres and of moments over the step."""
        frames = self.system.frames
        rotations = self.Z[frames.rotation[:-1]] / frames.length[:-1, None]
        return np.sum(force * self.Z[frames.displacement[:-1]]) + np.sum(moment * rotations)

    def elastic(self):
        """Energy of all springs in the prepared state [J]."""
        if self.system.scalar is None:
            return 0.0
        violation = np.zeros_like(self.state.violation)
        evaluate.observe(self.system, self.state, self.start, violation, violation.copy())
        return float(self.start.forces.elastic.sum())

    def multipliers(self):
        """(k, 3) [N or N m], and what their rows opened by over the step [m or rad]."""
        nodes = self.system.multipliers.node
        scale = np.ones((nodes.size, 3))
        if self.system.scalar:
            rows = self.system.scalar.equations
            scale[rows.place[:, 0], rows.place[:, 1]] = rows.scale
        lam = self.Z[nodes] * self.system.unit / self.dt2
        return lam, self.residual(self.Z)[nodes] / scale


def test_every_element_of_the_deck_is_here():
    """And nothing else: the part of a name before a comma is the element's."""
    resultants = {"bodyForce", "distributed"}  # read as concentrated loads
    assert {*JOINTS} == {*KINDS}
    assert _elements(COUPLINGS) == {*COORDINATES}
    assert _elements(MOTIONS) == {*read.MOTIONS}
    assert _elements(CONTACTS) == {*read.CONTACTS}
    assert _elements(LOADS) == {*read.LOADS} - resultants


def _elements(table):
    return {name.split(",")[0] for name in table}


@every_element
@pytest.mark.parametrize(("seed", "scheme"), [*zip(SEEDS, SCHEMES, strict=True)])
def test_the_jacobian_is_the_derivative_of_the_residual(make, seed, scheme):
    rng = np.random.default_rng(seed)
    step = Step(with_scheme(make(rng), scheme), reaction=lambda shape: rng.normal(size=shape))
    Z = step.random(rng)
    A = step.jacobian(Z)
    e = 1e-5  # best for a central difference: its error e^2 and round-off eps/e balance near it
    columns = []
    for unknown in step.unknowns.free:
        ends = []
        for sign in (1.0, -1.0):
            there = Z.copy()
            there.reshape(-1)[unknown] += sign * e
            ends.append(step.free(step.residual(there)))
        columns.append((ends[0] - ends[1]) / (2 * e))
    assert np.abs(np.stack(columns, axis=1) - A).max() <= 1e-7 * np.abs(A).max()


@every_point
@every_seed
def test_a_complex_step_gives_the_jacobian_to_round_off(make, seed):
    """Where points coincide; what is measured along quantities is kept in real numbers."""
    rng = np.random.default_rng(seed)
    step = Step(make(rng))
    Z = step.random(rng)
    A = step.jacobian(Z)
    columns = []
    for unknown in step.unknowns.free:
        there = Z.astype(complex)
        there.reshape(-1)[unknown] += 1e-30j
        columns.append(step.free(step.residual(there)).imag / 1e-30)
    # Some dozens of roundings an entry.
    assert np.abs(np.stack(columns, axis=1) - A).max() <= 1e-13 * np.abs(A).max()


@every_relative_element
@every_seed
def test_the_residual_rotates_with_the_model(make, seed):
    rng = np.random.default_rng(seed)
    model, rotation = make(rng), from_axis_angle(random_vector(rng), rng.uniform(-3, 3))
    here, there = Step(model), Step(moved(model, rotation, random_vector(rng, 3.0)))
    A = np.array(matrix(rotation))
    Z = here.random(rng)
    F = here.rotated(here.residual(Z), A)
    # Joint violations of the random state differ by what the violation was at the start: zero in
    # both. What is measured between places some metres out carries their round-off.
    assert np.abs(there.residual(here.rotated(Z, A)) - F).max() <= 2e-13 * np.abs(F).max()


@every_relative_element
def test_a_rigid_motion_of_the_model_moves_the_answer(make):
    rng = np.random.default_rng(5)
    model, rotation = make(rng), from_axis_angle(random_vector(rng), 2.5)
    shift = random_vector(rng, 3.0)
    here = simulate(model, dt=0.01, t_final=0.5)
    there = simulate(moved(model, rotation, shift), dt=0.01, t_final=0.5)
    assert here.report.status == there.report.status == "completed"
    A = np.array(matrix(rotation))
    # Half a second of steps solved to 1e-14, positions of some metres, forces of some 100 N.
    for b in range(len(model.bodies)):
        assert there.of("position", b) == pytest.approx(
            here.of("position", b) @ A.T + shift, abs=1e-10
        )
        assert there.matrices(b) == pytest.approx(A @ here.matrices(b), abs=1e-10)
        for what in ("velocity", "spin"):
            assert there.of(what, b) == pytest.approx(here.of(what, b), abs=1e-9)
    largest = np.abs(here.reactions[:, 1:]).max(initial=1.0)
    for k, joint in enumerate(model.joints):
        for letter in sorted({column[0] for column in joint_columns(joint)}):
            known = here.reaction(k, letter) @ A.T
            assert there.reaction(k, letter) == pytest.approx(known, abs=1e-9 * largest)
    for extra in (*model.couplings, *model.motions):
        name = f"{extra.name}.load"
        assert there.column(name) == pytest.approx(here.column(name), abs=1e-9 * largest)
    assert there.work == pytest.approx(here.work, abs=1e-9)


def _is_inner(make):
    """Whether nothing of a model acts from outside: no ground, no load on one body alone."""
    model = make(np.random.default_rng(0))
    elements = (*model.joints, *model.loads)
    ends = {getattr(e, side, None) for e in elements for side in ("parent", "child")}
    alone = any(hasattr(load, "body") for load in (*model.loads, *model.motions))
    return not alone and not ends.intersection(ground.name for ground in model.grounds)


INNER = {name: make for name, make in ELEMENTS.items() if _is_inner(make)}


def test_forces_from_outside_are_few():
    assert {*ELEMENTS} - {*INNER} == {
        *("ground", "knifeEdge", "rollingDisk", "pointMotion", *POINT_LAWS),
        *("concentrated", "concentrated, law", "concentrated, expression"),
    }


@pytest.mark.parametrize("make", INNER.values(), ids=INNER)
@every_seed
def test_action_is_reaction(make, seed):
    rng = np.random.default_rng(seed)
    step = Step(make(rng), reaction=lambda shape: rng.normal(size=shape))
    step.Z = step.random(rng)
    force, moment = step.all_pushes()
    size = np.abs(force).max(initial=np.abs(moment).max())
    assert np.abs(force.sum(axis=0)).max() <= 1e-13 * size
    # About the origin, at the bodies' mean places, forces in pairs leave their mean distance x
    # force: nothing, were the points closed at both ends.
    n = len(force)
    places = step.state.x[:n] + 0.5 * step.Z[0 : 2 * n : 2]
    about = moment.sum(axis=0) + np.cross(places, force).sum(axis=0)
    lam, opened = step.multipliers()
    k = step.system.coincide.a.size
    left = np.cross(0.5 * opened[:k], lam[:k]).sum(axis=0)
    assert about == pytest.approx(left, abs=1e-12 * size)


@pytest.mark.parametrize(
    "make",
    [ELEMENTS[name] for name in (*POINTS, *JOINTS, *COUPLINGS)],
    ids=[*POINTS, *JOINTS, *COUPLINGS],
)
@every_seed
def test_ideal_reactions_work_on_what_opens_alone(make, seed):
    """Exactly, in any step, however large: so nothing in a closed joint."""
    rng = np.random.default_rng(seed)
    step = Step(make(rng))
    step.Z = step.random(rng)
    lam, opened = step.multipliers()
    work = step.work(*step.all_pushes())
    assert work == pytest.approx(np.sum(lam * opened), abs=1e-13 * np.abs(lam).sum())


@every_element
@every_seed
def test_published_work_and_elastic_energy_are_what_the_elements_do(make, seed):
    rng = np.random.default_rng(seed)
    step = Step(make(rng), reaction=lambda shape: rng.normal(size=shape))
    step.Z = step.by_laws(step.random(rng))
    lam, opened = step.multipliers()
    work = step.work(*step.all_pushes())
    before = step.elastic()
    F = step.residual(step.Z)
    equations.accept(step.system, step.state, step.start, step.h, step.Z, F)
    evaluate.prepare(step.system, step.state, step.start)
    known = np.sum(lam * opened) + step.state.work.sum() - (step.elastic() - before)
    size = np.abs(lam).sum() + np.abs(step.state.work).sum() + abs(before) + abs(step.elastic())
    assert work == pytest.approx(known, abs=2e-13 * size)


@every_seed
@pytest.mark.parametrize("grounded", [True, False])
def test_joint_forces_work_on_the_violation_alone(seed, grounded):
    rng = np.random.default_rng(seed)
    step = Step(jointed(rng, 5, grounded=grounded))
    step.Z = step.random(rng)
    group, start = step.system.coincide, step.start.coincide
    work = step.work(*step.pushes(coincide.residual, step.dt2, group, start))
    F = np.zeros(step.shape)
    coincide.residual(group, start, step.system.frames, step.dt2, step.Z, F)
    lam = group.mass[:, None] * step.Z[group.row] / step.dt2
    sharp = np.sum(lam * F[group.row])
    # Some hundred terms of this size; exact in any step, however large.
    assert work == pytest.approx(sharp, abs=1e-13 * np.abs(lam).sum())


@every_seed
def test_the_published_work_of_loads_is_what_they_do(seed):
    rng = np.random.default_rng(seed)
    step = Step(loaded(rng))
    step.Z = step.random(rng)
    group, start = step.system.forces.concentrated, step.start.forces.concentrated
    force, moment = step.pushes(concentrated.mean_residual, -step.dt2, group, start)
    total = np.zeros(group.frame.size)
    concentrated.mean_work(group, start, step.system.frames, step.Z, total)
    assert total.sum() == pytest.approx(step.work(force, moment), abs=1e-12 * np.abs(total).sum())


@every_seed
def test_joints_do_no_work_over_a_run(seed):
    run = simulate(jointed(np.random.default_rng(seed), 4), dt=0.02, t_final=1.0)
    violations = []
    for joint in run.model.joints:
        points = []
        for name, s in ((joint.parent, joint.parent_point), (joint.child, joint.child_point)):
            at = [b.name for b in run.model.bodies].index(name) if name != "Earth" else None
            fixed = np.broadcast_to(s, run.of("position").shape)
            points.append(fixed if at is None else run.of("position", at) + run.matrices(at) @ s)
        violations.append(points[1] - points[0])
    force = run.reactions[1:, 1:].reshape(-1, len(violations), 3)
    work = np.sum(force * np.diff(np.stack(violations, axis=1), axis=0), axis=2)
    # The force times the round-off of places some metres out.
    assert np.abs(work).max() <= 2e-14 * np.abs(force).max()


@every_seed
def test_momentum_is_kept_where_nothing_outside_acts(seed):
    model = jointed(np.random.default_rng(seed), 5, gravity=False, grounded=False)
    run = simulate(model, dt=0.02, t_final=4.0)
    linear, angular = 0.0, 0.0
    for b, body in enumerate(model.bodies):
        R, w = run.matrices(b), run.of("spin", b)
        x = run.of("position", b) + R @ np.array(body.r_BG)
        v = np.einsum("tij,tj->ti", R, run.of("velocity", b) + np.cross(w, body.r_BG))
        p = body.mass * v
        linear += p
        angular += np.cross(x, p) + np.einsum("tij,jk,tk->ti", R, np.array(body.inertia), w)
    # 200 steps, each solved to 1e-14 of its motion.
    for momentum in (linear, angular):
        assert np.abs(momentum - momentum[0]).max() <= 1e-11 * np.abs(momentum).max()


@pytest.mark.slow
@pytest.mark.parametrize("h", [0.01, pytest.param(0.0025, marks=pytest.mark.slow)])
@every_scheme
def test_a_model_of_all_elements_keeps_its_balance(h, scheme):
    """Energy changes by the work of loads, motions and scheme, to the solver's tolerance."""
    model = with_scheme(everything(np.random.default_rng(4)), scheme)
    run = simulate(model, dt=h, t_final=1.0, solver="newton")
    report, extremes = run.report, run.report.extremes
    assert (report.status, report.subsystems) == ("completed", 1)
    assert extremes["energyErrorMaxRelative"] < 1e-11
    assert extremes["constraintViolationMax"] < 1e-11
    # Loads and motions do matter.
    assert np.abs(run.work[-1, 1:]).sum() > 0.05 * extremes["largestKineticEnergy"]


@pytest.mark.sampled
@every_element
@every_scheme
def test_every_element_is_approached_with_order_two(make, scheme):
    model = with_scheme(make(np.random.default_rng(8)), scheme)
    ends = []
    for h in (0.004, 0.002, 0.001, 0.0005):
        run = simulate(model, dt=h, t_final=0.2, every=1000, solver="newton")
        assert run.report.status == "completed"
        ends.append([run.of("position", b)[-1] for b in range(len(model.bodies))])
    errors = np.linalg.norm(np.diff(ends, axis=0), axis=(1, 2))
    # Where nothing but gravity acts on mass centres, they are exact.
    if errors.max() > 1e-12:
        assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize(
    ("make", "scheme"),
    [*((make, DECAYING) for make in ELEMENTS.values()), *((loaded, scheme) for scheme in SCHEMES)],
    ids=[*ELEMENTS, *SCHEMES],
)
def test_the_compiled_loop_is_its_plain_self(make, scheme):
    """The same marked functions run as Python are the oracle of the complete compiled loop.

    Every element by the decaying scheme, whose terms contain those of the preserving one; how a
    body rotates in a step does not depend on elements.
    """
    model = with_scheme(make(np.random.default_rng(11)), scheme)
    steps = 5
    plain, fast = (SubsystemIntegrator(model, "newton", True, steps).workspace for _ in range(2))
    plan = np.arange(steps)
    assert newton.take_steps(plain, H / 10, 0, steps, plan) == steps
    assert compiled(newton.take_steps)(fast, H / 10, 0, steps, plan) == steps
    for field in ("state", "start", "tables", "monitor"):
        for a, b in zip(_arrays(getattr(plain, field)), _arrays(getattr(fast, field)), strict=True):
            # Trends are differences of accelerations, which divide round-off by h^2 = 1e-4.
            assert a == pytest.approx(b, rel=1e-10, abs=1e-9)
    assert plain.counts.tolist() == fast.counts.tolist()


@every_element
def test_the_compiled_equations_are_their_plain_selves(make):
    from msahl.schemes.midpoint import scipy_root  # scipy.optimize, slow to import

    rng = np.random.default_rng(12)
    step = Step(make(rng))
    z = step.free(step.random(rng))
    size = z.size
    plain, fast = (new_workspace(step.system, step.unknowns, step.state, 1) for _ in range(2))
    for workspace in (plain, fast):
        evaluate.prepare(step.system, step.state, workspace.start)
        equations.set_loads(step.system, step.state, workspace.start, H)
    f, g = np.zeros(size), np.zeros(size)
    judged = free_equations.residual(plain, H, z, f)
    assert scipy_root._residual(fast, H, z, g) == pytest.approx(judged, rel=1e-13)
    for a, b in ((f, g), (plain.Z, fast.Z), (plain.F, fast.F)):
        assert a == pytest.approx(b, rel=1e-13, abs=1e-13 * np.abs(a).max())
    A, B = np.zeros(size * size), np.zeros(size * size)
    free_equations.jacobian(plain, H, z, A)
    scipy_root._jacobian(fast, H, z, B)
    assert pytest.approx(B, rel=1e-13, abs=1e-13 * np.abs(A).max()) == A


def _arrays(group):
    for field in group:
        if field is not None:
            yield from _arrays(field) if isinstance(field, tuple) else [field]


FRAMES = {
    "chain": chain(12),
    "chain hung by its middle": chain(12, hung_by=6),
    "chain hung by its end": chain(12, hung_by=11),
    "chain hung twice": path([(k, 0.3 * k * k % 1.0, 0.5 * k) for k in range(9)], (0, 7)),
    "star": star(5, 2),
    "ring": ring(7, (0,)),
    "ring held twice": ring(9, (0, 4)),
    "free ring": ring(6),
    "ladder": ladder(5),
}


@pytest.mark.parametrize("model", FRAMES.values(), ids=FRAMES)
def test_the_sparse_solution_solves_the_dense_system(model):
    rng = np.random.default_rng(1)
    step = Step(model)
    Z = 0.02 * step.random(rng)
    A = step.jacobian(Z)
    order, free = step.unknowns.elimination.order, step.unknowns.free
    values = np.zeros_like(step.system.constant)
    step.residual(Z)
    equations.jacobian(step.system, step.start, H, Z, values)
    factor = np.zeros(int(step.unknowns.elimination.base[-1]))
    right = np.zeros(Z.size)
    right[free] = rng.normal(size=free.size)
    y = right[order]
    sparse_lu.factor(step.unknowns.elimination, values, factor)
    sparse_lu.solve(step.unknowns.elimination, factor, y)
    solution = np.zeros(Z.size)
    solution[order] = y
    x, b = solution[free], right[free]
    # Backward error: what Newton needs. The order of the pivots is fixed, so it may exceed eps by
    # a growth of some hundreds.
    assert np.abs(A @ x - b).max() <= 1e-12 * np.abs(A).max() * np.abs(x).max()
    exact = np.linalg.solve(A, b)
    assert np.abs(x - exact).max() <= 1e-13 * np.linalg.cond(A) * np.abs(exact).max()


def operations(model):
    """Multiplications of a factorisation, and numbers in its factors."""
    elimination = Step(model).unknowns.elimination
    return elimination.target.size, int(elimination.base[-1])


def test_a_chain_costs_its_bodies_and_no_more():
    for counts in zip(*(operations(chain(n)) for n in (10, 55, 100)), strict=True):
        # No fill-in: the same number for every link between the ends, wherever it is.
        assert counts[2] - counts[1] == counts[1] - counts[0]
    # A link leaves its neighbour nothing but the 3 numbers of the joint between them, on whichever
    # side of it the ground is: 168 operations. The middle, with three joints, costs 193 more.
    first, middle, last = (operations(chain(100, hung))[0] for hung in (0, 50, 99))
    assert first == last
    assert middle - first == 193


@pytest.mark.parametrize("hung", [0, 6, 11])
@pytest.mark.parametrize("grounded_last", [True, False])
def test_a_chain_is_solved_wherever_it_hangs_and_however_it_is_listed(hung, grounded_last):
    model = chain(12, hung)
    if not grounded_last:
        model = replace(model, joints=(model.joints[-1], *model.joints[:-1]))
    report = simulate(model, dt=0.01, t_final=0.5, solver="newton").report
    assert (report.status, report.subdivisions) == ("completed", 0)
    assert report.factorisations <= 1.1 * report.steps


def test_a_loop_costs_its_bodies():
    for counts in zip(*(operations(ring(n, (0,))) for n in (10, 30, 50)), strict=True):
        # One joint of the loop stays to the end, coupled to the next body in between: the same
        # number for every link, 404 operations.
        assert counts[2] - counts[1] == counts[1] - counts[0] <= 20 * 404


def test_what_a_model_does_not_contain_costs_nothing():
    """Blocks and operations of a tree are the same with loads elsewhere in the program."""
    rng = np.random.default_rng(2)
    model = jointed(rng, 4)
    system = build_system(model)
    assert not forces.acts_at_points(system.forces)
    # One block a body for its rotation and one for its displacement; a joint on the ground adds 3
    # couplings of the body and one block of the unit matrix, a joint of two bodies twice that.
    ends = sum(2 - ("Earth" in (j.parent, j.child)) for j in model.joints)
    assert len(system.blocks) - 1 == 2 * len(model.bodies) + 4 * ends

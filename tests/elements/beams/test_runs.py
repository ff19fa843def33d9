"""Complete runs of models with beams: start, tables, solvers, plain kernels, subsystems, cost."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.linalg.elimination import products
from msahl.model import ConcentratedLoad, Options
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import newton
from msahl.system.build import build_system
from msahl.system.names import describe_row, resultant_columns
from msahl.system.reductions import all_unknowns
from msahl.system.subsystems import split
from msahl.system.unknowns import eliminate
from tests.run.test_resume import same_run
from tests.support.beams import ELASTIC, FLEXIBLE, cantilever
from tests.support.models import GROUND, simulate

DOWN = (0.0, 0.0, -9.81)


def test_a_beam_that_is_let_go_begins_to_fall():
    """At t = 0 an unstressed cantilever falls freely but for what its clamp holds."""
    model = cantilever(2, 3, ELASTIC, gravity=DOWN)
    state = SubsystemIntegrator(model, "newton", False, 2).workspace.state
    # Strains of round-off, 1e-15, times EA over the mass of a node, 1e5 m/s^2.
    assert state.a[1:-1] == pytest.approx(np.tile(DOWN, (6, 1)), abs=1e-9)
    assert np.abs(state.force).max() == pytest.approx(9.81 * model.bodies[0].mass)


def test_rigid_strains_are_constraints_and_elastic_ones_are_not():
    for stiffness, per_point in ((ELASTIC, 0), (FLEXIBLE, 3), ((np.inf,) * 6, 6)):
        integrator = SubsystemIntegrator(cantilever(2, 2, stiffness), "newton", False, 2)
        assert integrator.rank == 6 + 4 * per_point
        assert integrator.redundant == 0


def test_a_static_load_is_carried():
    """With strong damping the tip settles at P L^3/(3 EI) + P L/GA, resultants at P (L - s)."""
    stiffness = (1e4, 4e3, 4e3, 10.0, 12.0, 15.0)
    P, length = 0.01, 1.0
    load = ConcentratedLoad(
        *("P", "Beam.5", (0.0, 0.0, 0.0), (0.0, P, 0.0)),
        *(GROUND.name, (0.0, 0.0, 0.0), GROUND.name),
    )
    model = cantilever(2, 2, stiffness, damping=(0.5,) * 6, loads=[load], dt=0.5, t_final=20.0)
    result = simulate(model, scheme="decaying")
    assert result.of("position")[-1][1] == pytest.approx(P / (3 * 15.0) + P / 4e3, rel=1e-5)
    found = result.others["resultants"][-1, 1:].reshape(-1, 6)
    stations = 0.5 * (1 + np.array([-1, 1]) / np.sqrt(3)) * 0.5
    s = np.concatenate([stations, 0.5 + stations])
    assert found[:, 1] == pytest.approx(P, rel=1e-4)
    assert found[:, 5] == pytest.approx(P * (length - s), rel=1e-3)
    assert resultant_columns(model)[2] == "Beam.1.n2"
    energy = result.column("Beam.energy")[-1]
    assert energy == pytest.approx(0.5 * P * (P / (3 * 15.0) + P / 4e3), rel=1e-3)
    work = [result.column(f"{name}.work")[-1] for name in ("P", "Beam", "scheme")]
    assert sum(work) == pytest.approx(energy, rel=1e-9)  # all motion is gone


@pytest.mark.parametrize("options", [{"solver": "root"}, {"full": True}])
def test_other_solvers_find_the_same_motion(options):
    model = cantilever(2, 1, ELASTIC, gravity=DOWN, dt=0.01, t_final=0.1)
    one, other = simulate(model), simulate(model, **options)
    # Both solve each step to 1e-12 of its length; 10 steps of 1 cm.
    assert other.states == pytest.approx(one.states, abs=1e-9)


def test_plain_and_compiled_kernels_agree():
    """The plain functions take the steps here that the compiled ones take in a run."""
    model = cantilever(2, 1, FLEXIBLE, (0.001,) * 6, gravity=DOWN, dt=0.005, t_final=0.05)
    compiled = simulate(model)
    workspace = SubsystemIntegrator(model, "newton", False, 20).workspace
    for _ in range(10):
        newton.take_step(workspace, 0.005, 1.0)
    assert workspace.state.x[-2] == pytest.approx(compiled.of("position")[-1], abs=1e-12)


def test_the_work_of_a_factorisation_is_linear_in_the_elements():
    work = []
    for elements in (8, 16, 32):
        for stiffness in (ELASTIC, FLEXIBLE):
            system = build_system(cantilever(3, elements, stiffness))
            work.append(products(eliminate(system, all_unknowns(system))))
    first, second, third = np.array(work).reshape(3, 2)
    assert third - second == pytest.approx(2 * (second - first), rel=0.01)


def test_two_beams_are_two_subsystems():
    first, second = cantilever(1, 1, ELASTIC), cantilever(1, 2, ELASTIC)
    beam = replace(second.beams[0], name="Other", nodes=("Other.1", "Other.2", "Other.3"))
    bodies = [replace(b, name=n) for b, n in zip(second.bodies, beam.nodes, strict=True)]
    both = replace(first, bodies=(*first.bodies, *bodies), beams=(*first.beams, beam))
    assert [len(part.beams[0].lengths) for part in split(both)] == [1, 2]


def test_rows_of_beams_have_names():
    model = cantilever(1, 2, ELASTIC)
    system = build_system(model)
    last = 3 * (2 * system.frames.length.size + system.multipliers.node.size) - 1
    assert describe_row(model, system, last) == "beam 'Beam', bending about d3 in element 2"


@pytest.mark.parametrize("word", ["gauss", "radau"])
def test_a_run_goes_on_bit_for_bit(monkeypatch, word):
    model = cantilever(2, 2, FLEXIBLE, (0.001,) * 6, gravity=DOWN, dt=0.005, t_final=0.25)
    simulation = replace(model.simulation, scheme=word, degree=2)
    same_run(monkeypatch, replace(model, simulation=simulation), Options(every=3), 20)


def test_redundant_joints_at_a_beam_are_found_and_carried():
    """Two joints hold the same node: the motion is that with one of them."""
    one = cantilever(2, 1, FLEXIBLE, gravity=DOWN, dt=0.005, t_final=0.05)
    both = replace(one, joints=(*one.joints, replace(one.joints[0], name="Other")))
    first, second = simulate(one), simulate(both)
    assert len(second.report.non_unique_reactions) == 2
    # The relaxation of redundant equations leaves 1e-12 of the motion.
    assert second.states == pytest.approx(first.states, abs=1e-10)


def test_positions_are_projected_onto_rigid_strains():
    """A node moved by 1 mm along an inextensible beam is moved back, and the joints stay closed."""
    model = cantilever(2, 1, FLEXIBLE)
    node = model.bodies[1]
    moved = replace(node, position=(node.position[0] + 1e-3, 0.0, 0.0))
    bodies = (model.bodies[0], moved, model.bodies[2])
    integrator = SubsystemIntegrator(
        replace(model, bodies=bodies, position="project"), "newton", False, 2
    )
    state = integrator.workspace.state
    assert np.abs(state.strain[:, :3]).max() < 1e-12
    assert state.x[0] == pytest.approx(0.0, abs=1e-13)


def test_growing_shear_stiffness_leads_to_euler_and_bernoulli_at_the_same_cost():
    def run(stiffness):
        given = (1e4, stiffness, stiffness, 10.0, 12.0, 15.0)
        model = cantilever(3, 2, given, gravity=DOWN, dt=0.01, t_final=0.3)
        result = simulate(model, scheme="decaying", solver="newton")
        return result.of("position")[-1], result.report.iterations

    limit, iterations = run(np.inf)
    near, nearer, nearest = (run(stiffness) for stiffness in (1e6, 1e9, 1e15))
    error = np.abs(near[0] - limit).max()
    assert 1e-7 < error < 1e-4
    assert np.abs(nearer[0] - limit).max() == pytest.approx(1e-3 * error, rel=0.1)
    assert np.abs(nearest[0] - limit).max() < 1e-13
    assert nearest[1] <= 1.1 * iterations

"""Beams that stay in a plane: as those in space to round-off, with half of the unknowns."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import compose, matrix
from msahl.algebra.vector import ZERO
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.load_path import grown
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.stability import stability
from msahl.analysis.equilibria.static_equations import Statics
from msahl.elements.beams.build import build_beam
from msahl.linalg.elimination import products
from msahl.model import ConcentratedLoad, Joint, SpringDamper
from msahl.run.explain import explain
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import equations
from msahl.system.reductions import plane_normal
from tests.support.beams import arc, cantilever, section
from tests.support.evaluation import dense_matrix
from tests.support.models import GROUND, build_model, deck, simulate

ELASTIC = (1e3, 4e2, 3e2, 10.0, 12.0, 15.0)
BENDING = (np.inf, np.inf, np.inf, 10.0, 12.0, 15.0)
DAMPED = (0.01, 0.02, 0.03, 0.01, 0.02, 0.03)
UNDAMPED = (0.0,) * 6
SAME = 1e-10
"""Difference of both forms [m]: each step is solved to 1e-14 of its length, and a motion of 1 m in
some ten steps of elastic vibrations multiplies that by less than 1e4."""

UPRIGHT = np.eye(3)
ON_EDGE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
BELOW = np.diag([1.0, -1.0, -1.0])
BELOW_ON_EDGE = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
SIDES = {"d_3": UPRIGHT, "d_2": ON_EDGE, "-d_3": BELOW, "-d_2": BELOW_ON_EDGE}
"""Axes of sections in those of the arc, whose d_3 is the normal of its plane."""
PLANES = {
    "z": np.eye(3),
    "y": np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]),
    "x": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
}
"""Rotations that carry the plane x, y into one across this axis."""


def hung(stiffness=ELASTIC, damping=UNDAMPED, side="d_3", across="z", shift=0.02, **others):
    """An arc in a plane, pinned at one end, loaded at the other and tied to the ground between: the
    load follows the node, the mass centres are beside the line.
    """
    own_axes, plane = SIDES[side], PLANES[across]
    line = arc(2, 3, radius=1.0, angle=1.2)
    line = line._replace(positions=line.positions @ plane.T, axes=plane @ line.axes @ own_axes)
    centre = own_axes.T @ np.array([0.0, shift, 0.0])
    of_section = section(stiffness, center=tuple(centre.tolist()))
    beam, nodes = build_beam("Beam", line, of_section, damping)
    force = tuple((own_axes.T @ np.array([0.5, 1.0, 0.0])).tolist())
    load = ConcentratedLoad("Load", nodes[-1].name, ZERO, force, nodes[-1].name, ZERO, GROUND.name)
    point = tuple((plane @ np.array([0.2, 1.5, 0.0])).tolist())
    tie = SpringDamper("Tie", GROUND.name, nodes[3].name, point, ZERO, 30.0, 0.2, 0.5)
    axes = tuple(tuple(column) for column in plane.T.tolist())
    own = tuple(
        tuple((np.array(matrix(nodes[0].orientation)).T @ column).tolist()) for column in plane.T
    )
    pin = Joint("Pin", "revolute", GROUND.name, nodes[0].name, ZERO, ZERO, axes, own)
    gravity = tuple((plane @ np.array([3.0, -9.0, 0.0])).tolist())
    loads = [load, tie]
    return build_model(nodes, [pin], loads, gravity=gravity, beams=(beam,), dt=0.01, **others)


def apart(one, other):
    """Largest difference of places [m], of axes and of velocities of two runs; parameters of
    rotations by half a revolution are not unique.
    """
    bodies = range(len(one.model.bodies))
    found = [np.abs(one.matrices(b) - other.matrices(b)).max() for b in bodies]
    for name in ("position", "velocity", "spin"):
        found += [np.abs(one.of(name, b) - other.of(name, b)).max() for b in bodies]
    return max(found)


def assert_same(model, scheme, most=SAME, **settings):
    """Both forms have the same tables, and the planar one nothing out of its plane."""
    spatial = simulate(model, scheme=scheme, full=True, **settings)
    planar = simulate(model, scheme=scheme, **settings)
    assert planar.report.status == spatial.report.status == "completed"
    assert (planar.report.planar_subsystems, spatial.report.planar_subsystems) == (1, 0)
    assert abs(planar.report.iterations - spatial.report.iterations) <= 2
    assert apart(planar, spatial) <= most
    # Forces change by the stiffness, 1e3 N over an element of 0.4 m, times differences of places.
    resultants = (run.others["resultants"] for run in (planar, spatial))
    assert np.abs(np.subtract(*resultants)).max() <= 1e4 * most
    assert np.abs(planar.work - spatial.work).max() <= 1e4 * most
    return planar


@pytest.mark.parametrize("scheme", ["preserving", "decaying", "gauss2", "radau2"])
@pytest.mark.parametrize("stiffness", [ELASTIC, BENDING], ids=["elastic", "bending"])
def test_both_forms_move_alike(scheme, stiffness):
    model = hung(stiffness, DAMPED)
    planar = assert_same(model, scheme, t_final=0.2)
    for b in range(len(model.bodies)):
        assert np.abs(planar.of("position", b)[:, 2]).max() == 0.0


@pytest.mark.parametrize("across", PLANES)
@pytest.mark.parametrize("side", SIDES)
def test_any_side_of_the_section_may_face_any_axis(side, across):
    model = hung(side=side, across=across)
    integrator = SubsystemIntegrator(model, "newton", False, 2)
    assert integrator.axis == "xyz".index(across)
    assert_same(model, "preserving", t_final=0.1)


def begun(model, scheme="preserving", full=False):
    """The workspace of a model at t = 0."""
    model = replace(model, simulation=replace(model.simulation, scheme=scheme))
    return SubsystemIntegrator(model, "newton", full, 2).workspace


@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
@pytest.mark.parametrize("damping", [UNDAMPED, DAMPED])
@pytest.mark.parametrize("side", ["d_3", "-d_2"])
def test_the_jacobian_is_the_derivative_of_the_residual(scheme, damping, side):
    rng, h = np.random.default_rng(1), 0.05
    workspace = begun(hung(damping=damping, side=side), scheme)
    system, state, start = workspace.system, workspace.state, workspace.start
    state.strain_rise[:] = 0.01 * rng.normal(size=state.strain_rise.shape)
    equations.predict(system, state, start, h, workspace.Z)
    free, Z = workspace.unknowns.free, workspace.Z
    Z.reshape(-1)[free] += 0.02 * rng.normal(size=free.size)

    def residual(z):
        F, moved = np.zeros_like(Z), Z.copy()
        moved.reshape(-1)[free] = z
        equations.residual(system, state, start, h, moved, F)
        return F.reshape(-1)[free]

    z, step = Z.reshape(-1)[free].copy(), 1e-6
    residual(z)
    equations.jacobian(system, start, h, Z, workspace.values)
    A = dense_matrix(system, workspace.values)[np.ix_(free, free)]
    differences = np.array(
        [(residual(z + d) - residual(z - d)) / (2 * step) for d in step * np.eye(z.size)]
    ).T
    # As in space: second differences of entries of order 1, more by large stresses of damped beams.
    assert np.abs(A - differences).max() < (2e-8 if damping == DAMPED else 1e-9)


def test_half_of_the_unknowns_are_left_and_a_third_of_the_work():
    """The unit of work are multiplications of a factorisation: dense panels of n unknowns an
    element take n^3/3, here of half as many. The beam in a plane omits zeros in them besides.
    """
    model = hung()
    planar, spatial = begun(model), begun(model, full=True)
    nodes, points, pin = len(model.bodies), 6, 5
    assert spatial.unknowns.free.size == 6 * (nodes + points) + pin
    assert planar.unknowns.free.size == 3 * (nodes + points) + 2
    few, many = (products(each.unknowns.elimination) for each in (planar, spatial))
    assert few < many / 3


def changed_node(model, **changes):
    """The model with changes of its last node."""
    return replace(model, bodies=(*model.bodies[:-1], replace(model.bodies[-1], **changes)))


def twisted(model):
    """The model with its nodes rotated about the line by an angle each."""
    bodies = tuple(
        replace(body, orientation=compose(body.orientation, (0.1, 0.0, 0.0)))
        for body in model.bodies
    )
    return replace(model, bodies=bodies)


def coupled(model):
    """The model with a compliance between bending in the plane and torsion."""
    (beam,) = model.beams
    C = np.array(beam.compliance)
    C[:, 3, 5] = C[:, 5, 3] = 0.01
    rows = tuple(tuple(map(tuple, each)) for each in C.tolist())
    return replace(model, beams=(replace(beam, compliance=rows),))


def pushed(model):
    """The model with a force across its plane."""
    load, tie = model.loads
    return replace(model, loads=(replace(load, force=(0.0, 0.0, 1e-9)), tie))


SPATIAL = {
    "velocity": lambda model: changed_node(model, velocity=(0.0, 0.0, 1e-9)),
    "spin": lambda model: changed_node(model, angular_velocity=(1e-9, 0.0, 0.0)),
    "place": lambda model: changed_node(model, position=(*model.bodies[-1].position[:2], 1e-9)),
    "twist": twisted,
    "coupling": coupled,
    "force": pushed,
    "gravity": lambda model: replace(model, gravity=(0.0, 0.0, -9.8)),
}


@pytest.mark.parametrize("why", SPATIAL)
def test_what_leaves_the_plane_keeps_the_beam_in_space(why):
    model = SPATIAL[why](hung())
    assert SubsystemIntegrator(hung(), "newton", False, 2).axis == 2
    assert SubsystemIntegrator(model, "newton", False, 2).axis is None


def rest(model, reduced):
    """Newton's equilibrium under growing loads, and the number of its unknowns."""
    point = search_start(model)
    statics = Statics(point.system, point.state, reduced=reduced)
    found = grown(statics, point.state)
    assert found.converged
    return found, statics.layout.pattern.position.size


@pytest.mark.parametrize("stiffness", [ELASTIC, BENDING], ids=["elastic", "bending"])
@pytest.mark.parametrize("side", ["d_3", "d_2"])
def test_both_forms_rest_alike(stiffness, side):
    """The equilibrium is that of the load of 1 N, the tie and gravity, to round-off of forces of
    10 N over a stiffness of 10 N/m.
    """
    model = hung(stiffness, side=side)
    (spatial, all_unknowns), (planar, unknowns) = (rest(model, each) for each in (False, True))
    assert unknowns < 0.52 * all_unknowns
    assert planar.iterations == spatial.iterations
    assert np.abs(planar.state.x - spatial.state.x).max() <= 1e-12
    assert np.array_equal(planar.state.x[:, 2], search_start(model).state.x[:, 2])
    assert np.abs(planar.state.force - spatial.state.force).max() <= 1e-9


@pytest.mark.parametrize(("load", "verdict"), [(0.9, "stable"), (1.1, "unstable")])
def test_an_equilibrium_in_the_plane_may_buckle_out_of_it(load, verdict):
    """A column that is five times as stiff in the plane of its load as across it: at rest it stays
    straight, and the verdict is that of all motions in space. pi^2 EI/(4 L^2) = 2.4674 N.
    """
    stiffness = (np.inf, np.inf, np.inf, 10.0, 5.0, 1.0)
    model = cantilever(4, 2, stiffness, mass=1.0, gravity=ZERO)
    push = ConcentratedLoad(
        *("Push", model.bodies[-1].name, ZERO, (-2.4674 * load, 0.0, 0.0), GROUND.name),
        *(ZERO, GROUND.name),
    )
    side = replace(push, name="Side", force=(0.0, 0.0, 0.01))
    model = replace(model, loads=(push, side))
    point = search_start(model)
    statics = Statics(point.system, point.state, reduced=True)
    assert plane_normal(statics.system, statics._start) == 1
    found = find(point, np.zeros(3))
    assert np.abs(found.place.point.state.x[:, 1]).max() == 0.0
    assert stability(found.place.point).startswith(verdict)


@pytest.mark.parametrize(
    ("name", "scheme", "end"),
    [
        ("flexible_slider_crank", "gauss2", 0.02),
        ("flexible_slider_crank", "preserving", 0.02),
        ("cable", "preserving", 0.5),
    ],
)
def test_decks_of_linkages_and_cables_move_alike(name, scheme, end):
    model = deck(name)
    model = replace(model, simulation=replace(model.simulation, tolerance=None))
    spatial = simulate(model, 1e-3, end, scheme, full=True)
    planar = simulate(model, 1e-3, end, scheme)
    assert planar.report.planar_subsystems == 1
    assert apart(planar, spatial) <= 1e-8


def test_explain_says_what_a_planar_beam_has():
    lines = explain(hung())
    assert any("each point of a beam three strains" in line for line in lines)
    solved = 3 * (len(hung().bodies) + 6) + 2
    assert any(f"{solved} are solved for" in line for line in lines)

"""The reduction of planar systems: what it omits stays omitted, in every element and scheme."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import ZERO, sub, times, transpose
from msahl.model import (
    Bushing,
    ConcentratedLoad,
    Coupling,
    Joint,
    JointMotion,
    JointSpring,
    Law,
    PointMotion,
    SpringDamper,
)
from msahl.model.scheme import EXPLICIT, choices
from msahl.run.subsystem import SubsystemIntegrator
from tests.support.element_samples import (
    CAM,
    JOINTS,
    TABLE,
    Frame,
    joint_between,
    side_by_side,
    vector,
)
from tests.support.models import (
    GROUND,
    body,
    build_model,
    drag,
    friction,
    random_vector,
    simulate,
    tensor,
)

X, Y, Z = np.eye(3)
FRAMES = {
    "axis across": np.column_stack([Z, X, Y]),
    "axis within": np.column_stack([Z, -Y, X]),
    "x across": np.column_stack([Y, Z, X]),
}
"""Frames of joints (columns x, y, z) in the plane y = 0."""
PIN = np.array([1.6, 0.0, 0.1])
PUSH = Law("sine", (1.0, 5.0, 0.3, 0.5))
ROTATION, SLIDE = (Law("sine", (a, 3.0, 0.5 * np.pi, 0.0)) for a in (0.4, 0.2))
STEPS, H = 1000, 0.002
SCHEMES = [word for word in choices() if word not in ("auto", *EXPLICIT)]
"""Those that solve the complete equations, too."""


def links():
    """Two bodies in the plane y = 0, at rest."""
    bodies = []
    for name, x, z in (("A", 1.0, 0.3), ("B", 2.2, -0.4)):
        J = np.array([[0.2, 0.0, 0.05], [0.0, 0.3, 0.0], [0.05, 0.0, 0.15]])
        bodies.append(body(name, 1.5, J, position=(x, 0.0, z)))
    return bodies


def hung(bodies, joints=(), loads=(), **others):
    """The first body on a ball joint, with ``joints`` and ``loads``."""
    first = Joint("Hung", "spherical", GROUND.name, "A", ZERO, sub(ZERO, bodies[0].position))
    return build_model(bodies, [first, *joints], loads, gravity=(3.0, 0.0, -9.0), **others)


def joined(kind, frame, *loads, **others):
    """Two links with a joint of this ``kind`` between them, or the second on the ground."""
    bodies = links()
    parent = GROUND.name if JOINTS[kind].on_ground else "A"
    joint = joint_between(bodies, kind, "J", parent, "B", Frame(PIN, FRAMES[frame]))
    return hung(bodies, [joint], loads, **others)


def branched(first, second, coupling):
    """A body on the first link by each of two joints, which are coupled."""
    bodies = [*links(), replace(links()[1], name="C")]
    frames = {"revolute": "axis across", "prismatic": "axis within"}
    joints = [
        joint_between(bodies, kind, f"J{k}", "A", name, Frame(PIN, FRAMES[frames[kind]]))
        for k, (kind, name) in enumerate(((first, "B"), (second, "C")))
    ]
    return hung(bodies, joints, couplings=(coupling,))


def loaded(*loads):
    """Two links, the second on a spring, with ``loads``."""
    return hung(links(), loads=(SpringDamper("Tie", "A", "B", ZERO, ZERO, 30.0, 0.2), *loads))


AT = (0.3, 0.0, -0.2)
JOINED = [
    ("rigid", "axis across"),
    ("revolute", "axis across"),
    ("prismatic", "axis within"),
    ("cylindrical", "x across"),
    ("spherical", "axis across"),
    ("planar", "axis across"),
    ("parallelCylinders", "axis within"),
    ("edgeSlider", "axis across"),
    ("pointSlider", "axis within"),
    ("sphericalSlider", "axis within"),
    ("universal", "axis across"),
    ("distance", "axis within"),
    ("pointOnLine", "axis within"),
    ("knifeEdge", "axis within"),
]
ELEMENTS = {
    **{kind: joined(kind, frame) for kind, frame in JOINED},
    "gear": branched("revolute", "revolute", Coupling("C", "gear", "J0", "J1", ratio=-0.7)),
    "rack": branched(
        "revolute", "prismatic", Coupling("C", "rackAndPinion", "J0", "J1", ratio=0.4)
    ),
    "cam": branched("revolute", "prismatic", Coupling("C", "camFollower", "J0", "J1", lift=CAM)),
    "jointMotion": joined(
        "revolute", "axis across", motions=(JointMotion("D", "J", "angle", ROTATION),)
    ),
    "jointMotion, slide": joined(
        "prismatic", "axis within", motions=(JointMotion("D", "J", "slide", SLIDE),)
    ),
    "pointMotion": hung(links(), motions=(PointMotion("P", "B", AT, vector(X), SLIDE),)),
    "springDamper": loaded(),
    "springDamper, table": hung(
        links(), loads=(SpringDamper("S", "A", "B", AT, AT, 0.0, 0.1, 1.0, table=TABLE),)
    ),
    "torsionalSpringDamper": joined(
        "revolute", "axis across", JointSpring("S", "J", "angle", 7.0, 0.4, 0.3)
    ),
    "slideSpringDamper": joined(
        "prismatic", "axis within", JointSpring("S", "J", "slide", 7.0, 0.4, 0.3)
    ),
    "bushing": hung(
        links(),
        loads=(
            Bushing(
                *("S", "A", "B", (1.0, 0.0, 0.0), (-0.2, 0.0, 0.7), tensor(np.eye(3))),
                *(
                    tensor(np.eye(3)),
                    (40.0, 0.0, 50.0, 0.0, 6.0, 0.0),
                    (1.0, 0.0, 1.0, 0.0, 0.1, 0.0),
                ),
            ),
        ),
    ),
    "drag": build_model(links()[1:], loads=[drag("D", "B", AT, 0.4)], gravity=(3.0, 0.0, -9.0)),
    "concentrated": loaded(
        ConcentratedLoad("L", "B", AT, (4.0, 0.0, 2.0), "A", vector(2.0 * Y), GROUND.name, PUSH)
    ),
    "friction": joined("revolute", "axis across", friction("F", "J", "angle", 0.3, 0.1, 0.5)),
}


def reframed(model, rng):
    """The same bodies with their own axes rotated anyhow, in which everything fixed in them is."""
    rotations = {
        b.name: from_axis_angle(random_vector(rng), rng.uniform(-3, 3)) for b in model.bodies
    }

    def own(name, a):
        return times(transpose(matrix(rotations[name])), a) if name in rotations else a

    def rotated(b):
        A = np.array(matrix(rotations[b.name]))
        J = tensor(A.T @ np.array(b.inertia) @ A)
        return replace(b, orientation=compose(b.orientation, rotations[b.name]), inertia=J)

    def fixed(element):
        changes = {}
        for side in ("parent", "child"):
            if hasattr(element, f"{side}_point"):
                name = getattr(element, side)
                changes[f"{side}_point"] = own(name, getattr(element, f"{side}_point"))
                if hasattr(element, f"{side}_axes"):
                    axes = getattr(element, f"{side}_axes")
                    changes[f"{side}_axes"] = tuple(own(name, axis) for axis in axes)
        if hasattr(element, "body"):
            changes["point"] = own(element.body, element.point)
        if isinstance(element, ConcentratedLoad):
            changes["force"] = own(element.force_basis, element.force)
            changes["moment"] = own(element.moment_basis, element.moment)
        return replace(element, **changes)

    return replace(
        model,
        bodies=tuple(map(rotated, model.bodies)),
        joints=tuple(map(fixed, model.joints)),
        loads=tuple(map(fixed, model.loads)),
        motions=tuple(map(fixed, model.motions)),
    )


def test_the_elements_lie_in_the_plane():
    """All kinds but those that cannot, so that the law below holds of all."""
    cannot = {"screw", "crossedCylinders", "rollingDisk", "cylindricalSlider"}
    assert {kind for kind, _ in JOINED} == set(JOINTS) - cannot
    for seed, model in enumerate(ELEMENTS.values()):
        part = reframed(model, np.random.default_rng(seed))
        assert SubsystemIntegrator(part, "newton", full=False, chunk=1).axis == 1


def apart(names, scheme):
    """Planar and spatial runs of these elements side by side, the bodies' axes rotated anyhow: how
    far apart bodies are, and what the planar one has out of its plane [m, rad/s]; that in joint
    coordinates, too, which has another truncation error.
    """
    rng = np.random.default_rng(5)
    model, _ = side_by_side([reframed(ELEMENTS[name], rng) for name in names])
    given = (model, H, STEPS * H, scheme)
    spatial, tree = simulate(*given, full=True), simulate(*given)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SubsystemIntegrator, "joint_coordinates", False)
        planar = simulate(*given)
    assert spatial.report.planar_subsystems == 0
    far, off, spin = 0.0, 0.0, 0.0
    for run in (planar, tree):
        assert run.report.status == spatial.report.status == "completed"
        assert run.report.planar_subsystems == run.report.subsystems
        for b in range(len(model.bodies)):
            off = max(off, np.abs(run.of("position", b)[:, 1]).max())
            W = np.einsum("tij,tj->ti", run.matrices(b)[::50], run.of("spin", b)[::50])
            spin = max(spin, np.abs(W[:, ::2]).max())
    for b in range(len(model.bodies)):
        far = max(far, np.abs(planar.of("position", b) - spatial.of("position", b)).max())
    return far, off, spin


FAR, OFF = 1e-10, 1e-13
"""Bounds of the above. In space round-off leaves the plane and may grow (the bushing's by 1e4 in
2 s). In the plane nothing is there to grow: a body's place is a sum of exact zeros, its spin is
rotated into its axes and back with a few machine epsilons of some 10 rad/s."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "scheme", ["preserving", "decaying", pytest.param("gauss1", marks=pytest.mark.slow)]
)
def test_planar_and_spatial_equations_move_all_elements_alike(scheme):
    """Drag by itself: no deck has it beside all others, for which it would be compiled here."""
    for names in (ELEMENTS.keys() - {"drag"}, {"drag"}):
        far, off, spin = apart(sorted(names), scheme)
        assert far <= FAR
        assert off == 0.0
        assert spin <= OFF


@pytest.mark.sampled
@pytest.mark.parametrize("scheme", SCHEMES)
def test_nothing_grows_out_of_the_plane_in_a_thousand_steps(scheme):
    """By every scheme; an extrapolation multiplies what nobody solves for by up to 135 a step."""
    few = ["spherical", "pointSlider", "distance", "pointOnLine", "springDamper", "jointMotion"]
    far, off, spin = apart(few, scheme)
    assert far <= FAR
    assert off == 0.0
    assert spin <= OFF

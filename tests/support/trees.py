"""Open trees of bodies on the ground, and single steps of them in joint coordinates."""

from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import compose, matrix
from msahl.expressions.syntax import parse
from msahl.formulations.tree import recursion
from msahl.jit.lanes import spread, store
from msahl.joints.registry import KINDS
from msahl.laws.registry import JOINT_LAWS
from msahl.model import ConcentratedLoad, JointActuator, JointLoad, JointSpring, Law
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import newton
from msahl.schemes.collocation.tree import loads
from msahl.system import evaluate
from tests.support.element_samples import (
    SPRING,
    bushing,
    joint_between,
    random_frame,
    sample_parameters,
    spring,
)
from tests.support.models import GROUND, build_model, drag, random_body, random_vector

TREE_KINDS = tuple(name for name, kind in KINDS.items() if kind.tree is not None)
"""Kinds of joints with joint coordinates."""


def random_tree(rng, kinds=TREE_KINDS, gravity=True, **others):
    """A body on each kind of joint, which holds it to the ground or to one of those before; every
    second joint is defined from the body to what holds it. A body of the kind ``free`` has none;
    if that is the first one, no joint is on the ground.
    """
    bodies = [random_body(rng, f"B{k}") for k in range(len(kinds))]
    joints = []
    for k, kind in enumerate(kinds):
        if kind == "free":
            continue
        holders = bodies[:k] if kinds[0] == "free" else [GROUND, *bodies[:k]]
        holder = GROUND.name if k == 0 else holders[int(rng.integers(len(holders)))].name
        ends = (holder, f"B{k}") if k % 2 == 0 else (f"B{k}", holder)
        joints.append(joint_between(bodies, kind, f"J{k}", *ends, random_frame(rng)))
    down = random_vector(rng, 5.0) if gravity else (0.0, 0.0, 0.0)
    return build_model(bodies, joints, gravity=down, **others)


def loaded_tree(rng):
    """A random tree of all kinds of joints with loads of many kinds: at points, between bodies, on
    joint coordinates, by laws of time and by an expression.
    """
    model = random_tree(rng)
    revolute, slide = (
        next(joint.name for joint in model.joints if joint.kind == kind)
        for kind in ("revolute", "prismatic")
    )
    loads = (
        spring(rng, model, **SPRING, free_length=0.8, preload=0.5),
        replace(bushing(rng, model), name="Bush"),
        drag("D", "B1", random_vector(rng), 0.2),
        *(
            JointLoad(f"L{law.name}", law.name, revolute, "angle", sample_parameters(law, "angle"))
            for law in JOINT_LAWS.values()
            if law.name != "friction"
        ),
        JointSpring("T", slide, "slide", 40.0, 0.4, 0.3, 0.5),
        JointActuator("A", slide, "slide", parse(f"2*{revolute}.angleRate - sin(3*t)")),
        ConcentratedLoad(
            *("C", "B0", random_vector(rng), random_vector(rng, 4.0), "B1"),
            *(random_vector(rng), "B0", Law("sine", (1.0, 5.0, 0.3, 0.5))),
        ),
    )
    return replace(model, loads=loads)


class TreeSteps:
    """A model by a gauss scheme, for single steps in joint coordinates."""

    def __init__(self, model, degree, full=False):
        simulation = replace(model.simulation, scheme="gauss", degree=degree)
        self.integrator = SubsystemIntegrator(
            replace(model, simulation=simulation), "newton", full, 1
        )
        self.subsystem = self.integrator.stepper.method.subsystem
        self.workspace, self.stages = self.subsystem.workspace, self.subsystem.stages
        self.state, self.tree = self.workspace.state, self.subsystem.tree

    def arguments(self, h):
        """Those of ``tree.step.take_step`` for a step of size ``h``."""
        return self.tree, self.workspace, self.stages, self.subsystem.outcome, h

    def configuration(self):
        """The bodies' x, p, v, w in inertial axes."""
        return tuple(np.array(a) for a in (self.state.x, self.state.p, self.state.v, self.state.w))

    def set_configuration(self, found):
        """Begin from what ``configuration`` returned, without earlier steps."""
        for array, values in zip(
            (self.state.x, self.state.p, self.state.v, self.state.w), found, strict=True
        ):
            array[:] = values
        evaluate.prepare(self.workspace.system, self.state, self.workspace.start)
        newton.reset_prediction(self.subsystem)

    def moved(self, change):
        """The configuration after a ``change`` (2 n,) of coordinates and their rates."""
        tree, motion, state = self.tree.tree, self.tree.motion, self.state
        recursion.begin(tree, motion, state.x, self.workspace.start.frames)
        n = tree.body.size
        for k in range(n):
            store(motion.q, k, spread(change[k]))
            store(motion.u, k, spread(motion.rate[k] + change[n + k]))
        recursion.set_places(tree, motion)
        recursion.set_twists(tree, motion)
        found = self.configuration()
        for b in range(1, tree.frame.size):
            f = tree.frame[b]
            x, c, v, W = loads.body_motion(self.tree, b, 0)
            p = compose(c, tuple(found[1][f]))
            found[0][f], found[1][f], found[2][f] = x, p, v
            found[3][f] = np.array(matrix(p)).T @ np.array(W)
        return found

    def momenta(self, found):
        """(bodies, 3) linear and angular momenta, about the mass centres, inertial axes, and the
        (bodies, 3, 3) rotations of a configuration.
        """
        tree = self.tree.tree
        f = tree.frame[1:]
        R = np.array([matrix(tuple(p)) for p in found[1][f]])
        L = np.einsum("bij,bjk,bk->bi", R, tree.inertia[1:], found[3][f])
        return tree.mass[1:, None] * found[2][f], L, R

    def variations(self, at, size=1e-3):
        """Derivatives of positions, momenta, orientations and angular momenta by the arguments of
        ``at`` (2 n,) -> configuration, in rows, and the angular momenta at zero.

        By differences of order 4, whose error is that of a fifth derivative times ``size``^4 and
        round-off over ``size``: both about 1e-12 here.
        """
        n = 2 * self.tree.tree.body.size
        _, L, R = self.momenta(at(np.zeros(n)))
        rows = []
        for k in range(n):
            one = np.eye(n)[k] * size
            near, far = ([self._numbers(at(c * one), R) for c in (m, -m)] for m in (1, 2))
            rows.append((8 * (near[0] - near[1]) - (far[0] - far[1])) / (12 * size))
        return np.array(rows), L

    def _numbers(self, found, R):
        """(4, bodies, 3) positions, momenta, rotations from ``R`` and angular momenta."""
        P, L, now = self.momenta(found)
        D = np.einsum("bij,bkj->bik", now, R)
        rotation = 0.5 * np.stack(
            [D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1
        )
        return np.array([found[0][self.tree.tree.frame[1:]], P, rotation, L])


def symplectic_form(rows, L):
    """(m, m) canonical form of the bodies on pairs of the variations ``rows`` (m, 4, bodies, 3), in
    inertial axes; ``L`` are their angular momenta.

        dx1 . dP2 - dx2 . dP1 + t1 . dL2 - t2 . dL1 - L . (t1 x t2)
    """
    x, P, t, dL = rows.transpose(1, 0, 2, 3)
    half = np.einsum("ibk,jbk->ij", x, P) + np.einsum("ibk,jbk->ij", t, dL)
    return half - half.T - np.einsum("bk,ijbk->ij", L, np.cross(t[:, None], t[None]))

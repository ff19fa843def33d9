"""Open trees of bodies on the ground, and single steps of them in joint coordinates."""

from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import compose, matrix
from msahl.formulations.tree import recursion
from msahl.jit.lanes import spread, store
from msahl.joints.registry import KINDS
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import tree_step
from msahl.system import evaluate
from tests.support.element_samples import joint_between, random_frame, random_vector
from tests.support.models import GROUND, build_model, random_body

TREE_KINDS = tuple(name for name, kind in KINDS.items() if kind.tree is not None)
"""Kinds of joints with joint coordinates."""


def random_tree(rng, kinds=TREE_KINDS, gravity=True, **others):
    """A body on each kind of joint, which holds it to the ground or to one of those before; every
    second joint is defined from the body to what holds it.
    """
    bodies = [random_body(rng, f"B{k}") for k in range(len(kinds))]
    joints = []
    for k, kind in enumerate(kinds):
        holder = GROUND.name if k == 0 else [GROUND, *bodies][int(rng.integers(k + 1))].name
        ends = (holder, f"B{k}") if k % 2 == 0 else (f"B{k}", holder)
        joints.append(joint_between(bodies, kind, f"J{k}", *ends, random_frame(rng)))
    down = random_vector(rng, 5.0) if gravity else (0.0, 0.0, 0.0)
    return build_model(bodies, joints, gravity=down, **others)


class TreeSteps:
    """A model by a gauss scheme, stepped in joint coordinates as plain Python."""

    def __init__(self, model, degree, full=False):
        simulation = replace(model.simulation, scheme="gauss", degree=degree)
        self.integrator = SubsystemIntegrator(
            replace(model, simulation=simulation), "newton", full, 1
        )
        self.subsystem = self.integrator.stepper.method.subsystem
        self.workspace, self.stages = self.subsystem.workspace, self.subsystem.stages
        self.state, self.tree = self.workspace.state, self.subsystem.tree

    def take(self, h):
        """Take a step of size ``h``; return whether it converged in joint coordinates."""
        given = self.tree, self.workspace, self.stages, self.subsystem.outcome, h
        return tree_step.take_step(*given)

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
        self.tree.figures[:] = tree_step.FRESH

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
            x, c, v, W = tree_step.body_motion(self.tree, b, 0)
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

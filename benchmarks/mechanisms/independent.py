"""Integrate a mechanism without msahl: Drake's equations of its tree, and scipy's DOP853.

The net, for which this takes long, is a chain of its levels instead (``net.swing``).

    M v' + G^T l = f,   G v' = -G' v        for the loops and gears, whose equations are G v = 0

M and f are Drake's, in minimal coordinates of the tree; loops are differentiated twice, so their
violation grows with the rounding errors and the tolerance only, as the start satisfies them. The
least-squares solution l allows for redundant equations.

    python -m benchmarks.mechanisms.independent        # beside the references (minutes)
"""

import argparse
from typing import Any, NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, MultibodyForces
from scipy.integrate import solve_ivp

from benchmarks.mechanisms.drake_models import compile_plant, place
from benchmarks.mechanisms.layout import Layout, layout
from benchmarks.mechanisms.net import swing
from benchmarks.problems import Problem

TOLERANCE = 1e-12


class _Dynamics(NamedTuple):
    plant: MultibodyPlant
    context: Any
    given: Layout

    def rate(self, y: np.ndarray) -> np.ndarray:
        """Rates of the coordinates and of their rates."""
        plant, context = self.plant, self.context
        plant.SetPositionsAndVelocities(context, y)
        M = plant.CalcMassMatrix(context)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        f = -plant.CalcInverseDynamics(context, np.zeros(len(M)), forces) + self._moments(context)
        v_dot = np.linalg.solve(M, f)
        G, bias = self._loops()
        if len(G):
            across = np.linalg.solve(M, G.T)
            v_dot -= across @ np.linalg.lstsq(G @ across, G @ v_dot + bias, rcond=1e-10)[0]
        q_dot = plant.MapVelocityToQDot(context, plant.GetVelocities(context))
        return np.concatenate([q_dot, v_dot])

    def places(self, y: np.ndarray) -> np.ndarray:
        """Mass centres (n, 3)."""
        self.plant.SetPositionsAndVelocities(self.context, y)
        bodies = [self.plant.GetBodyByName(name) for name in self.given.masses]
        poses = [self.plant.EvalBodyPoseInWorld(self.context, body) for body in bodies]
        return np.array([pose.translation() for pose in poses])

    def _moments(self, context: Any) -> np.ndarray:
        total = np.zeros(self.plant.num_velocities())
        world = self.plant.world_frame()
        for name, moment in self.given.moments.items():
            frame = self.plant.GetBodyByName(name).body_frame()
            J = self.plant.CalcJacobianAngularVelocity(
                context, JacobianWrtVariable.kV, frame, world, world
            )
            total += J.T @ moment
        return total

    def _loops(self) -> tuple[np.ndarray, np.ndarray]:
        """G and G' v of all loops and gears."""
        rows, bias = [np.zeros((0, self.plant.num_velocities()))], [np.zeros(0)]
        for hinge in self.given.closing:
            for point in self.given.closing_points(hinge):
                (J, a), (J_outer, a_outer) = (
                    self._point(name, point) for name in (hinge.inner, hinge.outer)
                )
                rows.append(J_outer - J)
                bias.append(a_outer - a)
        for gear in self.given.gears:
            row = np.zeros((1, self.plant.num_velocities()))
            row[0, self.plant.GetJointByName(gear.second).velocity_start()] = 1.0
            row[0, self.plant.GetJointByName(gear.first).velocity_start()] -= gear.ratio
            rows.append(row)
            bias.append(np.zeros(1))
        return np.vstack(rows), np.concatenate(bias)

    def _point(self, name: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Jacobian of the velocity of a body's point, and its acceleration at constant rates."""
        world = self.plant.world_frame()
        if not name:
            return np.zeros((3, self.plant.num_velocities())), np.zeros(3)
        frame, local = self.plant.GetBodyByName(name).body_frame(), self.given.local(name, point)
        kind = JacobianWrtVariable.kV
        J = self.plant.CalcJacobianTranslationalVelocity(
            self.context, kind, frame, local, world, world
        )
        a = self.plant.CalcBiasTranslationalAcceleration(
            self.context, kind, frame, local, world, world
        )
        return J, a.reshape(3)


def independent_motion(problem: Problem, tolerance: float = TOLERANCE) -> np.ndarray:
    """Return the mass centres (rows + 1, n, 3) at the problem's output times."""
    plant = compile_plant(problem.model, 0.0)
    context, given = plant.CreateDefaultContext(), layout(problem.model)
    place(plant, context, given)
    dynamics = _Dynamics(plant, context, given)
    t = problem.grid * np.arange(problem.rows + 1)
    start = plant.GetPositionsAndVelocities(context)
    found = solve_ivp(
        lambda _, y: dynamics.rate(y),
        (0.0, t[-1]),
        start,
        method="DOP853",
        t_eval=t,
        rtol=tolerance,
        atol=tolerance,
    )
    return np.array([dynamics.places(y) for y in found.y.T])


def main() -> None:
    # They need msahl's kernels, which the equations above do not.
    from benchmarks.mechanisms.problems import MODELS, mechanism
    from benchmarks.mechanisms.truth import true_motion

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", default=list(MODELS))
    for name in parser.parse_args().names:
        problem = mechanism(name)
        known = true_motion(problem)
        t = problem.grid * np.arange(problem.rows + 1)
        x = swing(t) if name == "net" else independent_motion(problem)
        apart = np.linalg.norm(known.x - x, axis=-1).max()
        print(f"{name}: {known.words}, {known.apart:.1e} m apart; DOP853 {apart:.1e} m")


if __name__ == "__main__":
    main()

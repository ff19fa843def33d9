"""A double pendulum by Exudyn as a user writes it: 10 s, 1000 steps, all coordinates to a file.

    python benchmarks/exudyn_script.py states.txt

The model of ``decks/thesis/double_pendulum_89.xml``. Exudyn writes the coordinates and velocities
of both bodies, with Euler parameters, at every step.
"""

import math
import sys

import exudyn as exu
import exudyn.utilities as eu
import numpy as np

ANGLE, LENGTH, GRAVITY = math.radians(89.0), 5.0, 9.80665
STEPS, DURATION = 1000, 10.0


def main() -> None:
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    along = [math.sin(ANGLE), 0.0, math.cos(ANGLE)]
    inertia = eu.RigidBodyInertia(mass=2.0, inertiaTensor=0.008 * np.eye(3))
    before = mbs.CreateGround()
    for k in range(2):
        body = mbs.CreateRigidBody(
            inertia=inertia,
            referencePosition=[(k + 1) * LENGTH * x for x in along],
            gravity=[0.0, 0.0, GRAVITY],
        )
        joint = [k * LENGTH * x for x in along]
        mbs.CreateSphericalJoint(itemNumbers=[before, body], position=joint, show=False)
        before = body
    mbs.Assemble()
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = STEPS
    settings.timeIntegration.endTime = DURATION
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = True
    settings.solution.file.writePeriod = DURATION / STEPS
    settings.solution.file.name = sys.argv[1]
    mbs.SolveDynamic(settings)


if __name__ == "__main__":
    main()

"""The table of markers: their motion, and distances and angles between them.

    x = x_B + R s                                       position, and its derivatives v and a
    d = |D|,   d' = D.D'/d                              D from one marker to the other
    angle = atan2(|D x E|, D.E)                         D, E from the vertex to the other markers

Position, velocity and acceleration are relative to the inertial frame, with components in its axes
or in those of the marker's basis. Orientations are Euler parameters, angular velocities are in the
marker's own axes.
"""

import numpy as np

from msahl.algebra.rotation_arrays import cross, dot, euler_parameters, rotated
from msahl.joints.coordinates import Motion, point_motion
from msahl.model import MarkerDistance, Model
from msahl.run.body_rows import GROUND, TablesOfSteppers, of_bodies, read_motions, select
from msahl.system.names import MARKER_COLUMNS, marker_columns


class MarkerTable:
    """Computes ``markers.csv``, one chunk of output times after the other."""

    def __init__(self, model: Model) -> None:
        markers, self.width = model.markers, len(marker_columns(model))
        names = [marker.body for marker in markers] + [marker.basis for marker in markers]
        self.bodies, places = select(model, names)
        self.carrier, self.basis = np.split(places, 2)
        self.s = np.array([marker.point for marker in markers]).reshape(-1, 3)
        self.axes = np.array([marker.axes for marker in markers]).reshape(-1, 3, 3)
        number = {marker.name: i for i, marker in enumerate(markers)}
        self.sensors = [
            (number[sensor.start], number[sensor.end])
            if isinstance(sensor, MarkerDistance)
            else (number[sensor.start], number[sensor.vertex], number[sensor.end])
            for sensor in model.sensors
        ]

    def rows(self, tables: TablesOfSteppers) -> np.ndarray:
        """Return the output times (m, columns) of these tables."""
        bodies = read_motions(tables, self.bodies)
        motion = point_motion(of_bodies(bodies, self.carrier), self.s)
        m = len(motion.x)
        found = [tables["states"][:, :1], self._markers(bodies, motion).reshape(m, -1)]
        found += [_sensor(motion, sensor) for sensor in self.sensors]
        return np.concatenate(found, axis=1)

    def _markers(self, bodies: Motion, motion: Motion) -> np.ndarray:
        """(m, k, columns) the values of all markers."""
        assert motion.a is not None  # a model with markers has accelerations
        moved = [motion.x.copy(), motion.v.copy(), motion.a.copy()]
        given = np.flatnonzero(self.basis != GROUND)
        if given.size:
            R = np.swapaxes(bodies.R[:, self.basis[given]], -1, -2)
            for vectors in moved:
                vectors[:, given] = rotated(R, vectors[:, given])
        to_marker = np.einsum("kij,mklj->mkil", self.axes, motion.R)  # inertial to marker's axes
        q = euler_parameters(np.swapaxes(to_marker, -1, -2))
        found = np.concatenate([*moved, q, rotated(to_marker, motion.w)], axis=-1)
        assert found.shape[-1] == len(MARKER_COLUMNS)
        return found


def _sensor(motion: Motion, markers: tuple[int, ...]) -> np.ndarray:
    """(m, 2) a distance and its rate, or an angle and its rate; rates are 0 where undefined."""
    start, vertex = markers[0], markers[-2]
    if len(markers) == 2:
        D, D_dot = (part[:, markers[1]] - part[:, start] for part in (motion.x, motion.v))
        d = np.sqrt(dot(D, D))
        return np.stack([d, _quotient(dot(D, D_dot), d)], axis=1)
    (D, D_dot), (E, E_dot) = (
        (motion.x[:, other] - motion.x[:, vertex], motion.v[:, other] - motion.v[:, vertex])
        for other in (start, markers[2])
    )
    across, along = cross(D, E), dot(D, E)
    sine = np.sqrt(dot(across, across))
    across_dot, along_dot = cross(D_dot, E) + cross(D, E_dot), dot(D_dot, E) + dot(D, E_dot)
    sine_dot = _quotient(dot(across, across_dot), sine)
    rate = _quotient(along * sine_dot - sine * along_dot, sine * sine + along * along)
    return np.stack([np.arctan2(sine, along), rate], axis=1)


def _quotient(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a/b, and 0 where b is 0."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)

"""A conical pendulum in closed form, written as a run's folder.

The bob circles at the constant speed Omega r, r = L sin(alpha), Omega^2 = g / (L cos(alpha)); its
inertia is the same about every axis, so nothing but the joint's force along the arm is needed. z
points down, as gravity does.
"""

import math

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import times, transpose
from msahl.deck import read_deck
from msahl.results.read import read_run
from msahl.results.write import RunFolder, write_json

MASS, LENGTH, INERTIA, GRAVITY, DT = 2.0, 5.0, 0.008, 9.80665, 0.01
ALPHA = math.radians(30.0)
RADIUS = LENGTH * math.sin(ALPHA)
OMEGA = math.sqrt(GRAVITY / (LENGTH * math.cos(ALPHA)))
FORCE = np.array([-MASS * OMEGA**2 * RADIUS, 0.0, -MASS * GRAVITY])
ROWS = 41

DECK = f"""<?xml version="1.0" encoding="UTF-8"?>
<data>
  <unitSystem>SI</unitSystem>
  <system>
    <gravity><g3>{GRAVITY}</g3></gravity>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Bob</name>
        <mass>{MASS}</mass>
        <moi><Ixx>{INERTIA}</Ixx><Iyy>{INERTIA}</Iyy><Izz>{INERTIA}</Izz></moi>
        <initialConditions>
          <position basis="Bob"><z>{LENGTH}</z></position>
          <orientation>
            <eulerRotation>
              <phi units="rad">{ALPHA}</phi><u1>0</u1><u2>1</u2><u3>0</u3>
            </eulerRotation>
          </orientation>
        </initialConditions>
      </rigidBody>
    </bodies>
    <joints>
      <spherical>
        <name>Pivot</name>
        <parent><name>Base</name></parent>
        <child><name>Bob</name><position basis="Bob"><z>-{LENGTH}</z></position></child>
      </spherical>
    </joints>
  </system>
  <simulation>
    <title>Conical &amp; &lt;calm&gt;</title>
    <deltaT units="sec">{DT}</deltaT>
    <tFinal units="sec">{DT * (ROWS - 1)}</tFinal>
  </simulation>
</data>
"""


def conical_rows(force_at=0.0):
    """Rows of states and reactions; the force is that of the time ``force_at`` after each row."""
    times_ = DT * np.arange(ROWS)
    states = np.array([_state(t) for t in times_])
    return states, np.array([(t, *_rotated(FORCE, t + force_at)) for t in times_])


def _rotated(vector, t):
    """``vector`` after a rotation by Omega t about z."""
    return times(matrix(from_axis_angle((0.0, 0.0, 1.0), OMEGA * t)), tuple(vector))


def _state(t):
    p = compose(
        from_axis_angle((0.0, 0.0, 1.0), OMEGA * t), from_axis_angle((0.0, 1.0, 0.0), ALPHA)
    )
    to_body = transpose(matrix(p))
    x = times(matrix(p), (0.0, 0.0, LENGTH))
    v = (-OMEGA * x[1], OMEGA * x[0], 0.0)
    return (t, *x, *p, *times(to_body, v), *times(to_body, (0.0, 0.0, OMEGA)))


def write(folder, states=None, reactions=None, info=None, complete=True, text=DECK):
    """Write rows (default: the exact ones) as a run's folder; ``text`` is its deck."""
    exact = conical_rows()
    states = exact[0] if states is None else states
    reactions = exact[1] if reactions is None else reactions
    folder.mkdir(parents=True, exist_ok=True)
    deck = folder / "source.xml"
    deck.write_text(text)
    with RunFolder(folder, read_deck(deck), text.encode()) as results:
        if len(states):
            errors = np.empty((0, 3))
            if info and info.get("error"):
                errors = np.column_stack([states[:, 0], np.full((len(states), 2), 1e-9)])
            results.write({"states": states, "reactions": reactions, "error": errors})
        results.complete = complete
    if info is not None:
        write_json(folder / "run.json", info)


def read(folder, states=None, reactions=None, info=None):
    """Write rows as a run's folder and read it back."""
    write(folder, states, reactions, info)
    return read_run(folder)

"""Deck of a chain: bodies like the thesis's pendulum bobs on one line through the pivot, at rest.

    python -m benchmarks.chain_deck 10 --dt 0.002 --t-final 2000 > chain10.xml

Every body has m = 2 kg, I = 0.008 kg m^2 and hangs on the one before it, 5 m on, by a spherical
joint; z is down, the line leaves it by ``angle`` towards x. Ten such bodies and two are the same
problem as the thesis's double pendulum but for the number.
"""

import argparse

BODY = """\
      <rigidBody>
        <name>Bob{i}</name>
        <mass units="kg">2.0</mass>
        <moi>
          <Ixx units="kg-m^2">0.008</Ixx>
          <Iyy units="kg-m^2">0.008</Iyy>
          <Izz units="kg-m^2">0.008</Izz>
        </moi>
        <initialConditions>
          <position basis="Bob{i}">
            <z units="m">{z!r}</z>
          </position>
          <orientation>
            <eulerRotation>
              <phi units="deg">{angle!r}</phi>
              <u1>0.0</u1>
              <u2>1.0</u2>
              <u3>0.0</u3>
            </eulerRotation>
          </orientation>
        </initialConditions>
      </rigidBody>
"""

JOINT = """\
      <spherical>
        <name>Pivot{i}</name>
        <parent>
          <name>{parent}</name>
          <position basis="{parent}">
            <z units="m">0.0</z>
          </position>
        </parent>
        <child>
          <name>Bob{i}</name>
          <position basis="Bob{i}">
            <z units="m">-5.0</z>
          </position>
        </child>
      </spherical>
"""

DECK = """\
<?xml version="1.0" encoding="UTF-8"?>
<!-- Chain of {n} bodies dropped from {angle!r} degrees; z is down, the energy is constant. -->
<data>
  <unitSystem>SI</unitSystem>
  <system>
    <gravity>
      <g3 units="m/sec^2">9.80665</g3>
    </gravity>
    <bodies>
      <ground>
        <name>Base</name>
      </ground>
{bodies}    </bodies>
    <joints>
{joints}    </joints>
  </system>
  <simulation>
    <title>Chain{n}</title>
    <deltaT units="sec">{dt!r}</deltaT>
    <tFinal units="sec">{t_final!r}</tFinal>
  </simulation>
</data>
"""


def chain_deck(n: int, dt: float, t_final: float, angle: float = 45.0) -> str:
    """XML of a chain of ``n`` bodies; times in s, ``angle`` in degrees."""
    numbers = range(1, n + 1)
    bodies = "".join(BODY.format(i=i, z=5.0 * i, angle=angle) for i in numbers)
    parents = ["Base", *(f"Bob{i}" for i in numbers)]
    joints = "".join(JOINT.format(i=i, parent=parents[i - 1]) for i in numbers)
    return DECK.format(n=n, angle=angle, bodies=bodies, joints=joints, dt=dt, t_final=t_final)


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the deck of a chain to stdout.")
    parser.add_argument("bodies", type=int)
    parser.add_argument("--dt", type=float, default=0.01, metavar="S")
    parser.add_argument("--t-final", type=float, default=10.0, metavar="S")
    parser.add_argument("--angle", type=float, default=45.0, metavar="DEG")
    options = parser.parse_args()
    print(chain_deck(options.bodies, options.dt, options.t_final, options.angle), end="")


if __name__ == "__main__":
    main()

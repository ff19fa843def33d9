"""Write decks/machines/robot.xml: a six-axis robot whose torques are signals of the deck.

Usage: python tools/robot_deck.py [FILE]

The controller is inverse dynamics: the recursive Newton-Euler algorithm in the axes of the links,
applied to the accelerations that the controller wants. Each component that is neither zero nor a
name becomes a signal of the deck, and signals that no torque depends on are not written. In the
axes of link i, with p the joint's point of link i + 1 and c the mass centre, both from the joint's
point, and e the joint's axis:

    w_i = R^T w + e q'                              angular velocity
    b_i = R^T b + e q'' + R^T w x e q'              angular acceleration
    a_i = R^T (a + b x p + w x (w x p))             acceleration of the joint's point, less gravity
    F_i = m (a_i + b_i x c + w_i x (w_i x c)) ,     N_i = J b_i + w_i x J w_i
    f_i = F_i + R f ,   n_i = N_i + c x F_i + R n + p x R f ,   torque = e.n_i
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

WIDTH = 100
"""Characters of a line of the deck."""
DECK = Path(__file__).parents[1] / "decks" / "machines" / "robot.xml"

Vector = tuple[str, str, str]
"""Components: a name, a name with a minus sign, or "0"."""

ZERO: Vector = ("0", "0", "0")


@dataclass(frozen=True)
class Link:
    """A link: numbers of the deck by name, "0" where there is none."""

    name: str
    axis: int
    """Axis of its joint: 0 for x, 1 for y, 2 for z."""
    offset: Vector
    centre: Vector


LINKS = (
    Link("Column", 2, ZERO, ("0", "0", "c1z")),
    Link("Arm", 1, ("0", "0", "L1"), ("c2x", "0", "c2z")),
    Link("Elbow", 1, ("0", "0", "L2"), ("c3x", "c3y", "c3z")),
    Link("Forearm", 0, ("L3", "0", "D3"), ("c4x", "c4y", "0")),
    Link("Wrist", 1, ("L4", "0", "0"), ZERO),
    Link("Tool", 0, ZERO, ("c6x", "0", "c6z")),
)


PAINT, STEEL = "#f28e2b", "#4b5157"
SHAPES: dict[str, tuple[str, ...]] = {
    "Base": (
        f'<cylinder colour="{STEEL}"><radius>0.12</radius><length>0.1</length>'
        "<position><z>0.05</z></position></cylinder>",
    ),
    "Column": (
        f'<cylinder colour="{PAINT}"><radius>0.085</radius><length>0.13</length>'
        "<position><z>0.165</z></position></cylinder>",
        f'<cylinder colour="{PAINT}"><radius>0.075</radius><length>0.17</length>'
        "<position><z>{L1}</z></position><axis><y>1</y></axis></cylinder>",
    ),
    "Arm": (
        f'<capsule colour="{PAINT}"><radius>0.05</radius><length>{{L2}}</length>'
        "<position><z>{L2/2}</z></position></capsule>",
    ),
    "Elbow": (
        f'<cylinder colour="{PAINT}"><radius>0.062</radius><length>0.13</length>'
        "<axis><y>1</y></axis></cylinder>",
        f'<box colour="{PAINT}"><x>{{L3}}</x><y>0.09</y><z>0.1</z>'
        "<position><x>{L3/2}</x><z>{D3}</z></position></box>",
    ),
    "Forearm": (
        f'<cylinder colour="{PAINT}"><radius>0.042</radius><length>{{L4}}</length>'
        "<position><x>{L4/2}</x></position><axis><x>1</x></axis></cylinder>",
    ),
    "Wrist": (
        f'<cylinder colour="{STEEL}"><radius>0.045</radius><length>0.092</length>'
        "<axis><y>1</y></axis></cylinder>",
    ),
    "Tool": (
        f'<cylinder colour="{STEEL}"><radius>0.03</radius><length>{{flange}}</length>'
        "<position><x>{flange/2}</x></position><axis><x>1</x></axis></cylinder>",
        f'<cone colour="{STEEL}"><radius>0.022</radius><length>0.07</length>'
        "<position><x>{1.45*flange}</x></position><axis><x>1</x></axis></cone>",
    ),
}
"""What the ground and the links look like: elements of the deck."""


class Signals:
    """Signals in the order in which they are made; each depends on earlier ones only."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}

    def add(self, name: str, *terms: str) -> str:
        """Return the name of the sum of ``terms``, which are products; "0" if all are zero."""
        terms = tuple(term for term in terms if term != "0")
        text = " + ".join(terms).replace("+ -", "- ")
        if not terms or text.lstrip("-").isidentifier():
            return text or "0"
        self.texts[name] = text
        return name

    def vector(self, name: str, *parts: tuple[str, str, str]) -> Vector:
        """Return the sum of vectors of products as a vector of signals ``name`` x, y, z."""
        x, y, z = (
            self.add(name + axis, *(part[k] for part in parts)) for k, axis in enumerate("xyz")
        )
        return x, y, z

    def needed(self, wanted: list[str]) -> dict[str, str]:
        """Return the signals that those in ``wanted`` depend on, in their order."""
        found = set(wanted)
        for name, text in reversed(self.texts.items()):
            if name in found:
                found |= set("".join(c if c.isalnum() else " " for c in text).split())
        return {name: text for name, text in self.texts.items() if name in found}


def times(a: str, b: str) -> str:
    """Return the product of two names with signs."""
    if "0" in (a, b):
        return "0"
    sign = "-" if a.startswith("-") != b.startswith("-") else ""
    return f"{sign}{a.lstrip('-')}*{b.lstrip('-')}"


def minus(a: str) -> str:
    """Return a product or name with the other sign."""
    return a if a == "0" else a.removeprefix("-") if a.startswith("-") else f"-{a}"


def scaled(a: str, v: Vector) -> Vector:
    """Return a times v."""
    return times(a, v[0]), times(a, v[1]), times(a, v[2])


def along(axis: int, a: str) -> Vector:
    """Return the vector with the component ``a`` along a coordinate axis."""
    x, y, z = (a if k == axis else "0" for k in range(3))
    return x, y, z


def cross(a: Vector, b: Vector) -> tuple[Vector, Vector]:
    """Return a x b as two vectors of products to add."""
    first = times(a[1], b[2]), times(a[2], b[0]), times(a[0], b[1])
    second = times(a[2], b[1]), times(a[0], b[2]), times(a[1], b[0])
    return first, (minus(second[0]), minus(second[1]), minus(second[2]))


def rotated(axis: int, i: int, v: Vector, back: bool) -> tuple[Vector, Vector]:
    """Return R v, or R^T v if ``back``, as vectors to add; R rotates by the angle of joint i."""
    cos, sin = f"cos{i}", f"sin{i}"
    one, other = (axis + 1) % 3, (axis + 2) % 3
    direct, across = list(ZERO), list(ZERO)
    direct[axis] = v[axis]
    direct[one], direct[other] = times(cos, v[one]), times(cos, v[other])
    across[one], across[other] = minus(times(sin, v[other])), times(sin, v[one])
    if back:
        across = [minus(each) for each in across]
    return (direct[0], direct[1], direct[2]), (across[0], across[1], across[2])


def path(signals: Signals, i: int) -> None:
    """Add the path of joint i, and the acceleration that the controller wants."""
    add = signals.texts.__setitem__
    add(f"phase{i}", f"f{i}*t + p{i}")
    add(f"target{i}", f"middle{i} + swing{i}*sin(phase{i})")
    add(f"targetRate{i}", f"swing{i}*f{i}*cos(phase{i})")
    add(f"targetAcceleration{i}", f"-swing{i}*f{i}^2*sin(phase{i})")
    add(f"error{i}", f"target{i} - J{i}.angle")
    errors = f"Kd*(targetRate{i} - J{i}.angleRate) + Kp*error{i}"
    add(f"wanted{i}", f"targetAcceleration{i} + {errors}")
    add(f"rate{i}", f"J{i}.angleRate")
    add(f"sin{i}", f"sin(J{i}.angle)")
    add(f"cos{i}", f"cos(J{i}.angle)")


def load(signals: Signals, i: int, w: Vector, b: Vector, a: Vector) -> tuple[Vector, Vector]:
    """Add force and moment of link i about its mass centre, from its motion; return both."""
    centre = LINKS[i - 1].centre
    wc = signals.vector(f"wc{i}", *cross(w, centre))
    ac = signals.vector(f"ac{i}", a, *cross(b, centre), *cross(w, wc))
    J = f"I{i}x", f"I{i}y", f"I{i}z"
    Jw = signals.vector(f"H{i}", (times(J[0], w[0]), times(J[1], w[1]), times(J[2], w[2])))
    Jb = times(J[0], b[0]), times(J[1], b[1]), times(J[2], b[2])
    return (
        signals.vector(f"F{i}", scaled(f"m{i}", ac)),
        signals.vector(f"N{i}", Jb, *cross(w, Jw)),
    )


def torques() -> dict[str, str]:
    """Return all signals; those called torque1 to torque6 are the controller's torques."""
    signals = Signals()
    w, b, a = ZERO, ZERO, ("0", "0", "g")
    loads = []
    for i, link in enumerate(LINKS, 1):
        path(signals, i)
        wp = signals.vector(f"wp{i}", *cross(w, link.offset))
        ap = signals.vector(f"ap{i}", a, *cross(b, link.offset), *cross(w, wp))
        a = signals.vector(f"a{i}", *rotated(link.axis, i, ap, back=True))
        w = signals.vector(f"wr{i}", *rotated(link.axis, i, w, back=True))
        b = signals.vector(f"br{i}", *rotated(link.axis, i, b, back=True))
        rate = along(link.axis, f"rate{i}")
        b = signals.vector(f"b{i}", b, along(link.axis, f"wanted{i}"), *cross(w, rate))
        w = signals.vector(f"w{i}", w, rate)
        loads.append(load(signals, i, w, b, a))
    f, n = ZERO, ZERO
    for i in range(len(LINKS), 0, -1):
        link, (F, N) = LINKS[i - 1], loads[i - 1]
        after = LINKS[i].offset if i < len(LINKS) else ZERO
        n = signals.vector(f"n{i}", N, n, *cross(link.centre, F), *cross(after, f))
        f = signals.vector(f"f{i}", F, f)
        signals.texts[f"torque{i}"] = n[link.axis]
        f = signals.vector(f"fr{i}", *rotated(link.axis, i, f, back=False))
        n = signals.vector(f"nr{i}", *rotated(link.axis, i, n, back=False))
    wanted = [f"{name}{i}" for i in range(1, 7) for name in ("torque", "error")]
    return signals.needed(wanted)


PARAMETERS: Sequence[tuple[str, str, Sequence[tuple[str, str]]]] = (
    (
        "Distances between the joints",
        "m",
        (("L1", "0.29"), ("L2", "0.27"), ("L3", "0.134"), ("D3", "0.07"), ("L4", "0.168")),
    ),
    ("Flange from the last joint", "m", (("flange", "0.072"),)),
    (
        "Masses",
        "kg",
        (
            ("m1", "3.1"),
            ("m2", "3.9"),
            ("m3", "2.9"),
            ("m4", "1.3"),
            ("m5", "0.55"),
            ("m6", "0.64"),
        ),
    ),
    (
        "Mass centres, from the joint of the link",
        "m",
        (
            ("c1z", "0.24"),
            ("c2x", "0.001"),
            ("c2z", "0.1"),
            ("c3x", "0.023"),
            ("c3y", "-0.001"),
            ("c3z", "0.058"),
            ("c4x", "0.092"),
            ("c4y", "-0.001"),
            ("c6x", "0.095"),
            ("c6z", "0.002"),
        ),
    ),
)
INERTIA = (
    ("0.014", "0.014", "0.010"),
    ("0.026", "0.024", "0.006"),
    ("0.006", "0.014", "0.013"),
    ("0.003", "0.004", "0.005"),
    ("0.0004", "0.0008", "0.0009"),
    ("0.0004", "0.0005", "0.0005"),
)
"""Principal moments of the links about their mass centres, in link axes [kg m^2]."""
PATH = (
    ("0", "50", "2", "0", "10"),
    ("20", "25", "3", "90", "40"),
    ("10", "20", "2", "45", "30"),
    ("0", "60", "3", "0", "-10"),
    ("40", "30", "4", "30", "50"),
    ("0", "90", "3", "0", "15"),
)
"""Of each joint: middle, swing [deg], frequency [rad/s] and phase [deg] of its path, and its angle
at the start [deg]."""

HEADER = """\
<?xml version="1.0" encoding="UTF-8"?>
<!--
  Six-axis robot on computed-torque control.

  An arm of the size of a small industrial robot follows a path, a sine in each joint. The
  controller computes the torques that give the joints the accelerations
      target'' + Kd (target' - angle') + Kp (target - angle)
  by the recursive Newton-Euler algorithm, written as signals (tools/robot_deck.py writes this
  deck). The joints' axes are z, y, y, x, y, x; the arm starts at rest, off its path.

  Expect: since the controller's model is the robot, the error of each joint is that of a critically
  damped oscillator, (e + (e' + 10 e) t) exp(-10 t) from its error e and rate of error e' at the
  start; at 1 s it is below 1e-3 rad. The last joint is at
  t = 2 s @END@ m.
-->
<data xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
      xsi:noNamespaceSchemaLocation="../../schemas/msaHLData.xsd">
  <unitSystem>SI</unitSystem>
"""
END = "(0.376678247, -0.292604337, 0.373073509)"
"""Position of the last joint on the path at 2 s, plus what is left of the error [m]."""


def parameter(name: str, value: str, units: str = "") -> str:
    """Return the line of a parameter."""
    given = f' units="{units}"' if units else ""
    return f'    <parameter name="{name}"{given}>{value}</parameter>'


def parameters() -> list[str]:
    """Return the lines of all parameters."""
    lines = ["  <parameters>", parameter("g", "9.81", "m/sec^2")]
    for title, units, entries in PARAMETERS:
        lines.append(f"    <!-- {title} -->")
        lines += [parameter(name, value, units) for name, value in entries]
    lines.append("    <!-- Moments of inertia about the mass centres -->")
    for i, moments in enumerate(INERTIA, 1):
        lines += [
            parameter(f"I{i}{axis}", value, "kg-m^2")
            for axis, value in zip("xyz", moments, strict=True)
        ]
    lines.append("    <!-- Path of each joint: middle + swing sin(f t + p) -->")
    for i, (middle, swing, frequency, phase, _) in enumerate(PATH, 1):
        lines.append(parameter(f"middle{i}", middle, "deg"))
        lines.append(parameter(f"swing{i}", swing, "deg"))
        lines.append(parameter(f"f{i}", frequency, "rad/sec"))
        lines.append(parameter(f"p{i}", phase, "deg"))
    lines += ["    <!-- Gains [1/s^2] and [1/s] -->", parameter("Kp", "100"), parameter("Kd", "20")]
    return [*lines, "  </parameters>"]


def components(names: Vector, indent: str) -> str:
    """Return the components of a vector that are not zero, as elements."""
    return "".join(
        f"{indent}<{axis}>{{{name}}}</{axis}>"
        for axis, name in zip("xyz", names, strict=True)
        if name != "0"
    )


def shapes(name: str) -> list[str]:
    """Return the lines of the shapes of a link or the ground."""
    lines = ["        <shapes>"]
    for shape in SHAPES[name]:
        tag = shape[1:].split(maxsplit=1)[0]
        head, rest = shape.split(">", maxsplit=1)
        inside = rest.removesuffix(f"</{tag}>")
        lines += [f"          {head}>", f"            {inside}", f"          </{tag}>"]
    return [*lines, "        </shapes>"]


def bodies() -> list[str]:
    """Return the lines of the ground and the links."""
    lines = ["    <bodies>", "      <ground>", "        <name>Base</name>"]
    lines += [*shapes("Base"), "      </ground>"]
    for i, link in enumerate(LINKS, 1):
        moments = "".join(f"<I{a}{a}>{{I{i}{a}}}</I{a}{a}>" for a in "xyz")
        lines += ["      <rigidBody>", f"        <name>{link.name}</name>"]
        lines.append(f"        <mass>{{m{i}}}</mass>")
        if link.centre != ZERO:
            lines.append(f"        <rGB>{components(link.centre, '')}</rGB>")
        lines += [f"        <moi>{moments}</moi>", *shapes(link.name), "      </rigidBody>"]
    return [*lines, "    </bodies>"]


def joints() -> list[str]:
    """Return the lines of the joints, with their angles at the start."""
    lines, before = ["    <joints>"], "Base"
    for i, (link, (*_, start)) in enumerate(zip(LINKS, PATH, strict=True), 1):
        axis = "xyz"[link.axis]
        offset = (
            "" if link.offset == ZERO else f"<position>{components(link.offset, '')}</position>"
        )
        lines += [
            "      <revolute>",
            f"        <name>J{i}</name>",
            "        <parent>",
            f"          <name>{before}</name>",
            *([f"          {offset}"] if offset else []),
            f"          <axis><{axis}>1</{axis}></axis>",
            "        </parent>",
            f"        <child><name>{link.name}</name></child>",
            f'        <initialConditions><angle units="deg">{start}</angle></initialConditions>',
            "      </revolute>",
        ]
        before = link.name
    return [*lines, "    </joints>"]


def controller() -> list[str]:
    """Return the lines of the signals."""
    lines = ["    <signals>"]
    for name, text in torques().items():
        line = f'      <signal name="{name}">{{{text}}}</signal>'
        if len(line) <= WIDTH:
            lines.append(line)
        else:
            body = f"        {{{text}}}"
            lines += [f'      <signal name="{name}">', body, "      </signal>"]
    return [*lines, "    </signals>"]


def motors() -> list[str]:
    """Return the lines of the actuators."""
    lines = ["    <loads>"]
    for i in range(1, 7):
        lines += [
            "      <actuator>",
            f"        <name>Motor {i}</name>",
            f"        <joint>J{i}</joint>",
            "        <coordinate>angle</coordinate>",
            f"        <expression>{{torque{i}}}</expression>",
            "      </actuator>",
        ]
    return [*lines, "    </loads>"]


MARKERS = [
    "    <markers>",
    "      <marker>",
    "        <name>Flange</name>",
    "        <body>Tool</body>",
    "        <position><x>{flange}</x></position>",
    "      </marker>",
    "    </markers>",
]
SIMULATION = [
    "  <simulation>",
    "    <title>Six-axis robot</title>",
    '    <deltaT units="sec">0.005</deltaT>',
    '    <tFinal units="sec">3</tFinal>',
    "  </simulation>",
]


def deck() -> str:
    """Return the text of the deck."""
    system = ["  <system>", "    <gravity><g3>{-g}</g3></gravity>", *bodies(), *joints(), *MARKERS]
    lines = [*parameters(), *system, *controller(), *motors(), "  </system>", *SIMULATION]
    return HEADER.replace("@END@", END) + "\n".join([*lines, "</data>"]) + "\n"


def main() -> None:
    """Write the deck."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else DECK
    path.write_text(deck(), encoding="utf-8")


if __name__ == "__main__":
    main()

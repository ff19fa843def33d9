"""Define families of extreme models: a deck of ``decks/extreme`` and the number varied in it.

    python -m tools.validation.extreme_families                     list the families
    python -m tools.validation.extreme_families mass_ratio 1e-6     print that deck

Every cell of docs/validation/stability.md is such a deck, run by ``msahl run``.
"""

import operator
import sys
from collections.abc import Callable, Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from math import acos, asin, cos, pi, sin, sqrt
from pathlib import Path
from typing import Any

from lxml import etree

from msahl.model import Bushing, Joint, Model, SpringDamper

ROOT = Path(__file__).resolve().parents[2]
DECKS = ROOT / "decks"

# The stubs of lxml give xpath the union of all results that it may have.
Root = Any
Numbers = dict[str, float]


@dataclass(frozen=True)
class Family:
    """A deck and one number of it.

    ``edit`` puts a value into the parsed deck. ``size`` [m] is the length with which a position
    error is compared, ``good`` the accepted fraction of it, ``arm`` [m] the length with which a
    constraint violation is compared, ``horizon`` [s] the time up to which there are reference
    positions: chaotic motions have none later. ``model`` is the model of the reference if it is not
    the deck's own; ``steps`` and ``bound`` [s] limit a run.
    """

    name: str
    title: str
    varied: str
    unit: str
    values: tuple[float, ...]
    edit: Callable[[Root, float], None]
    deck: str = ""
    size: Callable[[float], float] = lambda x: 1.0
    arm: Callable[[float], float] = lambda x: 1.0
    good: float = 1e-3
    horizon: Callable[[float], float] = lambda x: 2.0
    model: Callable[[Model, float], Model] = lambda model, x: model
    steps: Callable[[float], int] = lambda x: 10_000
    exact_steps: bool = False
    bound: float = 4.0
    known: bool = True

    @property
    def path(self) -> Path:
        """Its deck."""
        return DECKS / f"{self.deck or f'extreme/{self.name}'}.xml"

    def with_value(self, x: float) -> bytes:
        """The deck with ``x`` put in."""
        root = etree.fromstring(self.path.read_bytes())
        self.edit(root, x)
        tree = root.getroottree()
        text: bytes = etree.tostring(tree, xml_declaration=True, encoding="UTF-8")
        return text


def put(root: Root, path: str, number: float) -> None:
    """Write ``number`` into every element at ``path``, of which there must be one at least."""
    change(root, path, lambda old: number)


def change(root: Root, path: str, law: Callable[[float], float]) -> None:
    """Replace the number of every element at ``path`` by the ``law`` of it."""
    found = root.xpath(path)
    if not found:
        raise KeyError(path)
    for element in found:
        element.text = repr(float(law(float(element.text))))


def scale(*paths: str, power: int = 1) -> Callable[[Root, float], None]:
    """Multiply the numbers at ``paths`` by a power of the value."""

    def edit(root: Root, x: float) -> None:
        for path in paths:
            change(root, path, lambda old: old * x**power)

    return edit


def set_to(law: Callable[[float], float], *paths: str) -> Callable[[Root, float], None]:
    """Set the numbers at ``paths`` to a law of the value."""

    def edit(root: Root, x: float) -> None:
        for path in paths:
            put(root, path, law(x))

    return edit


def of_body(name: str, what: str) -> str:
    """Path of a part of a body."""
    return f"//rigidBody[name='{name}']//{what}"


def place(root: Root, body: str, numbers: Numbers, what: str = "position") -> None:
    """Set the components of a vector of a ``body``'s start; those it lacks are added."""
    (vector,) = root.xpath(of_body(body, f"initialConditions/{what}"))
    for tag, number in numbers.items():
        (element,) = vector.xpath(tag) or (etree.SubElement(vector, tag),)
        element.text = repr(float(number))


# Edits -------------------------------------------------------------------------------------------


def mass_ratio(root: Root, x: float) -> None:
    """The light links have ``x`` of the others' mass and inertia."""
    for name in ("Link 2", "Link 4"):
        for what in ("mass", "Ixx", "Iyy", "Izz"):
            (heavy,) = root.xpath(of_body("Link 1", what))
            put(root, of_body(name, what), x * float(heavy.text))


def length(root: Root, x: float) -> None:
    """All lengths times ``x``, inertias times its square."""
    scale("//position/x", "//position/z")(root, x)
    scale("//moi/*", power=2)(root, x)


def drift(root: Root, x: float) -> None:
    """All bodies are ``x`` m/s fast along x, beside what they have to tumble."""
    change(root, "//velocity/v1", lambda old: old - 1e3 + x)


def toggle(root: Root, x: float) -> None:
    """Rod of 1 + ``x`` cranks; the crank stands at 60 degrees and rotates at 10 rad/s."""
    crank, spin, angle = 0.1, 10.0, pi / 3
    rod = crank * (1.0 + x)
    pin_x, pin_z = crank * cos(angle), crank * sin(angle)
    lean = asin(pin_z / rod)
    rate = spin * pin_x / (rod * cos(lean))  # of the rod, so that the wrist stays on the axis
    place(root, "Rod", {"x": pin_x + 0.5 * rod * cos(lean), "z": 0.5 * pin_z})
    put(root, of_body("Rod", "phi"), lean)
    put(root, of_body("Rod", "omega2"), rate)
    v_z = 0.5 * spin * pin_x
    place(root, "Rod", {"v1": -spin * pin_z - 0.5 * rate * pin_z, "v3": v_z}, "velocity")
    place(root, "Slider", {"x": pin_x + rod * cos(lean)})
    place(root, "Slider", {"v1": -spin * pin_z - rate * pin_z}, "velocity")
    ends = {"parent[name='Rod']": 0.5, "child[name='Rod']": -0.5}
    for end, share in ends.items():
        put(root, f"//{end}/position/x", share * rod)


def folded_chain(root: Root, x: float) -> None:
    """Each link at the angle ``x`` to the one before: 0 back on it, pi straight on."""
    at_x = at_z = 0.0
    for k in range(4):
        angle = 0.3 if k % 2 == 0 else 0.3 - pi + x
        step_x, step_z = cos(angle), -sin(angle)
        place(root, f"Link {k + 1}", {"x": at_x + 0.5 * step_x, "z": at_z + 0.5 * step_z})
        put(root, of_body(f"Link {k + 1}", "phi"), angle)
        at_x, at_z = at_x + step_x, at_z + step_z


def taut_chain(root: Root, x: float) -> None:
    """Three links of 1 m between pins 3 - ``x`` m apart, bowed sideways."""
    bow = acos(1.0 - 0.5 * x)
    run, rise = cos(bow), sin(bow)
    place(root, "Link 1", {"x": 0.5 * run, "y": 0.5 * rise})
    place(root, "Link 2", {"x": run + 0.5, "y": rise})
    place(root, "Link 3", {"x": 1.5 * run + 1.0, "y": 0.5 * rise})
    for name, angle in (("Link 1", bow), ("Link 3", -bow)):
        put(root, of_body(name, "phi"), angle)
    put(root, "//parent[name='Base']/position[x]/x", 2.0 * run + 1.0)


def cranks(root: Root, x: float) -> None:
    """``x`` cranks, evenly along the beam."""
    (first,) = root.xpath("//rigidBody[name='Crank 1']")
    joints = [root.xpath(f"//revolute[name='{name} 1']")[0] for name in ("Pivot", "Pin")]
    for stale in root.xpath("//rigidBody[name='Crank 2']|//revolute[contains(name, ' 2')]"):
        stale.getparent().remove(stale)
    for k in range(1, round(x)):
        at = 2.0 * k / (round(x) - 1)
        body = deepcopy(first)
        for joint in map(deepcopy, joints):
            _rename(joint, " 1", f" {k + 1}")
            (parent,) = joint.xpath("parent[name='Base']|child[name='Beam']")
            vector = parent.find("position")
            if vector is None:
                vector = etree.SubElement(parent, "position")
            if vector.find("x") is None:
                etree.SubElement(vector, "x").text = "0"
            change(vector, "x", partial(operator.add, at))
            joints[0].getparent().append(joint)
        _rename(body, " 1", f" {k + 1}")
        change(body, ".//position/x", partial(operator.add, at))
        first.getparent().append(body)


def long_chain(root: Root, x: float) -> None:
    """``x`` links in a row, the last of the deck's repeated."""
    (last,) = root.xpath("//rigidBody[last()]")
    (joint,) = root.xpath("//spherical[last()]")
    n = len(root.xpath("//rigidBody"))
    for k in range(n, round(x)):
        body, pin = deepcopy(last), deepcopy(joint)
        _rename(body, f" {n}", f" {k + 1}")
        change(body, ".//position/x", partial(operator.add, k + 1 - n))
        put_text(pin, "name", f"Pin {k + 1}")
        put_text(pin, "parent/name", f"Link {k}")
        put_text(pin, "child/name", f"Link {k + 1}")
        last.getparent().append(body)
        joint.getparent().append(pin)


def put_text(root: Root, path: str, text: str) -> None:
    """Write ``text`` into the element at ``path``."""
    (element,) = root.xpath(path)
    element.text = text


def _rename(root: Root, old: str, new: str) -> None:
    """Replace the end ``old`` of every name, and of bases, in ``root``."""
    for element in root.iter():
        if element.tag == "name" and element.text.endswith(old):
            element.text = element.text.removesuffix(old) + new
        basis = element.get("basis")
        if basis is not None and basis.endswith(old):
            element.set("basis", basis.removesuffix(old) + new)


def as_given(root: Root, x: float) -> None:
    """The jump stays in the start."""
    put(root, "//velocity/v2", x)
    (simulation,) = root.xpath("//simulation")
    etree.SubElement(simulation, "assembly", velocity="asGiven")


# Limits ------------------------------------------------------------------------------------------

STIFF = 1e-2
"""Periods [s] of the bouncing below which the thread is as good as a rod: it gives 8e-5 m."""
FIRM = 1e7
"""Stiffness [N/m] of the mount above which it is as good as a pin."""


def as_rod(model: Model, x: float) -> Model:
    """The stiff pendulum with a rod in place of the spring."""
    if x > STIFF:
        return model
    (spring,) = model.loads
    assert isinstance(spring, SpringDamper)
    ends = (spring.parent, spring.child, spring.parent_point, spring.child_point)
    rod = Joint(spring.name, "distance", *ends, parameters=(("length", 1.0),))
    return replace(model, joints=(rod,), loads=())


def as_pin(model: Model, x: float) -> Model:
    """The bushing's loop closed by a pin."""
    if x < FIRM:
        return model
    (mount,) = model.loads
    assert isinstance(mount, Bushing)
    ends = (mount.parent, mount.child, mount.parent_point, mount.child_point)
    pin = Joint(mount.name, "spherical", *ends)
    return replace(model, joints=(*model.joints, pin), loads=())


def compliant(name: str) -> str:
    """Return the name of a family with its springs in the compliance form."""
    return f"{name}_compliance"


def in_compliance_form(family: Family) -> Family:
    """Return a family with all its springs and bushings in the compliance form."""

    def edit(root: Root, x: float) -> None:
        family.edit(root, x)
        for element in root.xpath("//springDamper | //bushing"):
            element.set("form", "compliance")

    return replace(
        family,
        name=compliant(family.name),
        title=f"{family.title}, compliance form",
        edit=edit,
        deck=family.deck or f"extreme/{family.name}",
    )


_AS_WRITTEN = {
    family.name: family
    for family in (
        Family(
            "mass_ratio",
            "Light and heavy links in angle",
            "mass of the light links over the others'",
            "1",
            (1e-6, 1e-3, 1.0, 1e3, 1e6),
            mass_ratio,
            horizon=lambda x: 1.0,
        ),
        Family(
            "point_mass",
            "Near point masses",
            "inertia",
            "kg m^2",
            (1e-9, 1e-6, 1e-3, 1.0),
            set_to(lambda x: x, "//moi/*"),
        ),
        Family(
            "needle_to_disk",
            "A top from needle to disk",
            "inertia about the axis over that across it",
            "1",
            (1e-9, 1e-6, 1e-3, 1.0, 2.0),
            set_to(lambda x: 0.1 * x, "//Izz"),
            size=lambda x: 0.5,
        ),
        Family(
            "length",
            "From a micrometre to a thousand kilometres",
            "length of the rods",
            "m",
            (1e-6, 1e-3, 1.0, 1e3, 1e6),
            length,
            size=lambda x: x,
            arm=lambda x: x,
            horizon=lambda x: 2.0 * sqrt(x),
        ),
        Family(
            "spin",
            "Sleeping top",
            "spin",
            "rad/s",
            (10.0, 1e2, 1e3, 1e4, 1e5),
            set_to(lambda x: x, "//omega3"),
            size=lambda x: 2e-4,
            good=1e-2,
        ),
        Family(
            "stiff_spring",
            "Stiff spring",
            "period over 2 pi",
            "s",
            (1e-9, 1e-7, 1e-5, 1e-3, 1e-1),
            set_to(lambda x: x**-2, "//stiffness"),
            size=lambda x: x,
        ),
        Family(
            "stiff_pendulum",
            "Pendulum on a stiff spring",
            "period of the bouncing",
            "s",
            (1e-5, 1e-4, 1e-3, 1e-2, 1e-1),
            set_to(lambda x: (2.0 * pi / x) ** 2, "//stiffness"),
            model=as_rod,
        ),
        Family(
            "damping",
            "Strong damping",
            "damping over the critical",
            "1",
            (0.0, 0.1, 1.0, 10.0, 1e3),
            set_to(lambda x: 4.0 * pi * x, "//damping"),
            size=lambda x: 0.16,
        ),
        Family(
            "bushing_loop",
            "Near-rigid bushing in a loop",
            "stiffness of the mount",
            "N/m",
            (1e3, 1e6, 1e9, 1e12, 1e15),
            set_to(lambda x: x, "//stiffness/*"),
            horizon=lambda x: 1.0,
            model=as_pin,
        ),
        Family(
            "governor",
            "Stiff flyball governor",
            "damping of the links",
            "N s/m",
            (0.0, 4e2, 4e4, 4e6),
            set_to(lambda x: x, "//springDamper/damping"),
            deck="mechanisms/flyball_governor",
            horizon=lambda x: 1.0,
        ),
        Family(
            "toggle",
            "Slider-crank at its toggles",
            "rod over crank, less one",
            "1",
            (0.0, 1e-9, 1e-6, 1e-3, 0.5, 2.0),
            toggle,
            size=lambda x: 0.1,
        ),
        Family(
            "folded_chain",
            "Folded and stretched chain",
            "angle between two links",
            "rad",
            (0.0, 1e-9, 1e-3, 1.0, pi),
            folded_chain,
            horizon=lambda x: 1.0,
        ),
        Family(
            "taut_chain",
            "Taut chain",
            "slack",
            "m",
            (0.0, 1e-9, 1e-6, 1e-3, 1e-1),
            taut_chain,
            horizon=lambda x: 1.0,
        ),
        Family(
            "inverted",
            "Pendulum at the top of its circle",
            "angle off the vertical",
            "rad",
            (0.0, 1e-12, 1e-6, 1e-3, 1e-1),
            set_to(lambda x: x, "//phi"),
            horizon=lambda x: 5.0,
        ),
        Family(
            "cranks",
            "Redundant loops",
            "number of cranks",
            "1",
            (2.0, 3.0, 8.0, 32.0),
            cranks,
            size=lambda x: 0.5,
            steps=lambda x: int(60_000 / x**1.5),
        ),
        Family(
            "drift",
            "No gravity, no ground",
            "speed of the drift",
            "m/s",
            (0.0, 1.0, 1e3, 1e6),
            drift,
        ),
        Family(
            "long_run",
            "Very many steps",
            "number of steps",
            "1",
            (1e4, 1e5, 1e6),
            lambda root, x: None,
            size=lambda x: 5.0,
            horizon=lambda x: 1e9,
            steps=round,
            exact_steps=True,
            bound=60.0,
        ),
        Family(
            "long_chain",
            "Long chain swinging through",
            "number of links",
            "1",
            (10.0, 100.0, 1000.0),
            long_chain,
            size=lambda x: x,
            horizon=lambda x: 1.0,
            steps=lambda x: int(1e5 / x),
            bound=30.0,
        ),
        Family(
            "inconsistent",
            "Start with a jump of velocity, mended",
            "speed that opens the joint",
            "m/s",
            (1e-6, 1.0, 1e3),
            set_to(lambda x: x, "//velocity/v2"),
            horizon=lambda x: 1.0,
        ),
        Family(
            "inconsistent_as_given",
            "Start with a jump of velocity, left as given",
            "speed that opens the joint",
            "m/s",
            (1e-6, 1.0, 1e3),
            as_given,
            deck="extreme/inconsistent",
            known=False,
        ),
        Family(
            "open_joint",
            "Start with an open joint",
            "constraint violation at the start",
            "m",
            (1e-6, 1e-3, 1e-2, 1e-1),
            lambda root, x: place(root, "Bob 2", {"x": 1.5 * cos(0.3) + x}),
            horizon=lambda x: 1.0,
        ),
    )
}

STIFF_SPRINGS = ("stiff_spring", "stiff_pendulum", "bushing_loop", "governor")
"""Families whose springs are stiff, which are run in both forms."""
FAMILIES = _AS_WRITTEN | {
    family.name: family
    for family in (in_compliance_form(_AS_WRITTEN[name]) for name in STIFF_SPRINGS)
}


def listed() -> Iterable[str]:
    """What there is, a line a family."""
    for family in FAMILIES.values():
        values = " ".join(f"{x:g}" for x in family.values)
        yield f"{family.name:22} {family.varied} [{family.unit}]: {values}"


def main(arguments: list[str]) -> None:
    """Print the list, or a deck."""
    if len(arguments) != 2 or arguments[0] not in FAMILIES:
        sys.exit("usage: extreme.py FAMILY VALUE > deck.xml\n" + "\n".join(listed()))
    family, value = arguments
    sys.stdout.buffer.write(FAMILIES[family].with_value(float(value)) + b"\n")


if __name__ == "__main__":
    main(sys.argv[1:])

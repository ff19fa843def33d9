"""Fixed tendons of MJCF: lengths L = sum c q of joints, and the forces along them.

Spring, damper and dry friction give

    f = -k max(L - L_high, 0) - k min(L - L_low, 0) - c L_dot - F tanh(L_dot/width)

Without a springlength the spring is unloaded where all joints are at their springref. Source:
MuJoCo, XML reference, tendon/fixed.
"""

from collections.abc import Mapping
from typing import NamedTuple

from msahl.deck.faults import Element, attribute
from msahl.importers.loads import note_friction
from msahl.importers.mjcf_settings import Settings, note_unread, resolved, several
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, number
from msahl.importers.robot import Axis, Drive, Terms

READ = (
    "name", "class", "group", "stiffness", "damping", "frictionloss", "springlength", "range",
    "limited", "width", "rgba", "material", "user", "margin", "solreflimit", "solimplimit",
    "solreffriction", "solimpfriction",
)  # fmt: skip


class Tendons(NamedTuple):
    """Fixed tendons by name, the forces along them, and the names of those that are not carried
    over."""

    terms: dict[str, Terms]
    drives: list[Drive]
    unread: set[str]


def read_tendons(
    root: Element,
    settings: Settings,
    axes: Mapping[str, Axis],
    options: ImportOptions,
    log: Log,
) -> Tendons:
    """Return the fixed tendons; what is not carried over is noted."""
    found = Tendons({}, [], set())
    for count, element in enumerate(root.iterfind("tendon/*")):
        resolved(element, settings, log)
        name = attribute(element, "name") or f"tendon {count}"
        if element.tag != "fixed":
            log.lost(element, "msahl has no such element")
            found.unread.add(name)
            continue
        terms = _terms(element, axes, log)
        if terms is None:
            continue
        found.terms[name] = terms
        text = _force(element, terms, axes, options, log)
        if text:
            found.drives.append(Drive(name, terms, text, None, element))
        _note_others(element, settings, log)
    return found


def _terms(element: Element, axes: Mapping[str, Axis], log: Log) -> Terms | None:
    """Return the joints of a tendon with their coefficients; None with a fault or a note."""
    terms: Terms = []
    for child in element.iterfind("joint"):
        name, c = attribute(child, "joint"), number(child, "coef", log)
        if name not in axes:
            log.fault(child, f"'{name}' is no joint")
            return None
        if axes[name].kind not in ("hinge", "slide"):
            log.fault(child, f"a fixed tendon follows hinges and slides, not a {axes[name].kind}")
            return None
        terms.append((name, (c,)))
    return terms


def _force(
    element: Element, terms: Terms, axes: Mapping[str, Axis], options: ImportOptions, log: Log
) -> str:
    """Return the expression of the force of a tendon; "" if it has none."""
    k, c, F = (number(element, name, log) for name in ("stiffness", "damping", "frictionloss"))
    if min(k, c, F) < 0.0:
        log.fault(element, "stiffness, damping and frictionloss must not be negative")
    low, high = _unloaded(element, terms, axes, log)
    parts = []
    if k and low == high:
        parts.append(f"-{k!r}*({{l}} - ({low!r}))")
    elif k:
        parts.append(f"-{k!r}*(max({{l}} - ({high!r}), 0) + min({{l}} - ({low!r}), 0))")
    if c:
        parts.append(f"-{c!r}*{{v}}")
    if F:
        width = options.friction_width[any(axes[name].kind == "slide" for name, _ in terms)]
        parts.append(f"-{F!r}*tanh({{v}}/{width!r})")
        note_friction(element, f"{width:g} of the tendon's rate", log)
    return " + ".join(parts)


def _unloaded(
    element: Element, terms: Terms, axes: Mapping[str, Axis], log: Log
) -> tuple[float, float]:
    """Return the lengths between which the spring of a tendon is unloaded."""
    given = several(element, "springlength", log, 2) or [-1.0]
    low, high = given[0], given[-1]
    if low == -1.0 and high == -1.0:
        low = high = sum(c * axes[name].rest for name, (c,) in terms)
    if low > high:
        log.fault(element, "springlength: give the smaller length first")
    return low, high


def _note_others(element: Element, settings: Settings, log: Log) -> None:
    """Note limits, and attributes that msahl has nothing for."""
    if settings.is_limited(element, ""):
        log.lost(element, "its range: msahl has no stop along a tendon")
    none = {str(k) for k, v in element.attrib.items() if str(v).strip() in ("0", "0.0", "false")}
    note_unread(element, none.union(READ), log)

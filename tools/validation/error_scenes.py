"""Define the machines with expressions, states and kinks of docs/validation/error.md.

Each is built from records, and once more as equations of motion by hand (``pieces.Motion``), which
share nothing with the engine: not the values of expressions either.
"""

from collections.abc import Callable, Sequence

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.algebra.vector import ZERO, Vector
from msahl.expressions.syntax import parse
from msahl.model import (
    ConcentratedLoad,
    Joint,
    JointActuator,
    Load,
    Model,
    RigidBody,
    Signal,
    SignalState,
)
from msahl.model.signals import AnySignal, SignalTable
from tools.validation.error_models import EARTH, Case, body, model_of
from tools.validation.pieces import Array, Motion, Sides

G = 9.81
ALONG_X = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Axes of a joint whose z is along x."""


def machine(
    parts: Sequence[tuple[RigidBody, Joint]],
    forces: dict[str, str],
    signals: Sequence[AnySignal] = (),
    gravity: Vector = ZERO,
    more: Sequence[Load] = (),
) -> Model:
    """Return a model of bodies on joints, with an actuator for each of the ``forces`` by joint."""
    from dataclasses import replace

    kinds = {joint.name: joint.kind for _, joint in parts}
    loads: list[Load] = [
        JointActuator(
            f"{name}Force", name, "slide" if kinds[name] == "prismatic" else "angle", parse(text)
        )
        for name, text in forces.items()
    ]
    bodies, joints = [b for b, _ in parts], [j for _, j in parts]
    return replace(
        model_of(bodies, joints, [*loads, *more], gravity=gravity), signals=tuple(signals)
    )


def rail(name: str, mass: float, place: float = 0.0, speed: float = 0.0) -> tuple[RigidBody, Joint]:
    """A body that slides along z on the joint ``name``."""
    slider = body(f"{name}Body", mass, (0.1,) * 3, (0.0, 0.0, place), velocity=(0.0, 0.0, speed))
    return slider, Joint(name, "prismatic", EARTH, slider.name, ZERO, ZERO)


def axle(name: str, inertia: float, speed: float = 0.0) -> tuple[RigidBody, Joint]:
    """A wheel that rotates about z on the joint ``name``."""
    wheel = body(f"{name}Body", 1.0, (inertia,) * 3, angular_velocity=(0.0, 0.0, speed))
    return wheel, Joint(name, "revolute", EARTH, wheel.name, ZERO, ZERO)


def state(name: str, rate: str, initial: float = 0.0) -> SignalState:
    """An auxiliary state by its rate."""
    return SignalState(name, parse(rate), initial)


def slides(*pairs: tuple[int, int]) -> Callable[[Array], Array]:
    """Bodies that move along z, by the columns of place and speed."""
    return lambda ys: _along_z(ys, pairs, 0)


def rotates(*pairs: tuple[int, int]) -> Callable[[Array], Array]:
    """Bodies that rotate about z, by the columns of angle and rate."""
    return lambda ys: _along_z(ys, pairs, 1)


def _along_z(ys: Array, pairs: Sequence[tuple[int, int]], part: int) -> Array:
    states = np.zeros((len(ys), len(pairs), 4, 3))
    for k, (q, rate) in enumerate(pairs):
        states[:, k, part, 2], states[:, k, part + 2, 2] = ys[:, q], ys[:, rate]
    return states


def columns(**places: int) -> Callable[[Array, Array], dict[str, Array]]:
    """Signals that are columns of the solution."""
    return lambda t, ys: {name: ys[:, k] for name, k in places.items()}


def table_spike() -> tuple[Model, Motion]:
    """A spike of 2 ms by a table, in the actuator of a cart on a spring."""
    x, height = (0.0, 0.311, 0.312, 0.313, 1.0), 500.0
    table = SignalTable("spike", Law("linear", (*x, 0.0, 0.0, height, 0.0, 0.0)))
    model = machine(
        [rail("Rail", 2.0, 0.1)],
        {"Rail": "spike(t) - 50*Rail.slide - 4*Rail.slideRate"},
        [table],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        spike = (0.0, (t - 0.311) / 1e-3, (0.313 - t) / 1e-3, 0.0)[piece] * height
        return [y[1], (spike - 50.0 * y[0] - 4.0 * y[1]) / 2.0]

    return model, Motion((0.1, 0.0), rates, slides((0, 1)), breaks=x[1:4])


def square_wave_motor() -> tuple[Model, Motion]:
    """A motor with a state for its current, on a square wave."""
    model = machine(
        [axle("Axle", 0.02)],
        {"Axle": "0.4*i"},
        [state("i", "(12*sign(sin(2*pi*t + 0.3)) - 1.3*i - 0.4*Axle.angleRate)/0.05")],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        voltage = 12.0 * (-1.0) ** piece
        return [y[1], 0.4 * y[2] / 0.02, (voltage - 1.3 * y[2] - 0.4 * y[1]) / 0.05]

    edges = [(k * np.pi - 0.3) / (2.0 * np.pi) for k in range(1, 5)]
    return model, Motion((0.0, 0.0, 0.0), rates, rotates((0, 1)), columns(i=2), breaks=edges)


def held_controller() -> tuple[Model, Motion]:
    """A cart that follows a goal which is sampled eight times a second and held."""
    model = machine(
        [rail("Rail", 2.0)],
        {"Rail": "80*(sin(3*floor(8*t)/8) - Rail.slide) - 14*Rail.slideRate"},
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        return [y[1], (80.0 * (np.sin(3.0 * piece / 8.0) - y[0]) - 14.0 * y[1]) / 2.0]

    return model, Motion((0.0, 0.0), rates, slides((0, 1)), breaks=[k / 8.0 for k in range(1, 17)])


def ramped_speed() -> tuple[Model, Motion]:
    """A wheel in a fluid whose speed follows a trapezium, by a controller with an integral."""
    model = machine(
        [axle("Axle", 0.05)],
        {"Axle": "0.8*error + 5*sum - 0.05*Axle.angleRate*abs(Axle.angleRate)"},
        [
            Signal("error", parse("max(0, min(4.1*t, 2, 6.3 - 4.1*t)) - Axle.angleRate")),
            state("sum", "error"),
        ],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        error = (4.1 * t, 2.0, 6.3 - 4.1 * t, 0.0)[piece] - y[1]
        drag = 0.05 * y[1] * y[1] * side[0]
        return [y[1], (0.8 * error + 5.0 * y[2] - drag) / 0.05, error]

    return model, Motion(
        (0.0, 0.0, 0.0),
        rates,
        rotates((0, 1)),
        columns(sum=2),
        lambda t, y: (y[1],),
        (2.0 / 4.1, 4.3 / 4.1, 6.3 / 4.1),
    )


def clamped_controller() -> tuple[Model, Motion]:
    """A cart with a controller whose force is bounded, and whose integral waits at the bound."""
    model = machine(
        [rail("Rail", 2.0)],
        {"Rail": "max(-12, min(12, u)) - 5"},
        [
            Signal("u", parse("80*(1 - Rail.slide) + 60*sum - 14*Rail.slideRate")),
            state("sum", "where(abs(u) < 12, 1 - Rail.slide, 0)"),
        ],
    )

    def wanted(y: Array) -> float:
        return float(80.0 * (1.0 - y[0]) + 60.0 * y[2] - 14.0 * y[1])

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        above, below = side[0] > 0.0, side[1] < 0.0
        force = 12.0 if above else -12.0 if below else wanted(y)
        return [y[1], (force - 5.0) / 2.0, 0.0 if above or below else 1.0 - y[0]]

    return model, Motion(
        (0.0, 0.0, 0.0),
        rates,
        slides((0, 1)),
        columns(sum=2),
        lambda t, y: (wanted(y) - 12.0, wanted(y) + 12.0),
    )


def stiff_lag() -> tuple[Model, Motion]:
    """A cart whose force follows its controller with a lag of half a millisecond."""
    model = machine(
        [rail("Rail", 1.0, 0.1)],
        {"Rail": "f"},
        [state("f", "(20*sin(3*t) - 100*Rail.slide - 10*Rail.slideRate - f)/0.0005")],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        wanted = 20.0 * np.sin(3.0 * t) - 100.0 * y[0] - 10.0 * y[1]
        return [y[1], y[2], (wanted - y[2]) / 0.0005]

    return model, Motion((0.1, 0.0, 0.0), rates, slides((0, 1)), columns(f=2))


def van_der_pol_drive() -> tuple[Model, Motion]:
    """A cart pulled by a spring behind the oscillator of van der Pol, of two states."""
    model = machine(
        [rail("Rail", 1.0)],
        {"Rail": "50*(p - Rail.slide) - 4*Rail.slideRate"},
        [state("p", "5*r", 1.0), state("r", "5*(3*(1 - p^2)*r - p)")],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        s, v, p, r = y
        return [v, 50.0 * (p - s) - 4.0 * v, 5.0 * r, 5.0 * (3.0 * (1.0 - p * p) * r - p)]

    return model, Motion((0.0, 0.0, 1.0, 0.0), rates, slides((0, 1)), columns(p=2, r=3))


def screw_press() -> tuple[Model, Motion]:
    """A screw that a motor drives against a spring which pushes only."""
    lead, mass, inertia = 0.02 / (2.0 * np.pi), 5.0, 0.02
    platen = body("Platen", mass, (inertia,) * 3)
    screw = Joint("Screw", "screw", EARTH, "Platen", ZERO, ZERO, parameters=(("pitch", 0.02),))
    work = ConcentratedLoad(
        "Work", "Platen", ZERO, (0.0, 0.0, -1.0), EARTH, ZERO, EARTH,
        expression=parse("2e5*max(0, Screw.angle*0.02/(2*pi) - 0.03)"),
    )  # fmt: skip
    model = machine([(platen, screw)], {"Screw": "2 - 0.04*Screw.angleRate"}, more=[work])

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        pressed = 2e5 * (lead * y[0] - 0.03) if side[0] > 0.0 else 0.0
        moment = 2.0 - 0.04 * y[1] - lead * pressed
        return [y[1], moment / (inertia + mass * lead * lead)]

    def bodies(ys: Array) -> Array:
        states = rotates((0, 1))(ys)
        states[:, 0, 0, 2], states[:, 0, 2, 2] = lead * ys[:, 0], lead * ys[:, 1]
        return states

    return model, Motion((0.0, 0.0), rates, bodies, switches=lambda t, y: (lead * y[0] - 0.03,))


def dead_zone() -> tuple[Model, Motion]:
    """A motor that drives a wheel through a clearance."""
    torque = "20*(max(play - 0.1, 0) + min(play + 0.1, 0))"
    model = machine(
        [axle("Motor", 0.02), axle("Load", 0.05)],
        {
            "Motor": f"2*sin(4*t + 0.5) - {torque} - 0.02*Motor.angleRate",
            "Load": f"{torque} - 0.05*Load.angleRate",
        },
        [Signal("play", parse("Motor.angle - Load.angle"))],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        a, wa, b, wb = y
        play = a - b
        push = play - 0.1 if side[0] > 0.0 else play + 0.1 if side[1] < 0.0 else 0.0
        drive = 2.0 * np.sin(4.0 * t + 0.5)
        return [wa, (drive - 20.0 * push - 0.02 * wa) / 0.02, wb, (20.0 * push - 0.05 * wb) / 0.05]

    return model, Motion(
        (0.0,) * 4,
        rates,
        rotates((0, 1), (2, 3)),
        lambda t, ys: {"play": ys[:, 0] - ys[:, 2]},
        lambda t, y: (y[0] - y[2] - 0.1, y[0] - y[2] + 0.1),
    )


def tyre_on_ground() -> tuple[Model, Motion]:
    """A quarter of a car over a bump that throws the wheel off the road."""
    load = "(340*9.81)"
    strut = "(20000*(Car.slide - Wheel.slide) + 1500*(Car.slideRate - Wheel.slideRate))"
    model = machine(
        [rail("Wheel", 40.0), rail("Car", 300.0)],
        {
            "Wheel": f"max(0, 180000*(road - Wheel.slide) + {load}) - {load} + {strut}",
            "Car": f"-{strut}",
        },
        [Signal("road", parse("0.08*exp(-((15*t - 3)/0.6)^2)"))],
    )
    weight = 340.0 * G

    def tyre(t: float, y: Array) -> float:
        road = 0.08 * np.exp(-(((15.0 * t - 3.0) / 0.6) ** 2))
        return float(180000.0 * (road - y[0]) + weight)

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        push = (tyre(t, y) if side[0] > 0.0 else 0.0) - weight
        strut = 20000.0 * (y[2] - y[0]) + 1500.0 * (y[3] - y[1])
        return [y[1], (push + strut) / 40.0, y[3], -strut / 300.0]

    return model, Motion(
        (0.0,) * 4, rates, slides((0, 1), (2, 3)), switches=lambda t, y: (tyre(t, y),)
    )


def stick_slip() -> tuple[Model, Motion]:
    """A body on a spring and a belt whose friction falls with the speed of sliding."""
    model = machine(
        [rail("Rail", 1.0)],
        {"Rail": "-100*Rail.slide - 8*tanh(slip/0.01)/(1 + (slip/0.3)^2)"},
        [Signal("slip", parse("Rail.slideRate - 0.3"))],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        slip = y[1] - 0.3
        return [y[1], -100.0 * y[0] - 8.0 * np.tanh(slip / 0.01) / (1.0 + (slip / 0.3) ** 2)]

    return model, Motion((0.0, 0.0), rates, slides((0, 1)), lambda t, ys: {"slip": ys[:, 1] - 0.3})


def gantry() -> tuple[Model, Motion]:
    """A trolley with a hanging load, by state feedback through a drive with a lag."""
    trolley = body("Trolley", 3.0, (0.1,) * 3)
    bob = body("Bob", 1.0, (0.05,) * 3, (0.0, -1.0, 0.0))
    rail = Joint("Rail", "prismatic", EARTH, "Trolley", ZERO, ZERO, ALONG_X, ALONG_X)
    hinge = Joint("Hinge", "revolute", "Trolley", "Bob", ZERO, (0.0, 1.0, 0.0))
    wanted = "30*(1 - Rail.slide) - 20*Rail.slideRate + 40*Hinge.angle + 5*Hinge.angleRate"
    model = machine(
        [(trolley, rail), (bob, hinge)],
        {"Rail": "f"},
        [state("f", f"({wanted} - f)/0.04")],
        gravity=(0.0, -G, 0.0),
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        x, v, a, w, f = y
        matrix = ((4.0, np.cos(a)), (np.cos(a), 1.05))
        right = (f + w * w * np.sin(a), -G * np.sin(a))
        x2, a2 = np.linalg.solve(matrix, right)
        wanted = 30.0 * (1.0 - x) - 20.0 * v + 40.0 * a + 5.0 * w
        return [v, x2, w, a2, (wanted - f) / 0.04]

    def bodies(ys: Array) -> Array:
        x, v, a, w, _ = ys.T
        states = np.zeros((len(ys), 2, 4, 3))
        states[:, 0, 0, 0], states[:, 0, 2, 0] = x, v
        states[:, 1, 0, :2] = np.transpose([x + np.sin(a), -np.cos(a)])
        states[:, 1, 2, :2] = np.transpose([v + w * np.cos(a), w * np.sin(a)])
        states[:, 1, 1, 2], states[:, 1, 3, 2] = a, w
        return states

    return model, Motion((0.0,) * 5, rates, bodies, columns(f=4))


def switching_pendulum() -> tuple[Model, Motion]:
    """A pendulum that is caught, beyond an angle, by a spring which is loaded already."""
    rate = 3.0
    bob = body("Bob", 1.0, (0.05,) * 3, (0.0, -0.5, 0.0),
               velocity=(0.5 * rate, 0.0, 0.0), angular_velocity=(0.0, 0.0, rate))  # fmt: skip
    hinge = Joint("Hinge", "revolute", EARTH, "Bob", ZERO, (0.0, 0.5, 0.0))
    model = machine(
        [(bob, hinge)],
        {"Hinge": "where(Hinge.angle > 0.2, -40*(Hinge.angle - 0.1), 0)"},
        gravity=(0.0, -G, 0.0),
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        spring = -40.0 * (y[0] - 0.1) if side[0] > 0.0 else 0.0
        return [y[1], (spring - 0.5 * G * np.sin(y[0])) / (0.05 + 0.25)]

    def bodies(ys: Array) -> Array:
        states, (a, w) = rotates((0, 1))(ys), ys.T
        states[:, 0, 0, :2] = 0.5 * np.transpose([np.sin(a), -np.cos(a)])
        states[:, 0, 2, :2] = 0.5 * np.transpose([w * np.cos(a), w * np.sin(a)])
        return states

    return model, Motion((0.0, rate), rates, bodies, switches=lambda t, y: (y[0] - 0.2,))


def motor_map() -> tuple[Model, Motion]:
    """A wheel whose torque is a table over angle and speed, linear between its entries."""
    x, y = np.linspace(-2.0, 2.0, 5), np.linspace(-8.0, 8.0, 5)
    values = -3.0 * np.sin(0.7 * x)[:, None] - 0.4 * np.tanh(y / 3.0)
    grid = Surface("linear", tuple(x), tuple(y), tuple(map(tuple, values)))
    model = machine(
        [axle("Axle", 0.1, 7.0)],
        {"Axle": "torque(Axle.angle, Axle.angleRate)"},
        [SignalTable("torque", grid)],
    )

    def rates(t: float, q: Array, side: Sides, piece: int) -> list[float]:
        i = sum(s > 0.0 for s in side[:3])
        j = sum(s > 0.0 for s in side[3:])
        u, v = (q[0] - x[i]) / (x[1] - x[0]), (q[1] - y[j]) / (y[1] - y[0])
        corner = values[i : i + 2, j : j + 2]
        return [q[1], float((1.0 - u, u) @ corner @ (1.0 - v, v)) / 0.1]

    return model, Motion(
        (0.0, 7.0),
        rates,
        rotates((0, 1)),
        switches=lambda t, q: (*(q[0] - x[1:-1]), *(q[1] - y[1:-1])),
    )


def relief_valve() -> tuple[Model, Motion]:
    """A hydraulic cylinder whose pressure, a state, opens a valve."""
    model = machine(
        [rail("Piston", 200.0)],
        {"Piston": "0.002*p - 300*Piston.slideRate - 60000*Piston.slide"},
        [state("p", "1e12*(2e-4 - 0.002*Piston.slideRate - 1e-10*max(0, p - 1e6))")],
    )

    def rates(t: float, y: Array, side: Sides, piece: int) -> list[float]:
        s, v, p = y
        valve = 1e-10 * (p - 1e6) if side[0] > 0.0 else 0.0
        force = 0.002 * p - 300.0 * v - 60000.0 * s
        return [v, force / 200.0, 1e12 * (2e-4 - 0.002 * v - valve)]

    return model, Motion(
        (0.0,) * 3, rates, slides((0, 1)), columns(p=2), lambda t, y: (y[2] / 1e6 - 1.0,)
    )


Build = Callable[[], tuple[Model, Motion]]


def scene(name: str, kind: str, build: Build, t_final: float, outputs: int) -> Case:
    """Return a model of the table, whose reference is the motion by hand."""
    return Case(name, kind, lambda: build()[0], t_final, outputs, lambda: build()[1])


SCENES = (
    scene("table spike", "known times", table_spike, 1.0, 20),
    scene("square-wave motor", "known times", square_wave_motor, 1.5, 30),
    scene("held controller", "known times", held_controller, 2.0, 30),
    scene("ramped speed", "known times", ramped_speed, 2.0, 40),
    scene("clamped controller", "kink", clamped_controller, 2.0, 40),
    scene("stiff lag", "state", stiff_lag, 1.0, 50),
    scene("van der Pol drive", "state", van_der_pol_drive, 3.0, 60),
    scene("screw press", "kink", screw_press, 1.0, 50),
    scene("dead zone", "kink", dead_zone, 2.0, 50),
    scene("tyre on ground", "kink", tyre_on_ground, 1.0, 50),
    scene("stick-slip", "stiff", stick_slip, 2.0, 50),
    scene("gantry", "state", gantry, 3.0, 40),
    scene("switching pendulum", "kink", switching_pendulum, 2.0, 50),
    scene("motor map", "kink", motor_map, 2.0, 50),
    scene("relief valve", "state", relief_valve, 0.5, 50),
)

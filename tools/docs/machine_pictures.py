"""Draw the pictures of docs/machines.md from the tables of the runs of decks/machines.

    python -m tools.docs.pictures

draws them with those of all other pages.
"""

import io
from collections.abc import Callable, Mapping
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

IMAGES = Path(__file__).parents[2] / "docs" / "img"
SIZE, DPI = (7.2, 2.4), 100
COLOURS = 48
"""Colours of a file; fewer make it smaller."""

Tables = Mapping[str, pd.DataFrame]
"""Tables of a run by their name, with the column ``time``."""
Panel = Callable[[Axes, Tables], None]


def lines(axes: Axes, table: pd.DataFrame, columns: Mapping[str, str], unit: str) -> None:
    """Draw columns against time, each with its label."""
    for column, label in columns.items():
        axes.plot(table["time"], table[column], lw=1.0, label=label)
    axes.set_ylabel(unit)
    axes.legend(frameon=False)


def robot_errors(axes: Axes, tables: Tables) -> None:
    """Draw the errors of the joints, in a logarithmic scale."""
    signals = tables["signals"]
    for i in range(1, 7):
        axes.semilogy(signals["time"], signals[f"error{i}"].abs(), lw=0.9, label=f"J{i}")
    axes.set_ylim(1e-7, 2.0)
    axes.set_ylabel("error of angle [rad]")
    axes.legend(frameon=False, ncols=3)


def robot_torques(axes: Axes, tables: Tables) -> None:
    """Draw the torques of the motors."""
    lines(axes, tables["signals"], {f"torque{i}": f"J{i}" for i in range(1, 7)}, "torque [N m]")
    axes.set_ylim(top=22.0)  # with space for the legend
    axes.legend(frameon=False, ncols=3, loc="upper right")


def engine_speed(axes: Axes, tables: Tables) -> None:
    """Draw the speed of the crank."""
    lines(axes, tables["joints"], {"Main bearing.angleRate": "crank"}, "speed [rad/s]")


def engine_work(axes: Axes, tables: Tables) -> None:
    """Draw the work of the gas and of the load."""
    lines(axes, tables["work"], {"Gas.work": "gas", "Load.work": "load"}, "work [J]")


def car_heights(axes: Axes, tables: Tables) -> None:
    """Draw road, wheel and body against time."""
    joints, signals = tables["joints"], tables["signals"]
    axes.plot(signals["time"], 1e3 * signals["road"], lw=0.8, color="0.5", label="road")
    axes.plot(joints["time"], 1e3 * joints["Axle.slide"], lw=0.8, label="wheel")
    body = joints["Axle.slide"] + joints["Strut.slide"]
    axes.plot(joints["time"], 1e3 * body, lw=1.4, label="body")
    axes.set_ylabel("height [mm]")
    axes.legend(frameon=False)


def car_damper(axes: Axes, tables: Tables) -> None:
    """Draw the force of the damper over its rate."""
    signals = tables["signals"]
    axes.plot(signals["rate"], signals["damper"], ".", ms=2)
    axes.set_xlabel("rate of extension [m/s]")
    axes.set_ylabel("tension of damper [N]")


def satellite_orientation(axes: Axes, tables: Tables) -> None:
    """Draw the vector part of the quaternion."""
    names = {f"Sensor.q{i}": f"q{i}" for i in range(4)}
    lines(axes, tables["markers"], names, "quaternion")


def satellite_wheels(axes: Axes, tables: Tables) -> None:
    """Draw the speeds of the wheels."""
    names = {f"Axle {x}.angleRate": f"wheel {x}" for x in "XYZ"}
    lines(axes, tables["joints"], names, "speed [rad/s]")


def cart_angle(axes: Axes, tables: Tables) -> None:
    """Draw angle and displacement."""
    joints = tables["joints"]
    axes.plot(joints["time"], np.degrees(joints["Hinge.angle"]), lw=1.0, label="pole [deg]")
    axes.plot(joints["time"], 100.0 * joints["Slide.slide"], lw=1.0, label="cart [cm]")
    axes.legend(frameon=False)


def cart_force(axes: Axes, tables: Tables) -> None:
    """Draw the force on the cart."""
    lines(axes, tables["signals"], {"feedback": "motor"}, "force [N]")


def motor_current(axes: Axes, tables: Tables) -> None:
    """Draw the current."""
    lines(axes, tables["signals"], {"current": "current"}, "current [A]")


def motor_speed(axes: Axes, tables: Tables) -> None:
    """Draw the speed of the crank."""
    lines(axes, tables["joints"], {"Shaft.angleRate": "crank"}, "speed [rad/s]")


PANELS: Mapping[str, tuple[Panel, Panel]] = {
    "robot": (robot_errors, robot_torques),
    "engine": (engine_speed, engine_work),
    "quarter_car": (car_heights, car_damper),
    "satellite": (satellite_orientation, satellite_wheels),
    "cart_pole": (cart_angle, cart_force),
    "motor_four_bar": (motor_current, motor_speed),
}
"""The two panels of the picture of each machine."""


def draw_machine(name: str, results: Path) -> None:
    """Write docs/img/machine_NAME.png from the tables in the folder ``results``."""
    tables = {path.stem: pd.read_csv(path) for path in results.glob("*.csv")}
    with mpl.rc_context({"font.size": 7, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="tight")
        for axes, panel in zip(figure.subplots(1, 2), PANELS[name], strict=True):
            panel(axes, tables)
            if not axes.get_xlabel():
                axes.set_xlabel("time [s]")
        raw = io.BytesIO()
        figure.savefig(raw, format="png")
    image = Image.open(raw).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    IMAGES.mkdir(parents=True, exist_ok=True)
    image.save(IMAGES / f"machine_{name}.png", format="PNG", optimize=True)

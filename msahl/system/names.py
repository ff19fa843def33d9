"""Names of what the flat arrays hold: CSV columns, and rows of the equations for messages."""

from msahl.model import Model

STATE_COLUMNS = ("x", "y", "z", "P1", "P2", "P3", "vx", "vy", "vz", "wx", "wy", "wz")
FORCE_COLUMNS = ("Fx", "Fy", "Fz")


def state_columns(model: Model) -> list[str]:
    """Header of ``states.csv``."""
    return ["time", *(f"{body.name}.{c}" for body in model.bodies for c in STATE_COLUMNS)]


def reaction_columns(model: Model) -> list[str]:
    """Header of ``reactions.csv``."""
    return ["time", *(f"{joint.name}.{c}" for joint in model.joints for c in FORCE_COLUMNS)]


def work_columns(model: Model) -> list[str]:
    """Header of ``work.csv``: work of each load since t = 0 [J]."""
    return ["time", *(f"{load.name}.work" for load in model.loads)]


def describe_row(model: Model, index: int) -> str:
    """Row ``index`` of the flat equations in words."""
    node, axis = index // 3, "xyz"[index % 3]
    joint = node - 2 * (len(model.bodies) + 1)
    if joint >= 0:
        return f"joint '{model.joints[joint].name}', gap along {axis}"
    kind = "moment about" if node % 2 else "force along"
    return f"body '{model.bodies[node // 2].name}', {kind} {axis}"

"""The keywords of ``Model.run``, for editors and type checkers; see ``msahl.run.options``."""

from typing import TypedDict


class RunOptions(TypedDict, total=False):
    """The options of ``msahl run``, each with its unit; None leaves the deck's, else the default.

    ``stop_when`` is a condition at which the run ends, such as ``"Crank.angle > 2*pi"``. All others
    are the rows of ``msahl.run.options.OPTIONS``.
    """

    dt: float | None  # [s]
    t_final: float | None  # [s]
    scheme: str | None
    damping: float | None
    rotation_update: str | None
    solver: str | None
    tolerance: float | None  # [m]
    local_tolerance: float | None  # [m]
    output_interval: float | None  # [s]
    every: int | None
    reactions: str | None
    accelerations: str | None
    joint_table: str | None
    error: str | None
    accuracy: float | None  # [m]
    full: bool | None
    stop_when: str | None

"""What a user chooses of an import, beside the file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

BASES = ("fixed", "free")
ALL, LIMITS, NONE = CONTACTS = ("all", "limits", "none")
"""Contacts that an import makes."""


@dataclass(frozen=True)
class ImportOptions:
    """``base`` of a URDF: its roots are fixed to the ground or free. ``keep_fixed`` makes a body of
    each link that is fixed to another, if it has mass. ``repair`` puts the nearest possible inertia
    in place of an impossible one. ``pose`` has values of joints at t = 0 [rad, m] by name,
    ``rates`` their rates [rad/s, m/s], ``key`` is the name of a keyframe of MJCF. ``packages`` are
    folders in which meshes, packages and included files may lie, beside that of the file;
    ``copy_meshes`` takes those that are not below the folder of the deck. ``friction_width`` are
    the rates [rad/s], [m/s] at which dry friction has risen to three quarters of its limit.
    ``contacts`` are those that are made: stops of joints and shapes on planes, the ``limits`` of
    joints alone, or none; ``restitution`` is that of their impacts, 0 to 1.
    """

    base: str = "fixed"
    keep_fixed: bool = False
    repair: bool = False
    pose: Mapping[str, float] = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    key: str = ""
    packages: tuple[Path, ...] = ()
    copy_meshes: bool = False
    friction_width: tuple[float, float] = (1e-2, 1e-3)
    contacts: str = ALL
    restitution: float = 0.0

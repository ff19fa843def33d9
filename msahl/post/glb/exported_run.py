"""Read the motion of a run and write it as a GLB file, thinned."""

from pathlib import Path
from typing import NamedTuple

from msahl.post.glb.animation import choose_keys
from msahl.post.glb.gltf import write_glb
from msahl.post.scene import scene_of_run
from msahl.post.view.poses import poses_of_run
from msahl.results.sample import read_sample

READ_NUMBERS = 6_000_000
"""Numbers that are read from the tables of a run; of a longer run evenly spaced rows are."""
READ_ROWS = 1 << 16


class Exported(NamedTuple):
    """A GLB file and how exactly it shows the run: errors of positions [m] and orientations [rad]
    at the output times, largest over the bodies."""

    data: bytes
    total: int  # output times of the run
    read: int  # of which were read
    keys: int  # key poses of the body that has most
    position: float
    orientation: float
    notes: tuple[str, ...]  # files of meshes that are missing


def export_run(folder: Path) -> Exported:
    """Return the run in ``folder`` as a GLB file."""
    sample = read_sample(folder, READ_NUMBERS, READ_ROWS)
    scene = scene_of_run(sample)
    poses = poses_of_run(sample)
    size = max(2.0 * poses.reach, float(scene["size"]))
    keys = [choose_keys(poses.time, poses.values[:, b], size) for b in range(len(scene["bodies"]))]
    return Exported(
        data=write_glb(scene, poses.time, poses.values, keys),
        total=sample.total,
        read=len(poses.time),
        keys=max(len(key.rows) for key in keys),
        position=max(key.position for key in keys),
        orientation=max(key.orientation for key in keys),
        notes=tuple(scene["notes"]),
    )

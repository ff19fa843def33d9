"""The modules of the other programs, those of them that are installed."""

from benchmarks.peers import import_peers

PEERS, MISSING = import_peers(
    {
        "exudyn": "benchmarks.mechanisms.exudyn_models",
        "mujoco": "benchmarks.mechanisms.mujoco_models",
        "pydrake": "benchmarks.mechanisms.drake_models",
    }
)

"""The modules of the other programs, those of them that are installed."""

from benchmarks.peers import import_peers

PEERS, MISSING = import_peers(
    {
        "exudyn": "benchmarks.contact.exudyn_models",
        "mujoco": "benchmarks.contact.mujoco_models",
        "pydrake": "benchmarks.contact.drake_models",
    }
)

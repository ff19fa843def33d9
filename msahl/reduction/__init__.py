"""Reduction of elastic bodies: matrices of finite elements become few modes in a floating frame.

file -> elastic model (nodes, mass, stiffness) -> Craig-Bampton basis -> modes of a floating frame
-> body with its inertia invariants and the error of the reduction
"""

from msahl.reduction.body import ReducedBody, read_body
from msahl.reduction.elastic_model import ElasticModel, build_model
from msahl.reduction.faults import ReductionError
from msahl.reduction.read import Files, read_model
from msahl.reduction.reduce import Wishes, reduce_file, reduce_model

__all__ = [
    "ElasticModel",
    "Files",
    "ReducedBody",
    "ReductionError",
    "Wishes",
    "build_model",
    "read_body",
    "read_model",
    "reduce_file",
    "reduce_model",
]

"""Models without beams run kernels that contain no code for beams."""

from dataclasses import replace

import pytest

from msahl.jit import compiled
from msahl.jit.files import Files
from msahl.jit.object_file import name_of, types_of
from msahl.jit.worker import translate
from msahl.model.scheme import split
from msahl.run.subsystem import SubsystemIntegrator
from tests.support.beams import ELASTIC, cantilever
from tests.support.models import deck

pytestmark = pytest.mark.skipif(compiled.DISABLED, reason="nothing is compiled")


OTHERS = ("_factor_by_pivots.given", "_factor_by_blocks.given")


def functions(model, scheme):
    """Modules and names of all functions that are compiled for the steps of a model."""
    name, degree = split(scheme)
    simulation = replace(model.simulation, scheme=name, degree=degree or model.simulation.degree)
    model = replace(model, simulation=simulation)
    calls = SubsystemIntegrator(model, "newton", True, 10).stepper.calls
    files = Files(compiled.STORE)
    units = [kernel.unit(arguments) for kernel, arguments in calls]
    found, todo = set(), [(name_of(unit), types_of(unit)) for unit in units]
    while todo:
        name, types = todo.pop()
        if name not in found:
            found.add(name)
            code = files.find_code(name) or translate(name[0], name[1], types)
            todo += zip(code.calls, code.types, strict=True)
    return {(module, function) for module, function, _ in found}


def of_beams(names):
    """Those of beams and of their elimination; a function of a group that a model may not have does
    nothing if it is not ``given``.
    """
    return {
        (module, function)
        for module, function in names
        if ".supernod" in module or (".elements.beams" in module and function.endswith(".given"))
    }


@pytest.mark.parametrize("scheme", ["preserving", pytest.param("gauss2", marks=pytest.mark.slow)])
def test_models_without_beams_have_no_code_of_beams(scheme):
    models = deck("triple_pendulum_135"), cantilever(1, 2, ELASTIC)
    without, with_beams = (functions(model, scheme) for model in models)
    assert not of_beams(without)
    assert len(of_beams(with_beams)) > 10
    # And beams need none of the other elimination.
    assert not [name for _, name in with_beams if name in OTHERS]

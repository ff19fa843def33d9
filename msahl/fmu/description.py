"""The file modelDescription.xml of an FMU: its variables, and what it can do.

FMI 2.0: Functional Mock-up Interface 2.0.4, section 2.2; FMI 3.0: version 3.0.2, section 2.4.
"""

import math
from collections.abc import Sequence

from lxml.etree import Element, SubElement, _Element, tostring

from msahl.api.variables import INPUT, OUTPUT, PARAMETER, TUNABLE, Variable
from msahl.records import record
from msahl.version import VERSION

CATEGORIES = {"logStatusError": "What is wrong.", "logAll": "All messages."}
KINDS = {
    PARAMETER: ("parameter", "fixed"),
    TUNABLE: ("parameter", "tunable"),
    INPUT: ("input", "continuous"),
    OUTPUT: ("output", "continuous"),
}
"""Causality and variability of the kinds of variables."""
FIRST = 1
"""Value reference of the first variable; that of the time is 0."""


@record
class Description:
    """What an FMU says of itself: an ``identifier``, which is a name in C, and a ``token``, which
    differs between FMUs; the run ends at ``t_final`` [s], and has results each ``interval`` [s].
    """

    identifier: str
    title: str
    token: str
    t_final: float
    interval: float
    variables: Sequence[Variable]


def description_2(given: Description) -> bytes:
    """Return the description for FMI 2.0."""
    root = _root(given, "2.0", guid=given.token)
    abilities = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
    abilities["canNotUseMemoryManagementFunctions"] = "true"
    SubElement(root, "CoSimulation", _abilities(given) | abilities)
    _head(root, given)
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(given.variables, FIRST):
        attributes, real = _attributes(variable, reference), dict[str, str]()
        for name in ("unit", "start"):
            if name in attributes:
                real[name] = attributes.pop(name)
        SubElement(SubElement(variables, "ScalarVariable", attributes), "Real", real)
    structure = SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        places = SubElement(structure, group)
        for index, variable in enumerate(given.variables, 1):
            if variable.kind == OUTPUT:
                SubElement(places, "Unknown", {"index": str(index)})
    return _text(root)


def description_3(given: Description) -> bytes:
    """Return the description for FMI 3.0."""
    root = _root(given, "3.0", instantiationToken=given.token)
    abilities = {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true"}
    SubElement(root, "CoSimulation", _abilities(given) | abilities)
    _head(root, given)
    variables = SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent"}
    SubElement(variables, "Float64", {**time, "variability": "continuous", "unit": "s"})
    for reference, variable in enumerate(given.variables, FIRST):
        SubElement(variables, "Float64", _attributes(variable, reference))
    structure = SubElement(root, "ModelStructure")
    for tag in ("Output", "InitialUnknown"):
        for reference, variable in enumerate(given.variables, FIRST):
            if variable.kind == OUTPUT:
                SubElement(structure, tag, {"valueReference": str(reference)})
    return _text(root)


def _root(given: Description, version: str, **token: str) -> _Element:
    return Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": given.identifier,
            **token,
            "description": given.title,
            "generationTool": f"msahl {VERSION}",
            "variableNamingConvention": "flat",
        },
    )


def _abilities(given: Description) -> dict[str, str]:
    return {
        "modelIdentifier": given.identifier,
        "needsExecutionTool": "true",  # a Python with msahl
        "canHandleVariableCommunicationStepSize": "true",
    }


def _head(root: _Element, given: Description) -> None:
    """Add what both versions have before the variables."""
    units = SubElement(root, "UnitDefinitions")
    for unit in sorted({"s", *(one.unit for one in given.variables if one.unit)}):
        SubElement(units, "Unit", {"name": unit})
    categories = SubElement(root, "LogCategories")
    for name, words in CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": words})
    times = {"startTime": 0.0, "stopTime": given.t_final, "stepSize": given.interval}
    SubElement(root, "DefaultExperiment", {name: repr(t) for name, t in times.items()})


def _attributes(variable: Variable, reference: int) -> dict[str, str]:
    """Return the attributes of a variable; outputs have no start."""
    causality, variability = KINDS[variable.kind]
    found = {"name": variable.name, "valueReference": str(reference), "causality": causality}
    found["variability"] = variability
    if variable.table:
        found["description"] = f"column of {variable.table}.csv"
    if variable.unit:
        found["unit"] = variable.unit
    if variable.kind != OUTPUT:
        found["start"] = repr(variable.start)
    return found


def is_known(variable: Variable) -> bool:
    """Return whether a description can have the variable: its start must be a number."""
    return math.isfinite(variable.start)


def _text(root: _Element) -> bytes:
    return tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)

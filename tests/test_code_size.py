"""Functions have at most 50 lines and 7 parameters, except for kernels that are listed here."""

import ast

from tests.test_import_order import sources

MOST_LINES, MOST_PARAMETERS = 50, 7

KERNELS_OF_MANY_PARAMETERS = {
    "msahl.algebra.functions._part",
    "msahl.algebra.functions._stretch",
    "msahl.elements.constraints.products._owner_stiffness",
    "msahl.elements.constraints.products.stiffness",
    "msahl.elements.constraints.surfaces._row",
    "msahl.elements.constraints.surfaces.stiffness",
    "msahl.elements.constraints.scalar.accept",
    "msahl.elements.constraints.scalar.residual",
    "msahl.ports.compliance._add_blocks",
    "msahl.ports.compliance.add_derivatives",
    "msahl.ports.compliance.add_stage_derivatives",
    "msahl.ports.compliance.mean_residual",
    "msahl.ports.compliance.set_loads",
    "msahl.ports.coordinate.add_derivative",
    "msahl.ports.coordinate.add_derivatives",
    "msahl.ports.coordinate.mean_jacobian",
    "msahl.ports.rubbing.add_derivatives",
    "msahl.ports.rubbing.mean_jacobian",
    "msahl.elements.beams.plane.push_loads",
    "msahl.elements.beams.plane_midpoint._set_equation",
    "msahl.elements.beams.plane_stage._add_force_derivatives",
    "msahl.elements.beams.plane_stage.add_elastic_derivatives",
    "msahl.elements.beams.plane_stage.set_elastic_equations",
    "msahl.elements.beams.plane_stiffness.add_loads",
    "msahl.formulations.absolute.frames.prepare",
    "msahl.elements.reactions.sum_reactions",
    "msahl.formulations.absolute.rigid_body.jacobian",
    "msahl.formulations.absolute.rigid_body.residual",
    "msahl.post.replay._observe_rows",
    "msahl.study.dynamics._open",
}
"""Kernels with more parameters: groups, their workspaces and the arrays of one evaluation. A record
of them would have to be made anew in every call, for other groups each time. An entry that is no
longer needed fails."""


def functions():
    """Every function of the package: its name with module and class, and its syntax tree."""
    for module, tree in sources().items():
        yield from named(module, tree)


def named(prefix, tree):
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            name = f"{prefix}.{node.name}"
            if not isinstance(node, ast.ClassDef):
                yield name, node
            yield from named(name, node)
        elif not isinstance(node, ast.expr):
            yield from named(prefix, node)


def line_count(function):
    return function.end_lineno - function.lineno + 1


def parameter_count(function):
    """The number of parameters without self."""
    given = function.args
    names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    rest = sum(a is not None for a in (given.vararg, given.kwarg))
    return len(names) - (names[:1] in (["self"], ["cls"])) + rest


def test_functions_have_at_most_50_lines():
    long = {name for name, function in functions() if line_count(function) > MOST_LINES}
    assert not long


def is_kernel(function):
    """Whether a function is marked for the compiler."""
    marks = (ast.unparse(mark).split("(")[0] for mark in function.decorator_list)
    return any(mark in ("kernel", "apart", "optional") for mark in marks)


def test_functions_have_at_most_7_parameters():
    many = {name: f for name, f in functions() if parameter_count(f) > MOST_PARAMETERS}
    assert {name for name, f in many.items() if is_kernel(f)} == KERNELS_OF_MANY_PARAMETERS
    assert not {name for name, f in many.items() if not is_kernel(f)}

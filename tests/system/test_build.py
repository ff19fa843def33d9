"""The system of a model: topology apart from parameters."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.formulations.absolute.frames import first_multiplier, ground_of
from msahl.system.build import build_system, rebuild_parameters
from msahl.system.collect import collect
from msahl.system.state import build_state
from msahl.system.topology import build_topology
from tests.support.element_samples import ELEMENTS


def arrays(group, name=""):
    """Every array and number of nested groups, by name."""
    if isinstance(group, tuple):
        for field, part in zip(group._fields, group, strict=True):
            yield from arrays(part, f"{name}.{field}")
    else:
        yield name, group


def same(one, other):
    """Whether two systems have the same arrays, bit for bit."""
    pairs = zip(arrays(one), arrays(other), strict=True)
    return [name for (name, a), (_, b) in pairs if not np.array_equal(a, b)]


def heavier(model):
    """The model with other numbers, its elements connected as before."""
    bodies = tuple(
        replace(body, mass=2.5 * body.mass, position=tuple(c + 0.1 for c in body.position))
        for body in model.bodies
    )
    return replace(model, bodies=bodies, gravity=(0.3, 0.0, -1.0))


@pytest.mark.parametrize("name", ELEMENTS)
@pytest.mark.parametrize("relaxed", [False, True])
def test_parameters_alone_are_those_of_a_full_build(name, relaxed):
    model = ELEMENTS[name](np.random.default_rng(5))
    topology = build_topology(collect(model), relaxed)
    other = heavier(model)
    assert same(rebuild_parameters(other, topology), build_system(other, relaxed)) == []
    assert same(rebuild_parameters(model, topology), build_system(model, relaxed)) == []
    assert ".bodies.inverse_mass" in same(build_system(model), build_system(other))


def test_a_topology_is_not_that_of_a_model_with_other_connections():
    rng = np.random.default_rng(5)
    topology = build_topology(collect(ELEMENTS["revolute"](rng)), False)
    with pytest.raises(ValueError, match="connect"):
        rebuild_parameters(ELEMENTS["prismatic"](rng), topology)


@pytest.mark.parametrize("name", ELEMENTS)
def test_the_state_at_the_start_does_not_change_the_system(name):
    model = ELEMENTS[name](np.random.default_rng(5))
    system = build_system(model)
    build_state(heavier(model), system)
    assert same(system, build_system(model)) == []


@pytest.mark.parametrize("name", ELEMENTS)
def test_every_node_has_one_owner(name):
    system = build_system(ELEMENTS[name](np.random.default_rng(5)))
    frames = system.frames
    of_frames = [*frames.displacement, *frames.rotation]
    assert sorted([*of_frames, *system.multipliers.node]) == list(
        range(first_multiplier(frames) + system.multipliers.node.size)
    )
    assert (frames.of_node[frames.rotation] == np.arange(ground_of(frames) + 1)).all()
    assert frames.rotates[frames.rotation].all()
    assert not frames.rotates[frames.displacement].any()
    assert (system.bodies.frame[frames.owner[:-1]] == np.arange(ground_of(frames))).all()

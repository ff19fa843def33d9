"""Open trees: masses, mass matrices, accelerations and falls are those of MuJoCo."""

import json
import re
from importlib.util import find_spec

import numpy as np
import pytest

import msahl
from msahl.importers import ImportOptions, import_file
from tests.importers import oracle
from tests.importers.joint_space import mass_centre, mass_matrix

NAMES = list(oracle.machines())
ROUND_OFF = 1e-12
"""Of sums over the links of products of a few rotations; 2e-15 was seen."""
FALL = 1e-9
"""RK4 of MuJoCo at 2.5e-4 s and gauss5 at 5 ms; 1e-13 was seen."""


@pytest.fixture(scope="module")
def expected():
    return json.loads(oracle.EXPECTED.read_text())


@pytest.fixture(params=NAMES)
def machine(request, expected, tmp_path):
    """The path of a machine without couplings, and MuJoCo's numbers of it."""
    path = tmp_path / request.param
    text = oracle.machines()[request.param].read_text()
    text = re.sub(r"<mimic [^>]*/>|<equality>.*?</equality>", "", text, flags=re.S)
    path.write_text(text)
    return path, expected[request.param]


def coordinate(model, name):
    kinds = {joint.name: joint.kind for joint in model.joints}
    return {"revolute": "angle", "prismatic": "slide"}[kinds[name]]


def test_mass_centre_and_mass_matrix_at_random_poses(machine):
    path, numbers = machine
    model, names = import_file(path).source.model(), numbers["names"]
    for q, centre, M in zip(numbers["poses"], numbers["centres"], numbers["matrices"], strict=True):
        values = {n: {coordinate(model, n): x} for n, x in zip(names, q, strict=True)}
        mass, at = mass_centre(model, values)
        assert mass == pytest.approx(numbers["mass"], rel=ROUND_OFF)
        assert at == pytest.approx(centre, abs=ROUND_OFF)
        assert np.abs(mass_matrix(model, values, names) - M).max() < ROUND_OFF * np.abs(M).max()


def test_accelerations_and_a_fall_of_two_seconds(machine):
    path, numbers = machine
    names = numbers["names"]
    start = ImportOptions(
        pose=dict(zip(names, numbers["q"], strict=True)),
        rates=dict(zip(names, numbers["v"], strict=True)),
        contacts="none",
    )
    model = msahl.load(import_file(path, start).source.data)
    result = model.run(scheme="gauss5", dt=5e-3, t_final=2.0, accelerations="yes", error="off")
    columns = [f"{name}.{coordinate(model.records, name)}" for name in names]
    found = np.array([result[f"{column}Acceleration"][0] for column in columns])
    wanted = np.array(numbers["accelerations"])
    assert np.abs(found - wanted).max() < ROUND_OFF * np.abs(wanted).max()
    for t, q in zip(oracle.TIMES, numbers["fall"], strict=True):
        (row,) = np.flatnonzero(np.abs(result.time - t) < 1e-9)
        assert [result[column][row] for column in columns] == pytest.approx(q, abs=FALL)


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs mujoco, which has the numbers")
@pytest.mark.parametrize("name", NAMES)
def test_the_stored_numbers_are_those_of_mujoco(name, expected):
    found = oracle.reference(oracle.machines()[name])
    assert found["names"] == expected[name]["names"]
    for key in ("mass", "centres", "matrices", "accelerations", "fall"):
        # Another version may sum in another order; a fall amplifies that.
        assert np.allclose(found[key], expected[name][key], rtol=1e-9, atol=1e-9)

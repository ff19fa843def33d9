"""Forces of MJCF: every kind of them accelerates bodies as in MuJoCo."""

import json
from importlib.util import find_spec

import numpy as np
import pytest

import msahl
from msahl.importers import ImportOptions, import_file
from tests.importers import forces

ROUND_OFF = 1e-12
"""Of sums over a few bodies and forces; 2e-14 of the largest was seen."""
BY_DIFFERENCES = {"shells": 1e-10}
"""Of that of an ellipsoid, the difference of two solids of sizes 1e-6 m apart; 2e-12 was seen."""
COLUMNS = ("ax", "ay", "az", "alphax", "alphay", "alphaz")
NAMES = list(forces.MODELS)


@pytest.fixture(scope="module")
def expected():
    return json.loads(forces.EXPECTED.read_text())


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_at_a_random_state(name, expected, tmp_path):
    numbers = expected[name]
    given = " ".join(
        f'{key}="{" ".join(map(repr, numbers[key]))}"'
        for key in ("qpos", "qvel", "ctrl", "act")
        if numbers[key]
    )
    key = f'<keyframe><key name="k" {given}/></keyframe></mujoco>'
    path = tmp_path / "model.xml"
    path.write_text(forces.MODELS[name].replace("</mujoco>", key))
    model = msahl.load(import_file(path, ImportOptions(key="k", contacts="none")).source.data)
    result = model.run(scheme="gauss2", dt=1e-4, t_final=1e-4, accelerations="yes", error="off")
    largest = np.abs(list(numbers["accelerations"].values())).max()
    tolerance = BY_DIFFERENCES.get(name, ROUND_OFF) * largest
    for body, wanted in numbers["accelerations"].items():
        found = [result[f"{body}.{column}"][0] for column in COLUMNS]
        assert found == pytest.approx(wanted, abs=tolerance)


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs mujoco, which has the numbers")
@pytest.mark.parametrize("name", NAMES)
def test_the_stored_numbers_are_those_of_mujoco(name, expected):
    found = forces.reference(forces.MODELS[name])
    for body, wanted in expected[name]["accelerations"].items():
        # Another version may sum in another order, and draws its state by its own quaternions.
        assert found["accelerations"][body] == pytest.approx(wanted, rel=1e-9, abs=1e-9)

"""Wrong arguments of every public function raise exceptions of msahl, never those of its inside."""

import math

import numpy as np
import pytest

import msahl
from tests.support.models import ROOT

DECKS = ROOT / "decks"
OURS = (
    msahl.BatchError, msahl.DeckError, msahl.GradientError, msahl.InverseError, msahl.ModelError,
    msahl.OptionError, msahl.ResultError, msahl.StartError,
)  # fmt: skip
ROD = DECKS / "basics" / "parameters.xml"
BRIEF = {"dt": 0.1, "t_final": 0.2, "error": "off"}
MEASURE = "Rod.x final"
HUGE = 10**400
NO_NUMBERS = ("x", "", "\0", b"x", [], {}, object(), [math.nan], np.array([1.0, 2.0]))
NOT_FINITE = (math.nan, math.inf, -math.inf, HUGE)
NO_TEXTS = (None, 3, 1.5, [1], {"x": 1}, b"x", object(), np.array([1.0, 2.0]))
NO_VECTORS = (None, 3, "x", [], [1], [1, 2, "x"], [math.nan] * 3, [HUGE] * 3, {}, object())
NO_PATHS = (None, 3, 1.5, [], {}, object(), "\0")
NO_MOTIONS = (None, 3, b"x", [], [1], {}, {"x": 1}, object(), {"time": "x"}, {"time": [[1]]},
              {"time": [0, 1], "Hinge.angle": [1]}, {"time": [HUGE]}, "nowhere.csv")  # fmt: skip
WRONG = {
    "run dt": (*NO_NUMBERS, *NOT_FINITE, -1, 0, True),
    "run t_final": (*NO_NUMBERS, *NOT_FINITE, -1, True),
    "run output_interval": (*NO_NUMBERS, *NOT_FINITE, -1, 0),
    "run every": (*NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5),
    "run scheme": (3, "x", ["gauss1"], np.array([1.0, 2.0])),
    "run full": (3, "x", []),
    "run stop_when": ("x", "1 +", "\0", "t", ""),
    "with_ L": (None, *NO_NUMBERS, *NOT_FINITE, True),
    "with_ name": ("x", "", "\0", "a.b", "L.L"),
    "changes": (3, "x", ["x"], [1], {1: 2}, {"x": 1}),
    "gradient measures": (*NO_TEXTS, [], "", "x", "L"),
    "gradient wrt": (*NO_TEXTS, [], "", "x", ["L", "x"]),
    "gradient.of": (None, 3, "x", []),
    "inverse motion": NO_MOTIONS,
    "inverse loads": (3, [1], b"x", "x", ["x"], np.array([1.0, 2.0])),
    "inverse weights": (
        3,
        "x",
        [1],
        {"x": 1},
        {"Hinge.angle": "x"},
        {"Hinge.angle": math.nan},
        {"Hinge.angle": -1.0},
        {1: 1},
    ),
    "inverse columns": (None, 3, "x", ["x"], {1: "x"}, {"x": 1}, {"x": "y"}, {"time": ""}),
    "inverse smooth": (*NO_NUMBERS, *NOT_FINITE, -1),
    "kinematics every": (None, *NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5, True),
    "kinematics step": (*NO_NUMBERS, *NOT_FINITE, -1, 0),
    "equilibrium rotation": NO_VECTORS,
    "equilibria starts": (None, *NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5),
    "equilibria rotation": NO_VECTORS,
    "linearize inputs": (*NO_TEXTS, "x", ["x"]),
    "linearize outputs": (*NO_TEXTS, "x", ["x"]),
    "linearize at": (None, *NO_NUMBERS, *NOT_FINITE, -1),
    "linearize states": (None, 3, "x", []),
    "modes at": (None, *NO_NUMBERS, *NOT_FINITE, -1),
    "modes number": (*NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5),
    "modes near": (None, *NO_NUMBERS, *NOT_FINITE, -1),
    "modes method": (None, 3, "x", []),
    "modes_over name": (None, 3, "x", "", [], b"x"),
    "modes_over values": (None, 3, "x", [], ["x"], [math.nan], [HUGE], {}),
    "modes_over orders": (None, 3, "x", ["x"], [math.nan]),
    "modes.shape": (None, *NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5),
    "result[]": (None, 3, "x", "", (1,)),
    "result.array": (None, 3, "x", []),
    "result.frame": (None, 3, "x", []),
    "result.columns": (None, 3, "x", []),
    "equilibrium[]": (None, 3, "x", (1,)),
    "equilibrium.frame": (None, 3, "x", []),
    "read": ("nowhere", "x" * 300, *NO_PATHS),
    "load": ("nowhere.xml", "<data>", b"\0", "x" * 300, *NO_PATHS),
    "load L": (None, *NO_NUMBERS, *NOT_FINITE, True),
    "model.write": NO_PATHS,
    "result.write": NO_PATHS,
    "result.plot": (None, 3, "x", [], b"x"),
    "plot.save": NO_PATHS,
    "plot.save form": (None, 3, "x", []),
    "modes.write": NO_PATHS,
    "modes.page": NO_PATHS,
    "modes_over.write": NO_PATHS,
    "linearize.save": NO_PATHS,
    "kinematics t_final": (*NO_NUMBERS, *NOT_FINITE, -1, 0),
    "inverse companion": NO_MOTIONS[1:],
    "batch model": (None, 3, "x", []),
    "batch samples": (None, 3, "x", b"x", {"L": 1}, [3], ["x"], [{1: 2}], [{"x": 1}], [{"L": "x"}]),
    "batch jobs": (*NO_NUMBERS, *NOT_FINITE, -1, 0, 1.5, True),
    "batch tables": (3, "x", ["x"], [1]),
    "batch errors": (None, 3, "x", []),
}
"""Arguments with values that they must not have."""


@pytest.fixture(scope="module")
def calls():
    """Each argument's call, by the names of ``WRONG``."""
    rod = msahl.load(ROD)
    crank = msahl.load(DECKS / "mechanisms" / "slider_crank.xml")
    result = rod.run(dt=0.05, t_final=0.5, error="off")
    modes, rest = rod.modes(), rod.equilibrium()
    slopes = rod.gradient(MEASURE, "L", **BRIEF)
    over, linear, angle = rod.modes_over("L", [60, 70]), rod.linearize(), ["Hinge.angle"]

    def batch(model=rod, samples=({},), **more):
        return list(msahl.batch(model, samples, **{"jobs": 1, **BRIEF, **more}))

    return {
        **{
            f"run {name}": lambda v, name=name: rod.run(**{**BRIEF, name: v})
            for name in ("dt", "t_final", "output_interval", "every", "scheme", "full", "stop_when")
        },
        "with_ L": lambda v: rod.with_(L=v),
        "with_ name": lambda v: rod.with_(**{v: 1}),
        "changes": lambda v: msahl.Model(rod.records, v),
        "gradient measures": lambda v: rod.gradient(v, "L", **BRIEF),
        "gradient wrt": lambda v: rod.gradient(MEASURE, v, **BRIEF),
        "gradient.of": slopes.of,
        "inverse motion": lambda v: rod.inverse(v, angle),
        "inverse loads": lambda v: rod.inverse(result, v),
        "inverse weights": lambda v: rod.inverse(result, angle, v),
        "inverse columns": lambda v: rod.inverse({"time": [0.0, 0.1]}, angle, columns=v),
        "inverse smooth": lambda v: rod.inverse(result, angle, smooth=v),
        "kinematics every": lambda v: crank.kinematics(0.1, 0.2, v),
        "kinematics step": lambda v: crank.kinematics(v, 0.2),
        "equilibrium rotation": rod.equilibrium,
        "equilibria starts": rod.equilibria,
        "equilibria rotation": lambda v: rod.equilibria(1, v),
        "linearize inputs": rod.linearize,
        "linearize outputs": lambda v: rod.linearize((), v),
        "linearize at": lambda v: rod.linearize(at=v),
        "linearize states": lambda v: rod.linearize(states=v),
        "modes at": rod.modes,
        "modes number": lambda v: rod.modes(0.0, v),
        "modes near": lambda v: rod.modes(0.0, 1, v),
        "modes method": lambda v: rod.modes(0.0, 1, 0.0, v),
        "modes_over name": lambda v: rod.modes_over(v, [60, 70]),
        "modes_over values": lambda v: rod.modes_over("L", v),
        "modes_over orders": lambda v: rod.modes_over("L", [60, 70], orders=v),
        "modes.shape": modes.shape,
        "result[]": lambda v: result[v],
        "result.array": result.array,
        "result.frame": result.frame,
        "result.columns": result.columns,
        "equilibrium[]": lambda v: rest[v],
        "equilibrium.frame": rest.frame,
        "read": msahl.read,
        "load": msahl.load,
        "load L": lambda v: msahl.load(ROD, L=v),
        "model.write": rod.write,
        "result.write": result.write,
        "result.plot": result.plot,
        "plot.save": lambda v: result.plot("energy").save(v),
        "plot.save form": lambda v: result.plot("energy").save("folder", v),
        "modes.write": modes.write,
        "modes.page": modes.page,
        "modes_over.write": over.write,
        "linearize.save": linear.save,
        "kinematics t_final": lambda v: crank.kinematics(0.1, v),
        "inverse companion": lambda v: rod.inverse(result, angle, companion=v),
        "batch model": lambda v: batch(v),
        "batch samples": lambda v: batch(samples=v),
        "batch jobs": lambda v: batch(jobs=v),
        "batch tables": lambda v: batch(tables=v),
        "batch errors": lambda v: batch(errors=v),
    }


@pytest.mark.parametrize("argument", WRONG)
def test_wrong_arguments_raise_exceptions_of_msahl(calls, argument):
    for value in WRONG[argument]:
        with pytest.raises(OURS) as raised:  # noqa: PT012
            calls[argument](value)
            pytest.fail(f"{argument}: {value!r:.50} is accepted")
        assert 0 < len(str(raised.value)) < 2000


def test_a_column_that_there_is_not_is_a_key_error_as_well():
    result = msahl.load(DECKS / "basics" / "parameters.xml").run(**BRIEF)
    with pytest.raises(KeyError) as raised:
        result["x"]
    assert isinstance(raised.value, msahl.ResultError)
    assert str(raised.value) == "no column 'x'; columns(table) lists those of a table"

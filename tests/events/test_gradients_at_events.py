"""Derivatives of runs that end between two steps, and of those whose steps end at breakpoints."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import msahl
from msahl.analysis.gradients.run import TangentRun
from tests.support.models import ROOT

DECKS = ROOT / "decks"
G, UP, ALONG, SPIN = 9.80665, 6.0, 5.0, 3.0


def height(t):
    """Height [m] of the end of the stick of ``stop.xml`` at the time ``t``."""
    return 2.0 + UP * t - 0.5 * G * t**2 - 0.5 * np.cos(SPIN * t)


def test_the_end_between_two_steps_moves_with_the_speed():
    def rate(t):
        return UP - G * t + 0.5 * SPIN * math.sin(SPIN * t)

    top = brentq(rate, 0.4, 0.9)
    limit = float(height(top)) - 1e-5
    assert height(0.02 * np.arange(150)).max() < limit  # no step ends above it
    end = brentq(lambda t: height(t) - limit, top - 0.01, top, xtol=1e-15)
    model = msahl.load(DECKS / "basics/stop.xml")
    wanted = {"stop_when": f"End.z > {limit!r}", "error": "off", "solver": "newton"}
    found = model.gradient(["Stick.x final"], "Stick.velocity.v3", **wanted)
    assert found.values[0] == pytest.approx(ALONG * end, abs=1e-11)
    # The rate at the end is 0.01 m/s, so the slope is 1e2 times as sensitive as those elsewhere.
    assert found.jacobian[0, 0] == pytest.approx(-ALONG * end / rate(end), rel=1e-7)


GIVEN = {"X": 0.4, "T": 0.33, "F1": -1.0, "F2": -6.0, "v": 1.2, "m": 2.0}
PUSHED = """<data>
  <unitSystem>SI</unitSystem>
  <parameters>{parameters}</parameters>
  <system>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Body</name><mass>{{m}}</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions><velocity basis="Base"><v1>{{v}}</v1></velocity></initialConditions>
      </rigidBody>
    </bodies>
    <markers><marker><name>P</name><body>Body</body></marker></markers>
    <loads>
      <concentrated>
        <name>Push</name><body>Body</body><force basis="Base"><xForce>1</xForce></force>
        <law><expression>{force}</expression></law>
      </concentrated>
    </loads>
  </system>
  <simulation><title>Push</title><deltaT>0.02</deltaT><tFinal>1</tFinal></simulation>
</data>
"""


def pushed(force, tmp_path):
    parameters = "".join(f'<parameter name="{k}">{v}</parameter>' for k, v in GIVEN.items())
    path = tmp_path / "pushed.xml"
    path.write_text(PUSHED.format(parameters=parameters, force=force))
    return msahl.load(path)


def after_jump(t, x, v, m, before, beyond, at):
    """Place at the time ``t`` under one force until the time ``at``, under another from then on."""
    fast = v + before / m * at
    return (
        x + v * at + 0.5 * before / m * at**2 + fast * (t - at) + 0.5 * beyond / m * (t - at) ** 2
    )


def by_place(t, X, T, F1, F2, v, m):
    return after_jump(t, 0.0, v, m, F1, F2, m / F1 * (math.sqrt(v * v + 2.0 * F1 / m * X) - v))


def by_time(t, X, T, F1, F2, v, m):
    return after_jump(t, 0.0, v, m, F1, F2, T)


@pytest.mark.parametrize(("scheme", "wanted"), [
    ("preserving", {"error": "off"}), ("gauss2", {"error": "off"}), ("auto", {"tolerance": 1e-8}),
])  # fmt: skip
@pytest.mark.parametrize(
    ("force", "exact"),
    [("where(P.x > X, F2, F1)", by_place), ("where(t > T, F2, F1)", by_time)],
)
def test_the_time_of_a_jump_moves_with_the_parameters(force, exact, scheme, wanted, tmp_path):
    """Motions are parabolas, which all schemes have exactly. Pairs by tolerance
    have the row at 0.62 s within them."""
    names = [name for name in GIVEN if name in force or name in "vm"]
    measures = ["P.x at 0.62", "P.x final"]
    found = pushed(force, tmp_path).gradient(measures, names, scheme=scheme, **wanted)
    for i, t in enumerate((0.62, 1.0)):
        for j, name in enumerate(names):
            d = 1e-3 * abs(GIVEN[name])
            near = [exact(t, **{**GIVEN, name: GIVEN[name] + k * d}) for k in (-2, -1, 1, 2)]
            slope = (near[0] - 8.0 * near[1] + 8.0 * near[2] - near[3]) / (12.0 * d)
            # Differences of order 4: 1e-12; the time of the event by steps: round-off over them.
            assert found.jacobian[i, j] == pytest.approx(slope, rel=1e-7, abs=1e-8)
    assert not found.remarks


@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_halves_of_a_step_have_half_the_change_of_its_size(scheme, monkeypatch, tmp_path):
    """Steps that cannot be solved at once, after a jump whose time moves."""
    solve = TangentRun._solve
    monkeypatch.setattr(
        *(TangentRun, "_solve"),
        lambda self, step, h, share: share < 0.3 and solve(self, step, h, share),
    )
    measures, wanted = ["P.x final"], {"scheme": scheme, "error": "off"}
    found = pushed("where(P.x > X, F2, F1)", tmp_path).gradient(measures, ["X"], **wanted)
    d = 1e-5
    slope = np.diff([by_place(1.0, **{**GIVEN, "X": GIVEN["X"] + k * d}) for k in (-1, 1)])
    # Differences of order 2 over 1e-5 m. Each quarter had the change of all of the step: 6.27.
    assert found.jacobian[0, 0] == pytest.approx(slope[0] / (2.0 * d), rel=1e-7)


def test_a_jump_that_gradients_do_not_follow_is_named_with_its_line(tmp_path):
    """By the reaction of a joint, which is that of the step before."""
    rail = (
        "<joints><prismatic><name>Rail</name><parent><name>Base</name><axis><x>1</x></axis></parent>"
        "<child><name>Body</name></child></prismatic></joints>"
    )
    path = tmp_path / "pushed.xml"
    names = "".join(f'<parameter name="{k}">{v}</parameter>' for k, v in GIVEN.items())
    given = PUSHED.format(parameters=names, force="F1*sign(Rail.Fx + X)")
    path.write_text(given.replace("<markers>", f"{rail}<markers>"))
    found = msahl.load(path).gradient(["P.x final"], ["v"], error="off", t_final=0.1)
    (remark,) = found.remarks
    line = 1 + PUSHED[: PUSHED.index("<concentrated>")].count("\n")
    assert f"the expression of load 'Push' ({path}:{line}) jumps" in remark


def test_divided_steps_move_with_the_parameters(tmp_path):
    """A one-sided spring, by radau2 at steps of 20 ms: of the derivative by its place 3e-3 would be
    missing. The rest is what differences of runs have, of order 4 at 1e-4 of the parameter."""
    model = pushed("F1 - 180*max(0, P.x - X)", tmp_path)
    wanted = {"scheme": "radau2", "error": "off"}
    found = model.gradient(["P.x final"], ["X"], **wanted)
    d, near = 4e-5, []
    for k in (-2, -1, 1, 2):
        near.append(model.with_(X=0.4 + k * d).run(**wanted).markers["P.x"].iloc[-1])
    slope = (near[0] - 8.0 * near[1] + 8.0 * near[2] - near[3]) / (12.0 * d)
    assert found.jacobian[0, 0] == pytest.approx(slope, abs=1e-7)

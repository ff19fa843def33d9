"""The joint of docs/adding-a-joint.md, which the program does not have, added as it says."""

import re

import numpy as np
import pandas as pd
import pytest

from msahl.joints.registry import KINDS
from tests.elements import test_laws
from tests.joints import test_degrees_of_freedom
from tests.support.element_samples import (
    JOINTS,
    Sample,
    X,
    Z,
    joint_model,
    rotation,
    rotations,
    slide,
)
from tests.support.guide import call, call_all, copy_program, listings, section

GUIDE = section("Adding a joint")
NAME, MODULE = "pointOnCylinder", "point_on_cylinder"
MODULE_TEXT, SAMPLE_TEXT = listings(GUIDE, "python")
SCHEMA_TEXT, DECK_TEXT = listings(GUIDE, "xml")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the program with the guide's module, registry line, schema element and deck."""
    root = tmp_path_factory.mktemp("checkout")
    copy_program(root)
    (root / "msahl" / "joints" / f"{MODULE}.py").write_text(MODULE_TEXT)
    add_before(root / "msahl" / "joints" / "registry.py", r"^ +point_on_line,$", f"{MODULE},", 2)
    schema = root / "schemas" / "msaHLData.xsd"
    add_before(schema, r'^ +<xs:element name="pointOnLine".*$', SCHEMA_TEXT, 1)
    (root / f"{MODULE}.xml").write_text(DECK_TEXT)
    return root


def add_before(path, line, addition, times):
    """Put the ``addition`` before each line that matches."""
    text, count = re.subn(line, lambda m: f"{addition}\n{m[0]}", path.read_text(), flags=re.M)
    assert count == times
    path.write_text(text)


@pytest.mark.slow
def test_the_deck_of_the_guide_is_checked_and_run(checkout):
    good = call(checkout, "check", f"{MODULE}.xml")
    assert (good.returncode, good.stdout) == (0, f"{MODULE}.xml: good\n"), good.stderr
    run = call(checkout, "run", f"{MODULE}.xml", "--dt", "0.02", "-o", "out", "--solver", "newton")
    assert run.returncode == 0, run.stderr
    states = pd.read_csv(checkout / "out" / "states.csv")
    assert len(states) == 151
    listed = re.search(r"^ *0\.02 +(\S+) +(\S+)", GUIDE, re.M)
    x, error = states["Bead.x"].iloc[-1], float(listed[2])
    # The guide's own table, as many digits as it prints; and the closed form it compares with.
    assert x == pytest.approx(float(listed[1]), abs=1e-9)
    assert abs(x - 0.428728576) == pytest.approx(error, rel=0.02)
    assert np.hypot(states["Bead.x"], states["Bead.z"]).to_numpy() == pytest.approx(0.5, abs=1e-14)
    forces = pd.read_csv(checkout / "out" / "reactions.csv")
    assert list(forces.columns) == ["time", "Pipe.Fx", "Pipe.Fy", "Pipe.Fz"]


@pytest.mark.slow
def test_every_command_runs_with_the_joint(checkout):
    """What no part of the program but the joint's module says of it follows from its equations."""
    deck, out = f"{MODULE}.xml", "everywhere/run"
    call_all(
        checkout,
        f"msahl explain {deck}",
        f"msahl show {deck} -o everywhere/show.html",
        f"msahl run {deck} --dt 0.1 -o {out} --gradient 'Bead.x final' --wrt Bead.mass",
        f"msahl-post report {out}",
        f"msahl-post view {out}",
        f"msahl-post export {out} --glb",
        f"msahl-post plot {out} linkage",  # the report has the other pictures
        f"msahl-post reactions {out}",
        f"msahl-post constraints {out}",
        f"msahl-post work {out}",
        f"msahl linearize {deck} -o everywhere/linear.json",
        f"msahl equilibrium {deck} -o everywhere/equilibrium",
        "msahl check everywhere/equilibrium/equilibrium1.xml",
        "msahl modes everywhere/equilibrium/equilibrium1.xml -o everywhere/modes",
    )
    folder = checkout / "everywhere"
    for page in ("show.html", "run/view.html", "run/report/report.html"):
        assert f'"kind":"{NAME}"' in (folder / page).read_text(), page
    rest = pd.read_csv(folder / "equilibrium" / "states.csv").iloc[0]
    # The lowest line of the pipe, with the bead where it was along it; at rest to round-off.
    assert rest[["Bead.x", "Bead.y", "Bead.z"]].to_list() == pytest.approx([0, 0, -0.5], abs=1e-9)
    modes = pd.read_csv(folder / "modes" / "modes.csv")
    # A pendulum of 0.5 m; a bead that does not roll changes nothing else.
    assert modes["imaginary"].iloc[-1] == pytest.approx(np.sqrt(9.81 / 0.5), rel=1e-9)
    # The motion of a bead does not depend on its mass; what is found is the stated rounding error.
    gradient = pd.read_csv(folder / "run" / "gradients.csv").iloc[0]
    assert abs(gradient["derivative"]) < 10.0 * gradient["error"] < 1e-10


def test_a_prescribed_motion_of_the_joint(checkout):
    """A pin at the radius e of a shaft that rotates about a vertical axis lifts it in the pipe."""
    x, e, radius = 0.3, 0.1, 0.5
    shaft = f"""<cylindrical><name>Shaft</name><parent><name>Base</name>
<position><x>{x}</x></position><axis><z>1</z></axis></parent><child><name>Bead</name></child>
</cylindrical></joints><motions><jointMotion><name>Motor</name><joint>Shaft</joint>
<coordinate>angle</coordinate><law><polynomial><c1>1</c1></polynomial></law></jointMotion></motions>
"""
    deck = DECK_TEXT.replace("</joints>", shaft).replace("0.4330127018922193", str(x))
    deck = deck.replace("<z>-0.25</z>", "<z>-0.3</z>").replace("<v2>0.3</v2>", "<v2>0</v2>")
    pin = f"<child><name>Bead</name><position><x>{e}</x></position></child>"
    deck = deck.replace("<child><name>Bead</name></child>\n        <radius", f"{pin}\n<radius")
    (checkout / "shaft.xml").write_text(deck)
    call_all(checkout, "msahl kinematics shaft.xml --step 0.5 -o shaft")
    states = pd.read_csv(checkout / "shaft" / "states.csv")
    height = -np.sqrt(radius**2 - (x + e * np.cos(states["time"])) ** 2)
    # Round-off of the bead's distance from the axis, over the least slope of the pipe there, 3/4.
    assert states["Bead.z"].to_numpy() == pytest.approx(height.to_numpy(), abs=1e-14)


@pytest.mark.slow
def test_a_wrong_deck_of_the_guide_is_reported_as_it_says(checkout):
    (told,) = re.findall(rf"^ +({MODULE}\.xml:30: .*)$", GUIDE, re.M)
    wrong = DECK_TEXT.replace('<radius units="m">0.5<', '<radius units="m">0.6<')
    folder = checkout / "wrong"
    folder.mkdir()
    (folder / f"{MODULE}.xml").write_text(wrong)
    result = call(checkout, "check", f"wrong/{MODULE}.xml")
    assert result.returncode == 2
    assert result.stderr == f"wrong/{told}\n"


def test_the_test_entry_of_the_guide_holds_the_joint_to_all_laws(monkeypatch):
    namespace = {}
    exec(MODULE_TEXT, namespace)
    names = {"Sample": Sample, "slide": slide, "rotation": rotation, "rotations": rotations}
    names |= {"X": X, "Z": Z}
    ((name, sample),) = eval(f"{{{SAMPLE_TEXT}}}", names).items()
    assert name == NAME
    monkeypatch.setitem(KINDS, NAME, namespace["KIND"])
    monkeypatch.setitem(JOINTS, NAME, sample)

    def make(rng):
        return joint_model(NAME, rng)

    test_degrees_of_freedom.test_the_table_of_degrees_of_freedom_is_complete()
    test_degrees_of_freedom.test_a_joint_between_two_bodies_takes_away_what_it_should(NAME)
    test_degrees_of_freedom.test_free_velocities_open_nothing_and_the_rest_do(NAME, 0)
    test_degrees_of_freedom.test_degrees_of_freedom_open_nothing_and_the_rest_do(NAME, 0)
    test_degrees_of_freedom.test_a_body_set_going_along_its_degree_of_freedom_goes_on(NAME, 0)
    test_laws.test_the_jacobian_is_the_derivative_of_the_residual(make, 0, "preserving")
    test_laws.test_the_residual_rotates_with_the_model(make, 0)
    test_laws.test_every_element_is_approached_with_order_two(make, "preserving")

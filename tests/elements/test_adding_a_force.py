"""The force of docs/adding-a-force.md, which the program does not have, added as it says."""

import inspect
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from msahl.laws.contact import CONTACT
from msahl.laws.registry import COORDINATE_LAWS, POINT_LAWS
from tests.support.guide import (
    ROOT,
    apply,
    call,
    call_all,
    copy_program,
    listings,
    run_tests,
    section,
)

GUIDE = section("Adding a force")
(LAW,) = listings(GUIDE, "python")
(DECK,) = listings(GUIDE, "xml")
ALONG = section("Adding a force along a coordinate")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the program with all listings of the guide."""
    root = tmp_path_factory.mktemp("checkout")
    copy_program(root, "tests", "tools")
    shutil.copy(ROOT / "pyproject.toml", root)
    for changes in listings(GUIDE, "diff"):
        apply(root, changes)
    (root / "msahl" / "laws" / "viscous.py").write_text(LAW)
    (root / "viscous_drag.xml").write_text(DECK)
    return root


def test_the_deck_of_the_guide_is_checked_and_run(checkout):
    good = call(checkout, "check", "viscous_drag.xml")
    assert (good.returncode, good.stdout) == (0, "viscous_drag.xml: good\n"), good.stderr
    run = call(checkout, "run", "viscous_drag.xml", "--dt", "0.1", "-o", "out")
    assert run.returncode == 0, run.stderr
    z = pd.read_csv(checkout / "out" / "states.csv")["Ball.z"].iloc[-1]
    listed = re.search(r"^ *0\.1 +(\S+) +(\S+)", GUIDE, re.M)
    # The guide's own table, as many digits as it prints; and the closed form it compares with.
    assert z == pytest.approx(float(listed[1]), abs=1e-9)
    assert abs(z + fall(0.5 / 0.8)) == pytest.approx(float(listed[2]), rel=0.05)


@pytest.mark.slow
def test_every_command_runs_with_the_force(checkout):
    """The ball falls; where a rest is needed it hangs from a spring in the oil."""
    stiffness, mass, damping = 50.0, 0.5, 0.8
    spring = f"""<springDamper><name>Spring</name>
<parent><name>Base</name><position><z>1</z></position></parent><child><name>Ball</name></child>
<stiffness>{stiffness}</stiffness><freeLength>1</freeLength></springDamper></loads>"""
    (checkout / "hanging.xml").write_text(DECK.replace("</loads>", spring))
    deck, out = "viscous_drag.xml", "everywhere/run"
    call_all(
        checkout,
        f"msahl explain {deck}",
        f"msahl show {deck} -o everywhere/show.html",
        f"msahl run {deck} --dt 0.1 -o {out} --gradient 'Ball.z final' --wrt Oil.coefficient",
        f"msahl-post report {out}",
        f"msahl-post view {out}",
        f"msahl-post export {out} --glb",
        f"msahl-post plot {out}",
        f"msahl-post energy {out}",
        "msahl linearize hanging.xml -o everywhere/linear.json",
        "msahl equilibrium hanging.xml -o everywhere/equilibrium",
        "msahl modes everywhere/equilibrium/equilibrium1.xml -o everywhere/modes",
    )
    folder = checkout / "everywhere"
    gradient = pd.read_csv(folder / "run" / "gradients.csv").iloc[0]
    # Of the closed form by a complex step; as exact as the position at this step size, 1.1e-3 m.
    by_c = -fall(mass / (damping + 1e-30j)).imag / 1e-30
    assert gradient["derivative"] == pytest.approx(by_c, rel=1e-3)
    rest = pd.read_csv(folder / "equilibrium" / "states.csv").iloc[0]
    assert rest["Ball.z"] == pytest.approx(-mass * 9.81 / stiffness, rel=1e-9)
    modes = pd.read_csv(folder / "modes" / "modes.csv")
    along = [-0.5 * damping / mass, np.sqrt(stiffness / mass - (0.5 * damping / mass) ** 2)]
    found = modes[["real", "imaginary"]].to_numpy()
    assert np.abs(found - along).max(axis=1).min() < 1e-9  # eigenvalues of order 10 1/s


def fall(T, t=2.0):
    """Depth [m] after t [s] of a fall in oil with the time constant T [s]."""
    return 9.81 * T * (t - T * (1.0 - np.exp(-t / T)))


def test_a_wrong_coefficient_is_a_fault(checkout):
    (checkout / "wrong.xml").write_text(DECK.replace(">0.8<", ">-0.8<"))
    result = call(checkout, "check", "wrong.xml")
    assert result.returncode == 2
    assert "load 'Oil'" in result.stderr
    assert "it must not be less than zero" in result.stderr


@pytest.mark.slow
def test_the_tests_of_the_guide_hold_the_force_to_all_laws(checkout):
    """Of the schemes one of each family; of the laws those that see derivatives and work."""
    laws = [
        "tests/elements/test_laws.py::test_the_jacobian_is_the_derivative_of_the_residual",
        "tests/elements/test_laws.py::test_forces_from_outside_are_few",
        "tests/elements/test_forces.py",
        "tests/schemes/collocation/test_gauss.py::test_the_derivative_of_every_element",
        "tests/system/test_evaluate.py",
        "tests/validation/test_error_table.py::test_accelerations_are_those_of_the_engine",
    ]
    schemes = "(follows_the_laws and (preserving or gauss2))"
    chosen = f"viscousDrag or outside or every_kind or changes_the_motion or {schemes}"
    result = run_tests(checkout, "-n", "0", *laws, "-k", chosen)
    assert result.returncode == 0, result.stdout[-2000:]


@pytest.fixture(scope="module")
def along(tmp_path_factory):
    """A copy of the program with the force along a coordinate of the guide."""
    root = tmp_path_factory.mktemp("along")
    copy_program(root, "tests", "tools")
    shutil.copy(ROOT / "pyproject.toml", root)
    for changes in listings(ALONG, "diff"):
        apply(root, changes)
    (root / "msahl" / "laws" / "cogging.py").write_text(*listings(ALONG, "python"))
    (root / "cogging.xml").write_text(*listings(ALONG, "xml"))
    return root


def test_laws_have_at_most_40_lines():
    """That of a contact has two ends, and what depends on both position and rate: 80."""
    laws = [law.load for law in POINT_LAWS.values()]
    laws += [law.potential for law in COORDINATE_LAWS.values() if law.is_elastic]
    laws += [law.resistance for law in COORDINATE_LAWS.values() if not law.is_elastic]
    known = {Path(inspect.getfile(function)) for function in laws}
    contact = Path(inspect.getfile(CONTACT.potential))
    for text in (LAW, *listings(ALONG, "python"), *(p.read_text() for p in known - {contact})):
        assert len(text.splitlines()) <= 40
    assert len(contact.read_text().splitlines()) <= 80


@pytest.mark.slow
def test_the_force_along_a_coordinate_is_checked_and_run(along):
    good = call(along, "check", "cogging.xml")
    assert (good.returncode, good.stdout) == (0, "cogging.xml: good\n"), good.stderr
    ends = []
    for dt in ("0.02", "0.01"):
        run = call(along, "run", "cogging.xml", "--dt", dt, "-o", dt)
        assert run.returncode == 0, run.stderr
        table = pd.read_csv(along / dt / "states.csv")
        ends.append(4.0 * np.arctan(table["Wheel.P3"].iloc[-1] / 4.0))
        energy = (
            0.01 * table["Wheel.wz"] ** 2 + pd.read_csv(along / dt / "work.csv")["Magnets.energy"]
        )
        # The quotient of the potential keeps the energy of 0.04 J at any step size.
        assert np.ptp(energy) < 1e-14
    coarse, fine = (abs(end + 0.031863911290195356) for end in ends)
    assert fine < 2e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.05)  # order 2


@pytest.mark.slow
def test_the_tests_of_the_guide_hold_the_force_along_a_coordinate_to_all_laws(along):
    laws = [
        "tests/elements/test_laws.py::test_the_jacobian_is_the_derivative_of_the_residual",
        "tests/elements/test_forces.py",
        "tests/schemes/collocation/test_gauss.py::test_the_derivative_of_every_element",
        "tests/validation/test_error_table.py::test_accelerations_are_those_of_the_engine",
    ]
    schemes = "(follows_the_laws and (preserving or gauss2))"
    chosen = f"cogging or every_kind or changes_the_motion or {schemes}"
    result = run_tests(along, "-n", "0", *laws, "-k", chosen)
    assert result.returncode == 0, result.stdout[-2000:]

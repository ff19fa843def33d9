"""The kind of body of docs/adding-an-element.md, added as it says."""

import numpy as np
import pandas as pd
import pytest

from tests.support.guide import apply, call, call_all, copy_program, listings, section

GUIDE = section("Adding a kind of body")
CHANGES = listings(GUIDE, "diff")
(DECK,) = listings(GUIDE, "xml")


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the program with all listings of the guide."""
    root = tmp_path_factory.mktemp("checkout")
    copy_program(root)
    for changes in CHANGES:
        apply(root, changes)
    (root / "ball.xml").write_text(DECK)
    return root


def test_a_kind_of_body_changes_at_most_eight_files():
    files = [listing.splitlines()[0] for listing in CHANGES]
    # With its deck, its entry in docs/deck.md and the line in CHANGELOG.md.
    assert len(set(files)) + 3 <= 8


def test_the_body_is_shown_and_run(checkout):
    call_all(
        checkout,
        "msahl check ball.xml",
        "msahl show ball.xml -o show.html",
        "msahl run ball.xml --scheme gauss3 --dt 0.1 -o run "
        "--gradient 'Axle.angle final' --wrt Ball.radius",
    )
    angle = pd.read_csv(checkout / "run" / "joints.csv")["Axle.angle"].iloc[-1]
    assert angle == pytest.approx(0.2 * np.sin(10.0), abs=1e-4)  # order 6, 1 rad a step: 1/7!
    gradient = pd.read_csv(checkout / "run" / "gradients.csv").iloc[0]
    # Omega = sqrt(k/J) goes with 1/r, of 100 mm, and q = w0/Omega sin(Omega t).
    by_r = (0.2 * np.sin(10.0) - 2.0 * np.cos(10.0)) / 100.0
    assert gradient["derivative"] == pytest.approx(by_r, rel=1e-3)  # likewise


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (">100<", ">0<", "principal moments about G 0, 0, 0 kg-m^2"),
        (">2</mass>", ">-2</mass>", "the mass is -2 kg; it must be greater than zero"),
    ],
)
def test_its_faults_are_those_of_a_body(checkout, old, new, message):
    (checkout / "wrong.xml").write_text(DECK.replace(old, new))
    result = call(checkout, "check", "wrong.xml")
    assert result.returncode == 2
    assert "body 'Ball'" in result.stderr
    assert message in result.stderr

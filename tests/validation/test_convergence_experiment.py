"""The experiment on the thesis's convergence errors, in small: the pair fails, neither alone."""

import pytest

from benchmarks.convergence import element, stepping


@pytest.fixture(autouse=True)
def _plain(monkeypatch):
    """Run the residual as plain Python: compiling it takes longer than all steps here."""
    for module in (element, stepping):
        for name, function in list(vars(module).items()):
            if hasattr(function, "py_func"):
                monkeypatch.setattr(module, name, function.py_func)


@pytest.mark.parametrize(
    ("scaled", "differences", "complete"),
    [(True, False, True), (False, False, True), (True, True, True), (False, True, False)],
)
def test_triple_pendulum_at_a_small_step(scaled, differences, complete):
    program = stepping.Program("", scaled=scaled, differences=differences, tolerance=1e-12)
    # 20 steps; that with both weaknesses gives up after 10.
    reached, why, _, residual = stepping.reach("triple_pendulum_45", 0.002, 0.04, program)
    assert (reached == 0.04) == complete
    assert bool(why) != complete
    # Where it gives up, it has stalled near the solution: the momenta are 10 N s and more.
    assert residual < 1e-6


def test_condition_grows_as_the_square_of_the_step_unless_scaled():
    coarse, fine = (stepping.condition("double_pendulum_89", h, False) for h in (1e-2, 1e-3))
    assert fine / coarse == pytest.approx(100.0, rel=0.05)  # lower powers of h are left
    coarse, fine = (stepping.condition("double_pendulum_89", h, True) for h in (1e-2, 1e-3))
    assert fine / coarse == pytest.approx(1.0, rel=0.05)

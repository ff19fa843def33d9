"""The ratio of the pivots, by which a run judges how well its equations are conditioned."""

import numpy as np
import pytest

from msahl.formulations.absolute.frames import first_multiplier
from msahl.linalg import sparse_lu
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.midpoint import newton
from msahl.schemes.outcome import TARGET
from tests.support.models import chain, deck
from tests.support.models import simulate_and_estimate as simulate


def factored():
    """A workspace with the Jacobian of the first step of a chain of three links."""
    workspace = SubsystemIntegrator(chain(3), "newton", True, 1).workspace
    residual, _ = newton.iterate(workspace, 0.01, TARGET)
    assert residual < 1e-12
    return workspace


def ratios(workspace):
    """Factor the Jacobian again; return the ratio of its pivots, and that of the scaled matrix."""
    lu, values, W = workspace.unknowns.elimination, workspace.values, workspace.factor
    blocks = workspace.system.blocks
    sparse_lu.factor(lu, values, W)
    own = sparse_lu.pivot_ratio(lu, W)
    return own, sparse_lu.scaled_pivot_ratio(lu, blocks, values, W, workspace.sizes)


@pytest.mark.parametrize("power", [3.0, 6.0])
def test_units_of_equations_and_unknowns_hardly_change_the_scaled_ratio(power):
    workspace = factored()
    _, before = ratios(workspace)
    nodes, rng = workspace.Z.shape, np.random.default_rng(1)
    row, column = 10.0 ** rng.uniform(-power, power, size=(2, *nodes))
    i, j = workspace.system.blocks.T
    workspace.values[:] *= (row[i][:, :, None] * column[j][:, None, :]).reshape(-1)
    own, after = ratios(workspace)
    assert own > 10.0 ** (2.0 * power)
    # Measured: 22 and 1200 times as large.
    assert after < 1e4 * before
    assert newton.pivot_ratio(workspace) == (after if own > newton.SCALED_ABOVE else own)


@pytest.mark.parametrize("apart", [1e-12, 1e-15])
def test_equations_that_are_nearly_the_same_raise_both_ratios(apart):
    workspace = factored()
    values, blocks = workspace.values.reshape(-1, 3, 3), workspace.system.blocks
    of_joint = blocks[:, 0] == first_multiplier(workspace.system.frames)
    values[of_joint, 1] = values[of_joint, 0] + apart * values[of_joint, 1]
    assert min(ratios(workspace)) > 0.01 / apart
    assert newton.pivot_ratio(workspace) > 0.01 / apart


@pytest.mark.slow
def test_a_stiff_beam_in_a_flat_linkage_is_well_conditioned():
    """With scaled rows and columns its condition number is 1e5 to 1e7, in the flat position at
    2.6 s 20 times that before. The pivots differ by up to 1e18, for their units and because those
    of rotations, which normal forces make indefinite, pass through zero.
    """
    report = simulate(deck("flexible_four_bar"), t_final=3.0).report
    assert report.verdict["checks"]["pivotRatio"]["word"] == "PASS"

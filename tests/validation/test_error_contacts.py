"""Estimates of the error in scenes with contacts, against closed forms and small steps."""

import pytest

from tools.validation import error
from tools.validation.error_contacts import CONTACTS
from tools.validation.error_page import LEAST, MOST

SCHEMES = ("preserving", "gauss2", "gauss3")


@pytest.mark.slow
@pytest.mark.parametrize("case", CONTACTS, ids=lambda case: case.name)
def test_estimates_are_the_true_errors(case):
    """Through impacts, reversals, breaks and ends of slips, at steps of 1 to 1/16."""
    cells = error.run_cells(case, only=SCHEMES, tolerances=())
    assert all(cell.status == "completed" for cell in cells)
    found = [c for c in error.comparisons(cells) if c.clear]
    ratios = [c.ratio for c in found]
    assert len(ratios) > len(cells) // 2
    assert min(ratios) > LEAST
    assert max(ratios) < MOST

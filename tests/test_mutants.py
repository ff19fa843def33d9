"""The list of lines that ``make mutate`` falsifies fits the sources; the tool itself takes long."""

import pytest

from tests.support.models import ROOT
from tools.mutate import GENERAL, MUTANTS, file_of


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
def test_a_mutant_changes_one_place_and_names_tests_that_exist(mutant):
    assert file_of(ROOT, mutant)
    assert mutant.wrong != mutant.right
    for test in (*mutant.tests, *GENERAL):
        path, _, name = test.partition("::")
        assert (ROOT / path).exists()
        assert f"def {name}(" in (ROOT / path).read_text() if name else True

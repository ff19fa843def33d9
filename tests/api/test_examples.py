"""The example scripts, run as they stand."""

import runpy

import numpy as np
import pytest

from tests.support.models import ROOT


@pytest.mark.slow
def test_the_fit_of_a_damper_finds_what_made_the_curve(capsys):
    fit = runpy.run_path(str(ROOT / "examples" / "fit_damper.py"))
    # The curve is the closed form of these parameters with a noise of 1 mm (seeded). An estimate
    # is off by more than 4 standard deviations once in 16,000 measurements.
    true = np.array([212.0, 3.4, 0.48])
    assert (np.abs(fit["fit"].x - true) < 4.0 * fit["deviations"]).all()
    # The standard deviation of 148 degrees of freedom is known to 1/sqrt(2*148) = 6 %.
    assert abs(fit["noise"] - 1e-3) < 4.0 * 0.06 * 1e-3
    assert fit["fit"].nfev <= 15
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("PASS: estimated error of a run ")
    assert [line.partition(":")[0] for line in lines[1:4]] == list(fit["NAMES"])

"""Short studies from the command to the report, in seconds even as plain Python."""

import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.study import page, search, study
from msahl.study.plan import Plan
from tests.support.models import ROOT, body, build_model

THESIS = ROOT / "decks" / "thesis"
SINGLE, TOP = THESIS / "single_pendulum_45.xml", THESIS / "top_1.xml"


def run_study(folder, deck, *words):
    """Report in HTML and in Markdown, and table of a study."""
    result = CliRunner().invoke(main, ["study", *map(str, (deck, *words)), "-o", str(folder)])
    assert result.exit_code == 0, result.output
    texts = [(folder / f"study.{form}").read_text() for form in ("html", "md")]
    return *texts, pd.read_csv(folder / "study.csv")


@pytest.fixture
def clock(monkeypatch):
    """A clock of searches that goes on by 20 ms whenever it is looked at, on every machine, and is
    far from the end of the study.
    """
    seconds = iter(0.02 * k - 1e6 for k in range(1_000_000))
    for module in (search, study):
        monkeypatch.setattr(module, "working_clock", lambda: next(seconds))


@pytest.mark.slow
def test_a_search_recommends_a_run_that_meets_the_target(tmp_path, clock, monkeypatch):
    monkeypatch.setattr(page, "_pictures", lambda study: [])  # they are those of the next test
    schemes = ("--scheme", "preserving", "--scheme", "gauss2", "--scheme", "auto")
    # "auto" would take another reference on a busy machine.
    words = ("--t-final", 0.3, "--budget", 4, "--target", 1e-3, "--reference", "independent")
    html, text, table = run_study(tmp_path, SINGLE, *words, *schemes)
    assert {"preserving", "gauss2", "auto"} == set(table["scheme"])
    (command,) = re.findall(r"<pre><code>(msahl run .*)</code></pre>", html)
    assert f"\n\n    {command}\n\n" in text
    meets = table[table["position_max"] <= 1e-3]
    assert len(meets) > 0
    given = re.search(r"--scheme (\w+)", command)[1]
    assert given in set(meets["scheme"])
    steps = re.search(r"--dt (\S+)", command)
    if steps:  # auto has a tolerance instead
        assert float(steps[1]) in set(meets["dt"])


@pytest.mark.parametrize(("speed", "metric"), [(0.0, "orientation"), (1e-3, "position")])
def test_bodies_that_rotate_in_place_are_compared_by_their_orientation(speed, metric):
    """Positions are right at any step, so a run of torque_free was recommended, a radian off."""

    def states(times):
        table = np.tile(np.arange(12.0), (len(times), 1))
        table[:, 2] += speed * times
        table[:, 4] += times  # its orientation changes in any case
        return table

    reference = SimpleNamespace(states=states)
    model = build_model([body()])
    assert study.default_metric(Plan(model), reference) == metric


@pytest.mark.slow
def test_observed_orders_of_given_steps(tmp_path):
    steps = (word for dt in (0.04, 0.02, 0.01, 0.005) for word in ("--dt", dt))
    schemes = ("--scheme", "preserving", "--scheme", "gauss2")
    words = ("--t-final", 0.2, "--repeat", 1, "--reference", "independent", *schemes)
    _, text, table = run_study(tmp_path, SINGLE, *steps, *words)
    for scheme, order in (("preserving", 2), ("gauss2", 4)):
        errors = table[table["scheme"] == scheme].sort_values("dt")["position_max"].to_numpy()
        assert errors[2] / errors[1] == pytest.approx(2.0**order, rel=0.1)
    assert "DOP853" in text


@pytest.mark.slow
def test_a_top_and_other_metrics(tmp_path):
    words = ("--dt", 0.004, "--dt", 0.002, "--dt", 0.001, "--repeat", 1, "--t-final", 0.02)
    words = (*words, "--reference", "independent")
    metric = ("--metric", "mean_reaction", "--target", 1, "--scheme", "preserving")
    html, text, table = run_study(tmp_path, TOP, *words, *metric)
    assert len(table) == 3
    assert "with an error of at most 1 N (reaction, mean over the step) at every" in text
    assert "<summary>Observed orders</summary>" in html
    finer = table.sort_values("dt")
    for name in ("position_max", "orientation_max", "angular_velocity_max"):
        assert finer[name].is_monotonic_increasing, name

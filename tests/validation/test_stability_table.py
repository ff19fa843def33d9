"""The stability table in small: extreme decks hold, lose no row, and are reported apart."""

import csv
from dataclasses import asdict, replace
from math import pi

import numpy as np
import pytest
from lxml import etree

from msahl.deck import read_deck
from msahl.model.scheme import ORDER_TWO
from tests.support.models import ROOT
from tools.validation import extreme_families, stability_cells, stability_page
from tools.validation import stability as stability_module

KEPT = ROOT / "docs" / "validation" / "stability.csv"
TOLD = (*ORDER_TWO, "gauss3", "radau3")


@pytest.fixture(scope="module")
def cells():
    stability_cells.warm_runs()
    return stability_cells


@pytest.fixture(scope="module")
def extreme(cells):
    return extreme_families


@pytest.fixture(scope="module")
def stability(cells):
    return stability_module


AS_SHIPPED = {
    "mass_ratio": 1e-3,
    "point_mass": 1e-6,
    "needle_to_disk": 1e-3,
    "length": 1.0,
    "spin": 1e4,
    "stiff_spring": 1e-7,
    "stiff_pendulum": 0.03,
    "damping": 1e3,
    "bushing_loop": 1e8,
    "toggle": 0.5,
    "folded_chain": 0.5,
    "taut_chain": 1e-3,
    "inverted": 1e-3,
    "cranks": 2,
    "drift": 1e3,
    "long_run": 1e4,
    "long_chain": 10,
    "inconsistent": 1.0,
    "open_joint": 0.01,
    "governor": 4e4,
}


def read(tmp_path, text):
    path = tmp_path / "deck.xml"
    path.write_bytes(text)
    return read_deck(path)


def test_every_extreme_deck_is_in_the_table(extreme):
    decks = {path.stem for path in (ROOT / "decks" / "extreme").glob("*.xml")}
    assert decks == {
        f.path.stem for f in extreme.FAMILIES.values() if not f.deck.startswith("mech")
    }


@pytest.mark.parametrize("name", AS_SHIPPED)
def test_the_value_of_the_deck_gives_the_deck(name, extreme, tmp_path):
    """So what is substituted means what the deck says, moments and geometry included."""
    family = extreme.FAMILIES[name]
    # Sines and roots taken twice may differ in the last bit.
    made, own = (
        numbers(read(tmp_path, family.with_value(AS_SHIPPED[name]))),
        numbers(read_deck(family.path)),
    )
    assert made == pytest.approx(own, rel=1e-14, abs=1e-14)
    if name != "long_run":
        other = next(x for x in family.values if x != AS_SHIPPED[name])
        assert numbers(read(tmp_path, family.with_value(other))) != made


def numbers(model):
    """All numbers of a model, in their order."""
    if isinstance(model, float):
        return [model]
    if hasattr(model, "__dataclass_fields__"):
        model = [getattr(model, key) for key in model.__dataclass_fields__]
    if isinstance(model, list | tuple):
        return [x for part in model for x in numbers(part)]
    return []


def test_chains_and_cranks_grow_to_any_number(extreme, tmp_path):
    chain = read(tmp_path, extreme.FAMILIES["long_chain"].with_value(25))
    assert [body.position[0] for body in chain.bodies] == [k + 0.5 for k in range(25)]
    assert [(j.parent, j.child) for j in chain.joints][-1] == ("Link 24", "Link 25")
    beam = read(tmp_path, extreme.FAMILIES["cranks"].with_value(5))
    assert [body.position[0] for body in beam.bodies[1:]] == [0.15, 0.65, 1.15, 1.65, 2.15]
    assert len(beam.joints) == 10


QUICK = (
    ("mass_ratio", 1e6, (1e-6, 1e-2)),
    ("point_mass", 1e-9, (1e-6, 1e-2)),
    ("needle_to_disk", 2.0, (1e-6, 1e-2)),
    ("length", 1e3, (1e-4, 1.0)),
    ("spin", 1e5, (1e-6, 1.0)),
    ("stiff_spring", 1e-9, (1e-6, 1.0)),
    ("damping", 1e3, (1e-6, 1.0)),
    ("bushing_loop", 1e6, (1e-4, 1e-2)),
    ("toggle", 1e-3, (1e-4, 1e-2)),
    ("folded_chain", 0.0, (1e-4, 1e-2)),
    ("folded_chain", pi, (1e-4, 1e-2)),
    ("inverted", 1e-6, (1e-4, 1e-1)),
    ("cranks", 8, (1e-6, 1e-2)),
    ("drift", 1e6, (1e-4, 1e-2)),
    ("inconsistent", 1e3, (1e-4, 1e-2)),
    ("inconsistent_as_given", 1.0, (1e-4, 1e-2)),
    ("open_joint", 1e-1, (1e-4, 1e-2)),
)


SMALLER = {"spin": 1e-5, "toggle": 1e-3}
"""Largest steps [s] of higher orders, where others are complete revolutions or pass a near
singular place by at once.
"""


@pytest.mark.sampled
@pytest.mark.parametrize("scheme", TOLD)
@pytest.mark.parametrize(("name", "value", "steps"), QUICK, ids=lambda value: str(value)[:14])
def test_extreme_cells_hold(name, value, steps, scheme, cells, extreme, monkeypatch):
    """A hundred steps each, no true positions: those are for the page."""
    if scheme not in ORDER_TWO:
        steps = (steps[0], SMALLER.get(name, steps[1]))
    # It closes the jump as an inelastic blow does, and what that takes is reported as an error.
    blow = (name, scheme) == ("inconsistent_as_given", "gauss3")
    family = replace(extreme.FAMILIES[name], steps=lambda x: 100, known=False)
    monkeypatch.setitem(extreme.FAMILIES, name, family)
    for cell in cells.run_group(name, value, (scheme,), steps):
        # At a microsecond hardly anything moves yet: the error is round-off over nearly nothing.
        outcome = cells.DOUBTFUL if blow else cells.BOUNDED
        assert (cell.outcome, cell.message) == (outcome, "")
        assert cell.steps == min(100, max(10, round(10.0 / cell.dt)))
        assert cell.output_times == cell.output_times_found
        figures = (
            cell.iterations,
            cell.energy,
            cell.violation,
            cell.violation_rate,
            cell.condition,
        )
        assert np.isfinite([0.0 if figure is None else figure for figure in figures]).all()


def test_a_run_that_fails_keeps_its_rows_and_says_why(cells, extreme, tmp_path):
    """A spring that pushes grows the motion threefold a step, until it is no number any more."""
    deck = tmp_path / "deck.xml"
    root = etree.fromstring(extreme.FAMILIES["stiff_spring"].path.read_bytes())
    extreme.put(root, "//stiffness", -1e10)
    deck.write_bytes(etree.tostring(root))
    info = cells.run_deck(deck, tmp_path / "run", "preserving", cells.Run(1e-5, 1000, 10, 1))
    assert info["status"] == "not converged"
    assert 100 < info["outputTimes"] == info["output_times_found"] < 1000
    assert cells.judge(info, None, 1.0, 1.0) == cells.FAILED
    assert "beyond what a computer holds" in info["message"]


def test_a_run_that_takes_too_long_is_stopped_and_keeps_its_rows(cells, extreme, tmp_path):
    run = cells.Run(1e-6, 100_000_000, 1, 1000)
    deck = extreme.FAMILIES["long_run"].path
    info = cells.run_deck(deck, tmp_path / "run", "preserving", run, bound=2.0)
    assert info["status"] == "interrupted"
    assert 0 < info["steps"] < run.n
    assert info["outputTimes"] == info["output_times_found"] > 1
    assert cells.judge(info, None, 1.0, 1.0) == cells.LATE


def test_rows_that_are_lost_are_a_failure(cells):
    extremes = {
        "energyAtStart": 1e4,
        "largestKineticEnergy": 1.0,
        "energyErrorMax": 1e-10,
        "constraintViolationMax": 1e-10,
    }
    info = {"status": "completed", "outputTimes": 5, "output_times_found": 5, "extremes": extremes}
    assert cells.judge(info, 0.5, 1.0, 1.0) == cells.GOOD
    assert cells.judge(info, 2.0, 1.0, 1.0) == cells.COARSE
    assert cells.judge({**info, "output_times_found": 4}, 0.5, 1.0, 1.0) == cells.FAILED
    for figure in ("energyErrorMax", "constraintViolationMax"):
        worse = {**info, "extremes": {**extremes, figure: 1e-8}}
        assert cells.judge(worse, 0.5, 1.0, 1.0) == cells.DOUBTFUL


@pytest.mark.parametrize(("scheme", "kept"), [("decaying", 1e-9), ("gauss3", 1e-3)])
def test_energy_is_asked_of_a_scheme_as_it_keeps_it(scheme, kept, cells):
    """Order 2 by forces that give what they take, higher orders as well as they keep positions."""
    assert cells.energy_asked(scheme) == kept
    for part, outcome in ((0.9, cells.GOOD), (1.1, cells.DOUBTFUL)):
        extremes = {
            "energyAtStart": 1.0,
            "largestKineticEnergy": 1.0,
            "energyErrorMax": part * kept,
            "constraintViolationMax": 0.0,
        }
        info = {
            "status": "completed",
            "outputTimes": 5,
            "output_times_found": 5,
            "extremes": extremes,
        }
        assert cells.judge(info, 0.5, 1.0, 1.0, kept) == outcome


@pytest.mark.parametrize("scheme", TOLD)
def test_the_condition_is_the_same_at_any_step(scheme, cells, extreme):
    """Of a pendulum: scaled, as it is solved."""
    model = read_deck(extreme.FAMILIES["long_run"].path)
    found = [cells.condition(model, dt, scheme) for dt in (1e-6, 1e-3, 1e-1)]
    # At a tenth of a second it rotates by some percent of a radian a step.
    assert found == pytest.approx([found[0]] * 3, rel=0.01)
    assert 1.0 < found[0] < 1e3


def test_a_restart_from_the_last_row_goes_on(cells):
    """Order 2 against the complete solution: 4e-5 m at 0.01 s of a swing of 1 m."""
    made = cells.run_restarts("extreme/inverted", ("preserving",), (1e-2,))
    assert [(cell.outcome, cell.compared) for cell in made] == [(cells.GOOD, 2.0)]


def test_cells_come_back_from_their_file(cells, stability, tmp_path):
    made = cells.run_group("stiff_spring", 1e-3, ("preserving",), (1e-2,))
    told = [replace(cell, verdict="WARN", failed_checks="one two") for cell in made]
    told += cells.run_restarts("basics/torque_free", ("decaying",), (1e-1,))
    path = tmp_path / "cells.csv"
    stability.write_cells(path, told)
    for back, cell in zip(stability.read_cells(path), told, strict=True):
        for name, value in asdict(cell).items():
            # The file has six digits.
            wanted = pytest.approx(value, rel=1e-5) if isinstance(value, float) else value
            assert getattr(back, name) == wanted, name


def test_schemes_can_be_run_alone(stability, tmp_path, monkeypatch):
    """Their cells are made anew, all others stay as they were kept."""
    with KEPT.open() as stream:
        kept = [line for line in stream if line.startswith(("family", "spin,10,"))]
    path, told = tmp_path / "cells.csv", []
    path.write_text("".join(kept))

    def run_all(names, schemes):
        told.append((names, schemes))
        old = [c for c in stability.read_cells(path) if c.family in names and c.scheme in schemes]
        yield "", [replace(cell, outcome="made anew") for cell in old]

    for name, value in (("CSV", path), ("run_all", run_all)):
        monkeypatch.setattr(stability, name, value)
    monkeypatch.setattr(stability_page, "write_page", told.append)
    before = stability.read_cells(path)
    stability.main(["spin", "decaying"])
    assert told[0] == (["spin"], ["decaying"])
    after = stability.read_cells(path)
    assert [replace(c, outcome="") for c in after] == [replace(c, outcome="") for c in before]
    changed = {new.scheme for old, new in zip(before, after, strict=True) if old != new}
    assert changed == {"decaying"}
    with pytest.raises(SystemExit, match="no family or scheme radau9"):
        stability.main(["radau9"])


def test_the_verdict_of_a_run_is_taken_up(cells):
    info = {
        "status": "completed",
        "outputTimes": 1,
        "output_times_found": 1,
        "extremes": {
            "energyAtStart": 0.0,
            "largestKineticEnergy": 0.0,
            "energyErrorMax": 0.0,
            "energyErrorMaxRelative": None,
            "constraintViolationMax": 0.0,
            "constraintViolationRateMax": 0.0,
        },
        "iterations": 3,
        "subsystems": 1,
        "steps": 1,
        "verdict": {
            "word": "WARN",
            "checks": {
                "completion": {"word": "PASS"},
                "accuracy": {"word": "WARN"},
                "rotation": {"word": "WARN"},
            },
        },
    }
    task = cells.Task("spin", 1.0, "decaying", cells.Run(1.0, 1, 1, 1), 1.0, 1.0)
    made = cells.cell(task, info, "exact", cells.UNKNOWN, None)
    assert (made.verdict, made.failed_checks) == ("WARN", "accuracy rotation")


def test_verdicts_tell_good_runs_from_bad():
    """Over the kept table: nothing passes that errs by more than ten tolerances, and what fails
    within the tolerance has lost its energy.
    """
    with KEPT.open(newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["accuracy_verdict"]]
    assert len(rows) > 1000
    for row in rows:
        error = max(float(row["error"]), float(row["rotation_error"])) / float(row["tolerance"])
        if row["accuracy_verdict"] == "PASS":
            assert error <= 10.0, row
        if row["accuracy_verdict"] == "FAIL" and error <= 1.0:
            assert "energy" in row["accuracy_failures"].split(), row
            assert float(row["energy"]) > 1e-3 or row["outcome"] == "out of time", row


def test_the_kept_table_is_complete():
    """Every scheme and step of every value, no nan, no row lost but by a run stopped by force."""
    with KEPT.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert not {"nan", "inf", "-inf"} & {text for row in rows for text in row.values()}
    values = dict.fromkeys((row["family"], row["value"]) for row in rows)
    steps = dict.fromkeys(row["dt"] for row in rows)
    assert len(steps) == 7
    places = [(row["family"], row["value"], row["scheme"], row["dt"]) for row in rows]
    assert sorted(places) == sorted((*v, s, dt) for v in values for s in TOLD for dt in steps)
    for row in rows:
        if row["outcome"] != "out of time":
            assert row["output_times"] == row["output_times_found"], row

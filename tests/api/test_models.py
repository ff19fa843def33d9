"""Models from Python: what is read, changed and run, and how faults are reported."""

import pickle
import subprocess
import sys
from typing import get_type_hints
from xml.etree import ElementTree

import numpy as np
import pytest
from click.testing import CliRunner
from lxml import etree

import msahl
from msahl.api.options import RunOptions
from msahl.cli.main import main
from msahl.results.read import read_table
from msahl.run.options import OPTIONS
from tests.support.models import ROOT

SINGLE = ROOT / "decks" / "thesis" / "single_pendulum_45.xml"
DOUBLE = ROOT / "decks" / "thesis" / "double_pendulum_89.xml"
FOUR_BAR = ROOT / "decks" / "mechanisms" / "four_bar.xml"
LOADS = ROOT / "decks" / "basics" / "loads.xml"
PENDULUM = ROOT / "msahl" / "deck" / "templates" / "pendulum.xml"

COMMANDS = {
    "single": (SINGLE, {"t_final": 0.5}, {}),
    "double, coarse": (DOUBLE, {"t_final": 0.5, "dt": 0.01, "every": 3}, {}),
    "four bars by gauss": (FOUR_BAR, {"t_final": 0.2, "scheme": "gauss3"}, {}),
    "loads": (LOADS, {"t_final": 0.2, "accelerations": "yes"}, {}),
    "to a tolerance": (DOUBLE, {"t_final": 0.3, "scheme": "auto", "tolerance": 1e-5}, {}),
    "other numbers": (SINGLE, {"t_final": 0.3}, {"PendulumBob.mass": "3 kg"}),
}


def words(options, changes):
    """The command line that gives these options and changes."""
    for name, value in options.items():
        yield from (f"--{name.replace('_', '-')}", str(value))
    for name, value in changes.items():
        yield from ("--set", f"{name}={value}")


@pytest.mark.parametrize(("deck", "options", "changes"), COMMANDS.values(), ids=COMMANDS)
def test_tables_and_files_are_those_of_the_command(tmp_path, deck, options, changes):
    result = msahl.load(deck, **changes).run(**options)
    command = ["run", str(deck), "-o", str(tmp_path / "command"), *words(options, changes)]
    assert CliRunner().invoke(main, command).exit_code in (0, 1)
    assert result.write(tmp_path / "own") == tmp_path / "own"
    files = {path.name for path in (tmp_path / "command").iterdir()}
    assert {path.name for path in (tmp_path / "own").iterdir()} == files
    for name in files - {"run.json"}:
        written = (tmp_path / "own" / name).read_bytes()
        assert written == (tmp_path / "command" / name).read_bytes(), name
    for name in result.tables:
        table = read_table(tmp_path / "command" / f"{name}.csv")
        assert result.columns(name) == list(table.columns)
        assert np.array_equal(result.array(name), table.to_numpy())
    told, same = (msahl.read(tmp_path / name).report for name in ("command", "own"))
    told.pop("seconds"), same.pop("seconds")
    assert told == same


def test_every_option_of_a_run_is_a_keyword():
    assert get_type_hints(RunOptions).keys() == {o.name for o in OPTIONS} | {"stop_when"}


def test_a_deck_is_a_path_a_text_or_an_element():
    text = SINGLE.read_text()
    decks = (
        SINGLE,
        str(SINGLE),
        SINGLE.read_bytes(),
        text,
        f'\n<?xml version="1.0" encoding="ISO-8859-1"?>{text.partition("?>")[2]}',
        etree.fromstring(SINGLE.read_bytes()),
        ElementTree.fromstring(SINGLE.read_bytes()),
    )
    models = [msahl.load(deck) for deck in decks]
    assert all(model.records == models[0].records for model in models)
    assert models[0].xml == SINGLE.read_bytes()


def test_numbers_are_changed_by_name_and_the_last_value_counts():
    model = msahl.load(FOUR_BAR)
    heavy = model.with_(**{"Crank.mass": 7})
    assert [body.mass for body in heavy.records.bodies if body.name == "Crank"] == [7.0]
    back = heavy.with_(**{"Crank.mass": np.float64(2.5)}).with_(**{"simulation.deltaT": 0.02})
    assert [body.mass for body in back.records.bodies if body.name == "Crank"] == [2.5]
    assert back.records.simulation.dt == 0.02
    assert model.records == msahl.load(FOUR_BAR).records


PART = """<part><parameters><parameter name="m" units="kg">2</parameter></parameters>
<system><bodies><rigidBody><name>Bob</name><mass>{m}</mass>
<moi><Ixx>.1</Ixx><Iyy>.1</Iyy><Izz>.1</Izz></moi></rigidBody></bodies></system></part>"""
INCLUDING = """<data><parameters><parameter name="L" units="m">1</parameter></parameters>
<includes><include href="bob.xml" prefix="A."/></includes>
<system><bodies><rigidBody><name>Own</name><mass>1</mass>
<moi><Ixx>.1</Ixx><Iyy>.1</Iyy><Izz>.1</Izz></moi>
<initialConditions><position><z>{2*L}</z></position></initialConditions></rigidBody></bodies>
</system><simulation><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation></data>"""


def test_parameters_and_parts_are_changed_without_reading_files_again(tmp_path):
    (tmp_path / "bob.xml").write_text(PART)
    (tmp_path / "deck.xml").write_text(INCLUDING)
    model = msahl.load(tmp_path / "deck.xml", L=0.5)
    assert model.parameters["L"] == {"value": 0.5, "units": "m"}
    (tmp_path / "bob.xml").unlink()
    other = model.with_(L="80 cm", **{"A.m": 5})
    masses = {body.name: body.mass for body in other.records.bodies}
    assert masses == {"Own": 1.0, "A.Bob": 5.0}
    assert other.records.bodies[0].position == (0.0, 0.0, 1.6)
    assert b"<name>A.Bob</name>" in other.xml


@pytest.mark.slow
def test_all_faults_of_a_deck_are_raised(tmp_path):
    text = SINGLE.read_text().replace("<mass", "<mess").replace("</mass", "</mess")
    with pytest.raises(msahl.DeckError) as caught:
        msahl.load(text.replace("Earth</name>", "Mars</name>", 1))
    assert len(caught.value.faults) >= 2
    assert all(fault.file == "<deck>" and fault.line for fault in caught.value.faults)
    with pytest.raises(msahl.DeckError, match=r"no_such.xml: cannot be read"):
        msahl.load(tmp_path / "no_such.xml")
    with pytest.raises(msahl.DeckError, match=r"xml: PendulumBib.mass=3: .*did you mean Pend"):
        msahl.load(SINGLE, **{"PendulumBib.mass": 3})
    with pytest.raises(msahl.DeckError, match=r"xml: PendulumBob.mass=-1.0: body 'Pend.*', mass"):
        msahl.load(SINGLE, **{"PendulumBob.mass": -1.0})


@pytest.mark.parametrize("value", [True, float("nan"), None, (1.0,)])
def test_a_value_is_a_number_or_a_text(value):
    with pytest.raises(ValueError, match=r"PendulumBob.mass: it is .*; give a finite number"):
        msahl.load(SINGLE, **{"PendulumBob.mass": value})


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"damp": 0.1}, "damp: there is no such option; did you mean damping"),
        ({"dt": "0.1"}, "dt: it is '0.1'; it must be a finite number"),
        ({"dt": float("inf")}, "dt: it is inf; it must be a finite number"),
        ({"dt": True}, "dt: it is True"),
        ({"dt": -1.0}, "deltaT: it is -1 s; it must be greater than zero"),
        ({"damping": 2}, "damping: it is 2; it must be a number from 0 to 1"),
        ({"accuracy": 0}, "accuracy: it is 0; it must be a finite number greater than 0"),
        ({"every": 0}, "every: it is 0; it must be an integer from 1"),
        ({"every": 1.5}, "every: it is 1.5; it must be an integer"),
        ({"scheme": "euler"}, "scheme: it is 'euler'; it must be one of preserving"),
        ({"full": 1}, "full: it is 1; it must be True or False"),
        ({"tolerance": 1e-6}, "the preserving scheme takes the steps it is given"),
        ({"scheme": "auto", "solver": "root"}, "solver root takes steps of a given size"),
        ({"scheme": "auto", "error": "off"}, "error off: a tolerance of the global error"),
    ],
)
def test_wrong_options_are_value_errors_in_words(options, message):
    with pytest.raises(ValueError, match=message) as caught:
        msahl.load(SINGLE).run(**options)
    assert isinstance(caught.value, msahl.OptionError)


def test_all_wrong_options_are_reported_at_once():
    with pytest.raises(msahl.OptionError) as caught:
        msahl.load(SINGLE).run(every=0, scheme="euler", nonsense=1)
    assert len(caught.value.faults) == 3


def test_options_that_are_none_are_not_given():
    assert msahl.load(SINGLE).job(dt=None, full=None).settings == msahl.load(SINGLE).job().settings


def test_a_run_may_end_at_a_condition():
    result = msahl.load(SINGLE).run(stop_when="t > 0.055", dt=0.01)
    assert result.report["stop"]["time"] == pytest.approx(0.055, abs=1e-9)
    assert result.time[-1] == result.report["stop"]["time"]


def test_no_consistent_start_is_an_exception():
    with pytest.raises(msahl.StartError):
        msahl.load(SINGLE).run(stop_when="t > -1")


def test_models_can_be_sent_to_other_processes():
    model = msahl.load(SINGLE, **{"PendulumBob.mass": 3})
    copy = pickle.loads(pickle.dumps(model))
    assert copy.records == model.records
    assert copy.changes == model.changes


def test_a_model_shows_itself():
    model = msahl.load(SINGLE, **{"PendulumBob.mass": "3 kg"})
    assert repr(model).endswith("single_pendulum_45.xml', PendulumBob.mass='3 kg')")
    assert "<th style='text-align:left'>bodies</th><td style='text-align:left'>1</td>" in (
        model._repr_html_()
    )


def test_importing_msahl_imports_nothing_else():
    code = "import sys, msahl; print([m for m in sys.modules if m in ('numpy', 'lxml', 'pandas')])"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"
    assert set(msahl.__all__) <= set(dir(msahl))
    with pytest.raises(AttributeError, match="'msahl' has no attribute 'nonsense'"):
        msahl.nonsense  # noqa: B018


def test_a_run_without_frames_or_pictures_imports_neither_pandas_nor_matplotlib():
    code = (
        "import sys, msahl; r = msahl.load(sys.argv[1]).run(dt=0.1, t_final=1); r['PendulumBob.z'];"
        "print([m for m in sys.modules if m in ('matplotlib', 'numba', 'pandas', 'xmlschema')])"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code, str(SINGLE)], capture_output=True, text=True, check=True
    )
    assert ran.stdout == "[]\n"


def test_anything_but_a_deck_is_refused():
    with pytest.raises(msahl.OptionError, match="bytes or its root element, not int"):
        msahl.load(5)

"""Columns against time, phase plots, comparisons of runs, and paths in space."""

import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.deck import read_deck
from msahl.expressions.syntax import Number
from msahl.model.loads import JointActuator
from msahl.model.signals import Signal
from msahl.post.cli import main
from msahl.post.columns import all_columns, matching
from msahl.post.draw import encode, style
from msahl.post.histories import histories, phase, run_labels
from msahl.post.paths import paths_in_space, widest_plane
from msahl.post.run_graphs import GRAPHS, Choice
from msahl.post.run_report import HISTORIES
from msahl.post.view.columns import columns_of_run
from msahl.results.read import read_run
from msahl.results.sample import read_sample
from msahl.run.column_units import UNKNOWN, quantity
from msahl.run.tables import error_columns, tables_of_model
from tests.support.models import ROOT
from tests.support.run_folders import conical_rows, write

DECKS = sorted((ROOT / "decks").glob("*/*.xml"))


@pytest.fixture
def folder(tmp_path):
    write(tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def run(folder):
    return read_run(folder)


def call(*words):
    return CliRunner().invoke(main, [str(word) for word in words])


def labels(figure):
    return [axes.get_ylabel().replace("\n", " ") for axes in figure.axes]


def drawn(figure):
    """The labels of all curves."""
    return [line.get_label() for axes in figure.axes for line in axes.get_lines()]


@pytest.mark.parametrize("deck", DECKS, ids=lambda path: path.stem)
def test_every_column_of_every_deck_has_a_quantity(deck):
    model = read_deck(deck)
    columns = [name for names in tables_of_model(model).values() for name in names]
    for column in [*columns, *error_columns(model)]:
        found = quantity(column, model)
        assert found != UNKNOWN, column
        assert found.unit, column
        assert " or " not in found.unit, column


@pytest.mark.parametrize(
    ("column", "shown"),
    [
        ("Bob.vx", "velocity [m/s]"),
        ("Bob.alphaz", "angular acceleration [rad/s^2]"),
        ("Hinge.angle2Rate", "rate of angle [rad/s]"),
        ("Slide.slideAcceleration", "acceleration of slide [m/s^2]"),
        ("Hinge.Mz", "moment [N m]"),
        ("All.Lx", "angular momentum [kg m^2/s]"),
        ("A.b.x", "position [m]"),
        ("phase1", "signal [SI]"),
    ],
)
def test_quantities(column, shown):
    assert str(quantity(column)) == shown


def test_columns_of_one_quantity_share_a_panel(run):
    with style():
        name, figure = histories([run], ["Bob.*", "Pivot.F?"])
        encode(figure, "png")
    assert name == "columns"
    assert sorted(labels(figure)) == [
        "angular velocity [rad/s]", "force [N]", "orientation parameter [-]", "position [m]",
        "velocity [m/s]",
    ]  # fmt: skip
    shown = drawn(figure)
    assert shown[:3] == ["Bob.x", "Bob.y", "Bob.z"]
    # The bob circles: seen in its own axes, it moves along y only.
    assert [name for name in shown if ".v" in name] == ["Bob.vy"]
    assert "zero or nearly so: Bob.vx, Bob.vz, Bob.wy" in figure.get_suptitle().replace("\n", " ")


def test_a_curve_is_the_column(run):
    with style():
        _, figure = histories([run], ["Bob.x"])
    (line,) = figure.axes[0].get_lines()
    np.testing.assert_array_equal(line.get_xdata(), run.time)
    np.testing.assert_array_equal(line.get_ydata(), run.states["Bob.x"])


def test_the_curve_of_an_orientation_breaks_at_its_jumps(run):
    values = run.states["Bob.P2"].to_numpy(copy=True)
    values[20:] -= 8.0
    run.states["Bob.P2"] = values
    with style():
        _, figure = histories([run], ["Bob.P2"])
    assert [len(line.get_xdata()) for line in figure.axes[0].get_lines()] == [20, 21]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["Bob.P2"]


def test_many_signals_share_panels_by_their_names(run):
    names = [f"{what}{k}" for what in ("torque", "target") for k in range(1, 5)]
    table = run.states[["time"]].assign(**dict.fromkeys(names, run.time + 1.0))
    run.others["signals"] = table
    with style():
        _, figure = histories([run], ["torque?,target?"])
    assert [len(axes.get_lines()) for axes in figure.axes] == [4, 4]


def test_runs_are_compared_panel_by_panel(tmp_path, run):
    states, reactions = conical_rows()
    write(tmp_path / "other" / "run", states[:30], reactions[:30])
    both = [run, read_run(tmp_path / "other" / "run")]
    assert run_labels(both) == ["run", "other/run"]
    with style():
        _, figure = histories(both, ["Bob.x,Bob.y"])
    assert labels(figure) == ["Bob.x [m]", "Bob.y [m]"]
    assert [len(line.get_xdata()) for line in figure.axes[0].get_lines()] == [41, 30]
    assert drawn(figure) == 2 * run_labels(both)


def test_phase_plot(run):
    with style():
        name, figure = phase([run], "Bob.x", "Bob.vy")
    (axes,) = figure.axes
    assert (name, axes.get_xlabel(), axes.get_ylabel()) == ("phase", "Bob.x [m]", "Bob.vy [m/s]")
    np.testing.assert_array_equal(axes.get_lines()[0].get_ydata(), run.states["Bob.vy"])


def test_paths_in_space_are_at_equal_scales(run):
    run.states["Bob.z"] += np.linspace(0.0, 1.0, len(run.states))
    with style():
        _, figure = paths_in_space([run], ["Bob"])
        encode(figure, "png")
    (axes,) = figure.axes
    box = axes.get_box_aspect() if hasattr(axes, "get_box_aspect") else None
    ranges = np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)
    shape = np.asarray(axes._box_aspect) / ranges
    np.testing.assert_allclose(shape, shape[0], rtol=1e-12, err_msg=str(box))
    assert axes.zaxis_inverted()  # gravity is along +z of this deck, and points down


@pytest.mark.parametrize(
    ("spans", "plane"),
    [((1.0, 0.0, 2.0), "xz"), ((0.0, 1.0, 1.0), "yz"), ((3.0, 2.0, 1.0), "xy"), ((0, 0, 0), "xz")],
)
def test_the_plane_is_that_of_the_largest_extents(spans, plane):
    assert widest_plane(np.array([[0.0, 0.0, 0.0], spans], dtype=float)) == plane


def test_names_with_signs_of_patterns(tmp_path, run):
    run.states.insert(1, "Bar [1].x", 0.0)
    assert matching(run, ["Bar [1].x"]) == ["Bar [1].x"]
    assert matching(run, ["Bar*.x"]) == ["Bar [1].x"]


def test_the_command_draws_what_it_is_asked_for(folder, tmp_path):
    words = ("--columns", "Bob.v*", "--phase", "Bob.x", "Bob.y", "--phase", "time", "Bob.y")
    result = call("plot", folder, *words, "-o", tmp_path / "out", "--format", "svg")
    assert result.exit_code == 0, result.output
    names = [line.rpartition("/")[2] for line in result.stdout.splitlines()]
    assert names == ["columns.svg", "phase.svg", "phase-2.svg"]
    result = call("plot", folder, "path", "--format", "pdf", "-o", tmp_path / "out")
    pdf = (tmp_path / "out" / "path-xy.pdf").read_bytes()
    assert pdf.startswith(b"%PDF")
    assert b"CreationDate" not in pdf


def test_several_runs(folder, tmp_path):
    write(tmp_path / "other")
    result = call("plot", folder, tmp_path / "other", "-o", tmp_path / "out")
    assert result.stdout.strip() == str(tmp_path / "out" / "path-xy.png")
    result = call("plot", folder, tmp_path / "other", "energy")
    assert result.exit_code == 2
    assert "a picture of energy shows one run only" in result.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--columns", "Bbo.*"), "no column matches 'Bbo.*'; its columns are of: Bob, Pivot"),
        (("--phase", "Bob.x", "Bob.q"), "no column 'Bob.q'"),
        (("bogus",), "'bogus' is neither a folder nor a kind of picture (linkage, path, path3d,"),
        (("path3d",), "the paths lie in a plane; draw them with: path"),
    ],
)
def test_faults_are_one_sentence(folder, words, message):
    result = call("plot", folder, *words)
    assert result.exit_code == 2
    assert message in re.sub(r"\s+", " ", result.stderr)
    assert "Traceback" not in result.stderr


@pytest.fixture
def defined(run):
    """A run with an actuator, two signals, two markers and loads of a given motion."""
    time = run.states[["time"]]
    ramp = run.time.copy()
    signals = time.assign(**{"voltage": ramp, "far": 1e6 * ramp, "Motor.load": ramp})
    markers = time.assign(**{
        f"{name}.{end}": scale * ramp + k
        for k, name in enumerate(("Tip", "Root"))
        for end, scale in (("x", 1.0), ("y", 0.0), ("vx", 2.0), ("q0", 1.0))
    })  # fmt: skip
    drives = time.assign(**{
        "Pivot.angle.load": ramp, "Pivot.angle.error": 0.01 * ramp, "missingForce": 0.0 * ramp,
    })  # fmt: skip
    markers[["Tip.y", "Root.y"]] = 0.0
    motor = JointActuator("Motor", "Pivot", "angle", Number(0.0))
    model = replace(
        run.model,
        signals=(Signal("voltage", Number(0.0), "N-m/A-sec"), Signal("far", Number(0.0))),
        loads=(motor,),
    )
    return replace(run, model=model, drives=drives, others={"signals": signals, "markers": markers})


def test_what_a_deck_defines_comes_first(defined):
    kinds = list(GRAPHS)
    assert kinds[:4] == ["drives", "signals", "markers", "groups"] == list(HISTORIES[:4])
    titles = {
        kind: [graph.title for graph in GRAPHS[kind](defined, None, Choice()).graphs]
        for kind in kinds[:4]
    }
    assert titles == {
        "drives": ["load [N m]", "error bar [N m]"],  # no force is missing
        "signals": ["load [N m]", "voltage [N m/A s]", "far"],
        "markers": ["x [m]", "vx [m/s]"],
        "groups": [],
    }
    curves = GRAPHS["markers"](defined, None, Choice()).graphs[0].curves
    assert [name for name, _ in curves] == ["Tip", "Root"]


def test_columns_of_every_table_are_found(defined, folder):
    frames = [defined.states, *defined.others.values(), defined.drives]
    names = [name for frame in frames for name in frame.columns[1:]]
    assert set(names) < set(all_columns(defined))
    assert matching(defined, ["Pivot.angle.*", "missing*"]) == [*defined.drives.columns[1:]]
    info = {"inverse": {}}
    write(folder, info=info)
    defined.drives.to_csv(folder / "drives.csv", index=False)
    assert "missingForce" in all_columns(read_run(folder))
    assert "missingForce" in columns_of_run(read_sample(folder, 1000, 1000)).names
    # A later run into the same folder has no drives.
    write(folder)
    assert "missingForce" not in all_columns(read_run(folder))


def test_signals_are_labelled_with_their_units(defined):
    with style():
        _, figure = histories([defined], ["voltage,far"])
    assert labels(figure) == ["signal [N m/A s]", "signal [SI]"]

"""Motion of markers, distances and angles, and momentum and energy of groups of bodies."""

from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import rotations
from msahl.algebra.vector import ZERO
from msahl.check import check
from msahl.check.directions import frame, unit
from msahl.cli.main import main
from msahl.deck import DeckError, read_deck
from msahl.model import Group, Marker, MarkerAngle, MarkerDistance
from msahl.post.events import crossings
from msahl.results.read import read_run
from msahl.run.tables import JOINTS, MARKERS, SYSTEM
from msahl.system.names import coordinate_columns, group_columns, marker_columns, work_columns
from tests.support.models import ROOT, deck, free_bodies, jointed, loaded, simulate


def with_markers(model, rng, **others):
    """A marker on each body, the last one in the axes of the first body, and one on the ground."""
    markers = [
        Marker(
            f"M{i}",
            body.name,
            tuple(rng.normal(size=3)),
            frame(unit(tuple(rng.normal(size=3)))),
            model.bodies[0].name if body is model.bodies[-1] else "",
        )
        for i, body in enumerate(model.bodies)
    ]
    sensors = (MarkerDistance("D", "M0", "M1"), MarkerAngle("W", "M0", "M1", "M2"))
    return replace(model, markers=tuple(markers), sensors=sensors, **others)


def column(run, name):
    table, names = (
        (run.others[MARKERS], marker_columns(run.model))
        if name in marker_columns(run.model)
        else (run.others[SYSTEM], group_columns(run.model))
    )
    return table[:, names.index(name)]


def vector(run, name, letters):
    return np.stack([column(run, f"{name}.{letter}") for letter in letters], axis=1)


def part(name, text):
    """The deck of markers with something of it replaced."""
    deck_text = (ROOT / "decks" / "basics" / "markers.xml").read_text()
    assert name in deck_text
    return deck_text.replace(name, text, 1)


POSITION, VELOCITY, ACCELERATION = ("x", "y", "z"), ("vx", "vy", "vz"), ("ax", "ay", "az")


def test_the_deck_of_markers_moves_as_its_header_says():
    run = simulate(deck("markers"))
    t = run.time
    circle = np.stack([0.5 * np.cos(2 * t), 0.5 * np.sin(2 * t), 0.0 * t], axis=1)
    # The scheme of order 2 rotates by 2 tan(h) and not by 2 h: 3e-5 rad/s too much, in 2 s.
    assert vector(run, "Tip", POSITION) == pytest.approx(circle, abs=1e-12)
    assert vector(run, "Sensor", ACCELERATION) == pytest.approx(
        np.broadcast_to((-2.0, 0.0, 0.0), (t.size, 3)), abs=1e-3
    )
    assert column(run, "Reach.distance") == pytest.approx(np.sqrt(1.25 - np.cos(2 * t)), abs=1e-12)
    assert column(run, "Swing.angle") == pytest.approx(np.pi - abs(np.pi - 2 * t), abs=1e-7)
    for name, value in (("px", -1.5), ("Lz", 0.125), ("kinetic", 0.5)):
        expected = value * np.sin(2 * t) if name == "px" else np.full(t.size, value)
        assert column(run, f"Everything.{name}") == pytest.approx(expected, abs=1e-3)
    potential = 7.3575 * np.sin(2 * t)
    assert column(run, "Everything.potential") == pytest.approx(potential, abs=1e-10)
    q = vector(run, "Sensor", ("q0", "q1", "q2", "q3"))
    assert q[0] == pytest.approx((np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)), abs=1e-15)
    assert (q[:, 0] >= 0.0).all()


@pytest.mark.parametrize("scheme", ["preserving", "gauss3"])
def test_velocities_and_accelerations_are_derivatives_of_positions(scheme):
    """Central differences over 1 ms: of order 2 in the interval, as the scheme's own error."""
    model = with_markers(jointed(np.random.default_rng(1)), np.random.default_rng(2))
    model = replace(model, markers=tuple(replace(m, basis="") for m in model.markers))
    h = 1e-3
    run = simulate(model, dt=h, t_final=0.3, scheme=scheme)
    for marker in model.markers:
        x, v, a = (vector(run, marker.name, of) for of in (POSITION, VELOCITY, ACCELERATION))
        scale = np.abs(a).max()
        assert v[1:-1] == pytest.approx((x[2:] - x[:-2]) / (2 * h), abs=2e-4 * scale)
        # An acceleration changes within a tenth of a second here: (h/0.1)^2 of its size.
        assert a[1:-1] == pytest.approx((v[2:] - v[:-2]) / (2 * h), abs=2e-3 * scale)
    for name in ("D.distance", "W.angle"):
        values, rates = column(run, name), column(run, f"{name}Rate")
        size = np.abs(rates).max()
        assert rates[1:-1] == pytest.approx((values[2:] - values[:-2]) / (2 * h), abs=2e-3 * size)


def test_markers_are_where_the_states_put_them():
    model = with_markers(free_bodies(np.random.default_rng(3)), np.random.default_rng(4))
    run = simulate(model, dt=0.01, t_final=0.5)
    for i, marker in enumerate(model.markers):
        R = rotations(run.of("orientation", i))
        x = run.of("position", i) + R @ np.array(marker.point)
        w = (R @ run.of("spin", i)[..., None])[..., 0]
        v = (R @ run.of("velocity", i)[..., None])[..., 0] + np.cross(w, R @ np.array(marker.point))
        into = np.broadcast_to(np.eye(3), R.shape)
        if marker.basis:
            into = np.swapaxes(rotations(run.of("orientation", 0)), 1, 2)
        for expected, of in ((x, POSITION), (v, VELOCITY)):
            found = vector(run, marker.name, of)
            assert found == pytest.approx((into @ expected[..., None])[..., 0], abs=1e-12)
        axes = np.array(marker.axes)
        own = vector(run, marker.name, ("wx", "wy", "wz"))
        assert own == pytest.approx(run.of("spin", i) @ axes.T, abs=1e-12)
        q0, *q = vector(run, marker.name, ("q0", "q1", "q2", "q3")).T
        P = 4.0 * np.array(q) / (1.0 + q0)
        found = np.array([matrix(tuple(p)) for p in P.T])
        assert found == pytest.approx(R @ axes.T, abs=1e-12)


def test_momentum_of_free_bodies_is_constant():
    model = free_bodies(np.random.default_rng(5), gravity=False)
    groups = (Group("All"), Group("One", (model.bodies[0].name,)))
    run = simulate(replace(model, groups=groups), dt=0.01, t_final=2.0)
    for name in ("All", "One"):
        p, L = (vector(run, name, letters) for letters in (("px", "py", "pz"), ("Lx", "Ly", "Lz")))
        assert p == pytest.approx(np.broadcast_to(p[0], p.shape), rel=1e-12)
        # The sum of all angular momenta is small against each of them.
        assert np.abs(L - L[0]).max() <= 1e-10 * np.abs(L).max()


def test_energies_are_those_of_the_balance():
    """Kinetic and potential energy, less the work of loads, are constant in the scheme of order 2;
    the group of all bodies has the elastic energy as well."""
    model = replace(loaded(np.random.default_rng(6)), groups=(Group("All"),))
    run = simulate(model, dt=0.002, t_final=0.5)
    names = work_columns(model)
    work = sum(run.work[:, i] for i, name in enumerate(names) if name.endswith(".work"))
    total = column(run, "All.kinetic") + column(run, "All.potential") - work
    assert total == pytest.approx(np.full(run.time.size, total[0]), abs=1e-11 * np.abs(total).max())


def test_groups_are_parts_of_the_sum():
    model = jointed(np.random.default_rng(7))
    names = [body.name for body in model.bodies]
    groups = (Group("All"), Group("Some", tuple(names[:1])), Group("Rest", tuple(names[1:])))
    run = simulate(replace(model, groups=groups), dt=0.01, t_final=0.3)
    for value in ("px", "py", "pz", "kinetic", "potential"):
        parts = column(run, f"Some.{value}") + column(run, f"Rest.{value}")
        assert column(run, f"All.{value}") == pytest.approx(parts, rel=1e-12, abs=1e-12)


def test_expressions_read_the_values_of_the_table(tmp_path):
    values = ("Tip.x", "Tip.vy", "Sensor.q3", "Sensor.wz", "Pivot.angle", "Pivot.angleRate")
    signals = "".join(f'<signal name="s{i}">{{{v}}}</signal>' for i, v in enumerate(values))
    text = part("<markers>", f"<signals>{signals}</signals><markers>")
    (tmp_path / "deck.xml").write_text(text)
    run = simulate(read_deck(tmp_path / "deck.xml"), dt=0.01, t_final=0.5)
    for i, value in enumerate(values):
        table = run.others[JOINTS]
        names = coordinate_columns(run.model, 3)
        known = table[:, names.index(value)] if value in names else column(run, value)
        assert run.column(f"s{i}") == pytest.approx(known, abs=1e-13), value


def test_tables_are_written_and_read(tmp_path):
    path, out = ROOT / "decks" / "basics" / "markers.xml", tmp_path / "run"
    result = CliRunner().invoke(main, ["run", str(path), "--t-final", "0.1", "-o", str(out)])
    assert result.exit_code == 0, result.output
    read, run = read_run(out), simulate(deck("markers"), t_final=0.1)
    for name in (MARKERS, SYSTEM, JOINTS):
        assert read.others[name].to_numpy().tobytes() == run.others[name].tobytes()
    assert run.others[MARKERS].shape[1] == len(marker_columns(read.model)) == 1 + 4 * 16 + 2 * 2
    (event,) = crossings(read, "Reach.distance", 0.51)
    assert event.time == pytest.approx(0.5 * np.arccos(1.25 - 0.51**2), abs=1e-9)


FAULTS = [
    ({"markers": (Marker("M", "Nobody", ZERO),)}, "body 'Nobody' is not a body"),
    ({"markers": (Marker("M", "Arm", ZERO, basis="X"),)}, "basis 'X' is not a body"),
    (
        {"markers": (Marker("M", "Arm", ZERO, ((1.0, 0.0, 0.0),) * 3),)},
        "marker 'M', axes: its rows must be three right-handed unit vectors",
    ),
    ({"sensors": (MarkerDistance("D", "Tip", "Tap"),)}, "'Tap' is not a marker of this model"),
    ({"sensors": (MarkerDistance("D", "Tip", "Tip"),)}, "a marker is named twice"),
    ({"sensors": (MarkerAngle("Tip", "Tip", "Origin", "Target"),)}, "the name is taken"),
    ({"groups": (Group("Arm"),)}, "the name is taken"),
    ({"groups": (Group("X", ("Base",)),)}, "'Base' is a ground, which has no mass"),
    ({"groups": (Group("X", ("Arm", "Arm")),)}, "'Arm' is named twice"),
    ({"groups": (Group("X", ("Y",)),)}, "body 'Y' is not a body of this model"),
]


@pytest.mark.parametrize(("changes", "message"), FAULTS)
def test_faults_of_models(changes, message):
    model = deck("markers")
    if "markers" in changes:
        changes = {"sensors": (), **changes}
    (fault,) = check(replace(model, **changes))
    assert message in str(fault)


DECK_FAULTS = {
    "unknown body": (
        part("<body>Arm</body>", "<body>Leg</body>"),
        "marker 'Tip': body 'Leg' is not a body of this model (bodies: Base, Arm)",
    ),
    "unknown basis": (
        part('basis="Arm"', 'basis="Leg"'),
        "marker 'Sensor': basis 'Leg' is not a body of this model (bodies: Base, Arm)",
    ),
    "unknown marker": (
        part("<to>Target</to>", "<to>Targe</to>"),
        "marker 'Reach', to: 'Targe' is not a marker of this model",
    ),
    "name of a body": (
        part("<name>Tip</name>", "<name>Arm</name>"),
        "marker 'Arm', name: the name is taken by line 25",
    ),
    "ground in a group": (
        part("<name>Everything</name>", "<name>Everything</name><body>Base</body>"),
        "group 'Everything': 'Base' is a ground, which has no mass; name rigid bodies",
    ),
    "body that is unknown in a group": (
        part("<name>Everything</name>", "<name>Everything</name><body>Legs</body>"),
        "group 'Everything': body 'Legs' is not a body of this model",
    ),
    "axis of zero": (
        part("<u3>1</u3>", "<u3>0</u3>"),
        "marker 'Sensor', orientation/eulerRotation: the axis (u1, u2, u3) is zero",
    ),
}


@pytest.mark.parametrize("name", DECK_FAULTS)
def test_faults_of_decks(name, tmp_path):
    text, message = DECK_FAULTS[name]
    (tmp_path / "deck.xml").write_text(text)
    with pytest.raises(DeckError) as caught:
        read_deck(tmp_path / "deck.xml")
    assert message in str(caught.value)

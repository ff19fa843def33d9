"""Contacts, impulses and marks of events that the viewer and graphs show."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.post.draw import draw_group
from msahl.post.metrics import compute_metrics
from msahl.post.page.graphs import graphs
from msahl.post.run_graphs import groups
from msahl.post.view import show_run, viewer_page
from msahl.post.view.happenings import MOST_MARKS, STATES, happenings, marks
from msahl.results.read import read_run
from tests.support.models import ROOT


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a function that runs a deck once and returns the folder."""
    found = {}

    def run(name):
        if name not in found:
            found[name] = tmp_path_factory.mktemp("runs") / name
            path = next(ROOT.glob(f"decks/*/{name}.xml"))
            done = CliRunner().invoke(main, ["run", str(path), "-q", "-o", str(found[name])])
            assert done.exit_code == 0, done.output
        return found[name]

    return run


def test_contacts_slide_and_then_stick(folder):
    run = read_run(folder("box_on_slope"))
    shown = happenings(run.model, run.events)
    assert [contact["name"] for contact in shown["contacts"]] == [
        c.name for c in run.model.contacts
    ]
    for contact, record in zip(shown["contacts"], run.model.contacts, strict=True):
        states = [STATES[state] for state in contact["states"]]
        assert (states[0], states[-1]) == ("open", "sticks")
        assert "slides" in states
        assert (np.diff(contact["times"]) >= 0.0).all()
        assert (contact["shape"], contact["axis"]) == ("plane", list(record.normal))
        assert (contact["parent"], contact["child"]) == (-1, 0)


def test_impulses_are_those_of_the_events(folder):
    run = read_run(folder("rocking_block"))
    shown = happenings(run.model, run.events)
    impacts = run.events[run.events.kind == "impact"]
    assert [i["time"] for i in shown["impulses"]] == impacts.time.tolist()
    names = [shown["contacts"][i["contact"]]["name"] for i in shown["impulses"]]
    assert names == impacts.element.tolist()
    assert [mark["name"] for mark in shown["marks"]] == [""] * len({*impacts.time})


def test_impulses_of_the_deck_have_a_place_and_a_direction(folder):
    run = read_run(folder("centre_of_percussion"))
    (push,) = happenings(run.model, run.events)["impulses"]
    assert (push["body"], push["point"]) == (0, list(run.model.markers[1].point))
    assert (push["direction"], push["basis"], push["size"]) == ([0.0, 1.0, 0.0], -1, 0.3)
    run = read_run(folder("clock"))
    ticks = happenings(run.model, run.events)["impulses"]
    assert all(tick["angular"] and tick["direction"] == [0.0, 0.0, 1.0] for tick in ticks)


def test_events_are_marked_in_graphs_unless_they_are_too_many(folder):
    run = read_run(folder("clock"))
    found = marks(run.events)
    assert [name for _, name in found].count("Tick") == len({t for t, n in found if n == "Tick"})
    assert (6.3, "Regulate") in [(round(t, 9), name) for t, name in found]
    (group,) = groups(run, compute_metrics(run), ["joints"])
    assert group.graphs[0].marks == tuple(found)
    assert graphs([group]).data["graphs"][0]["marks"][0] == {"time": found[0][0], "name": "Tick"}
    lines = draw_group(group, "").axes[0].lines
    upright = [line for line in lines if len({*line.get_xdata()}) == 1]
    assert len(upright) == len(found)
    crowd = run.events.iloc[[0] * (MOST_MARKS + 1)].assign(time=np.arange(MOST_MARKS + 1.0))
    assert marks(crowd) == []
    assert marks(None) == []


def test_a_run_without_contacts_has_none(folder):
    shown = show_run(folder("conical_pendulum"))
    assert shown.happenings is None
    assert '"happenings"' not in viewer_page([shown])


@pytest.mark.parametrize("name", ["box_on_slope", "clock", "falling_box", "trough", "steps"])
def test_the_viewer_shows_contacts(open_page, folder, tmp_path, name):
    (tmp_path / "view.html").write_text(viewer_page([show_run(folder(name))]), encoding="utf-8")
    page = open_page(tmp_path / "view.html", viewport={"width": 1000, "height": 700})
    page.wait_for_selector("[data-state=ready]")
    legend = page.locator(".contact-legend span")
    named = {"box_on_slope": {"open", "slides", "sticks"}, "clock": set()}.get(name, {"open"})
    assert named <= {*legend.all_inner_texts()}
    page.get_by_role("button", name="Contacts").click()
    page.wait_for_selector(".contact-legend", state="hidden")  # with the next frame


def test_a_model_without_reactions_and_contacts_has_a_report(folder):
    assert show_run(folder("torque_free")).happenings is None


def test_a_curve_has_its_points(folder):
    run = read_run(folder("cam_lift_off"))
    (contact,) = happenings(run.model, run.events)["contacts"]
    (cam,) = run.model.contacts
    assert (contact["shape"], contact["radius"]) == ("curve", cam.radius)
    points = np.array(contact["curve"])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    reach = np.linalg.norm(points - middle, axis=1)
    # A circle, of which the extreme points are among those that are drawn.
    assert np.ptp(reach) < 1e-12
    assert {STATES[state] for state in contact["states"]} == {"open", "closed"}

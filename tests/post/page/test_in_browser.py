"""Pages in a real browser: nothing fails, nothing hostile runs, colours, widths and print."""

import inspect
import re
from xml.sax.saxutils import escape

import numpy as np
import pytest

from msahl.analysis.inverse import verdict as inverse_verdict
from msahl.post import run_report
from msahl.post.graph_data import Graph, Group
from msahl.post.metrics import compute_metrics
from msahl.post.page.blocks import as_html
from msahl.post.page.graphs import graphs
from msahl.post.page.markup import element
from msahl.post.page.parts import wrap, write_page
from msahl.post.run_report import build_report
from msahl.results.read import read_run
from msahl.run import verdict
from tests.support.browser import wait_until
from tests.support.hostile import PAYLOADS, assert_nothing_ran
from tests.support.run_folders import DECK, write

CHECKS = {
    "completion": {"word": "PASS", "text": "40 steps to t = 0.4 s"},
    "accuracy": {"word": "FAIL", "text": "estimated position error at most 3.1e+01 m"},
}
INFO = {
    "steps": 40,
    "time": 0.4,
    "status": "completed",
    "outputTimes": 41,
    "options": {"scheme": "preserving", "every": 1, "reactions": "mean"},
    "verdict": {"word": "FAIL", "reasons": ["the error is large"], "checks": CHECKS},
}
DARK = {"color_scheme": "dark"}
DRAWN = """() => [...document.querySelectorAll('.plot canvas')].map((canvas) => {
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  return new Set(new Uint32Array(pixels.buffer)).size;
})"""


def test_every_check_has_a_name_for_readers():
    sources = inspect.getsource(verdict) + inspect.getsource(inverse_verdict)
    found = re.findall(r'Finding\("(\w+)"', sources)
    others = {"linearMomentum", "angularMomentum", "errorForces"}
    others |= {f"{kind}Error" for kind in ("force", "moment", "load")}
    assert {*found, *others} == set(run_report.CHECKS)


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    write(folder, info=INFO)
    return page_of(folder, viewer=False)


def page_of(folder, viewer=True):
    """Write the page on a run and return its path."""
    run, path = read_run(folder), folder / "page.html"
    title = run.model.simulation.title
    path.write_text(as_html(title, build_report(run, compute_metrics(run), viewer)))
    return path


def test_the_verdict_comes_first_and_three_screens_show_what_is_not_folded(open_page, report):
    page = open_page(report, viewport={"width": 1280, "height": 900})
    page.wait_for_selector(".plot canvas")
    banner, fold = page.locator(".banner"), page.locator("details").first
    assert banner.locator(".word").inner_text() == "FAIL"
    assert banner.bounding_box()["y"] < 150
    assert fold.bounding_box()["y"] < 3 * 900
    red, green, _ = channels(page, ".banner .word", "color")
    assert red > 1.5 * green


def channels(page, selector, what):
    """Return red, green and blue of a colour of the first element found."""
    colour = page.evaluate(f"getComputedStyle(document.querySelector('{selector}')).{what}")
    return [float(part) for part in colour.removeprefix("rgb(").removesuffix(")").split(",")]


def test_every_graph_is_drawn_those_in_folds_when_they_are_opened(open_page, report):
    page = open_page(report, viewport={"width": 1280, "height": 900})
    page.wait_for_selector(".plot canvas")
    shown = page.evaluate(DRAWN)
    # x, y, z; magnitude and components of the force; energies and their balance error
    assert len(shown) == 9
    page.locator("details").first.locator("summary").click()
    wait_until(
        page, "[...document.querySelectorAll('.plot')].every((p) => p.querySelector('canvas'))"
    )
    # Different colours of pixels: axes, grid, a curve.
    everything = wait_until(page, f"((drawn) => Math.min(...drawn) > 10 && drawn)(({DRAWN})())")
    assert len(everything) > len(shown)


def test_a_legend_hides_a_curve_and_the_cursor_reads_values(open_page, report):
    page = open_page(report, viewport={"width": 1280, "height": 900})
    page.wait_for_selector(".plot canvas")
    group = page.locator(".graph-group", has_text="Energies")
    button = group.locator("button", has_text="kinetic")
    before = page.evaluate(DRAWN)
    button.click()
    wait_until(page, f"JSON.stringify(({DRAWN})()) !== JSON.stringify({before})")
    assert button.get_attribute("aria-pressed") == "false"
    group.locator(".u-over").first.hover()
    text = group.locator(".readout").first.inner_text()
    assert "potential" in text
    assert "kinetic" not in text
    time = float(text.splitlines()[0].split()[-1])
    assert time == pytest.approx(0.2, abs=0.02)  # the middle of 0 to 0.4 s


def test_graphs_and_viewer_share_the_time(open_page, tmp_path):
    write(tmp_path, info=INFO)
    page = open_page(page_of(tmp_path), viewport={"width": 1280, "height": 900})
    page.wait_for_selector(".viewer[data-state=ready]")
    page.wait_for_selector(".plot canvas")
    page.locator(".graph-group", has_text="Energies").locator(".u-over").first.click()
    wait_until(page, "window.msahl.time > 0")
    assert page.evaluate("msahl.time") == pytest.approx(0.2, abs=0.02)  # the middle of the graph
    wide = page.locator(".graph-group", has_text="Energies").locator(".u-over").first.bounding_box()
    middle = wide["x"] + wide["width"] / 2
    marks = "[...document.querySelectorAll('.time-mark')].map((m) => m.getBoundingClientRect().x)"
    wait_until(page, f"{marks}.some((x) => Math.abs(x - {middle}) < {0.06 * wide['width']})")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_colours_follow_the_system_and_the_switch(open_page, report, scheme):
    page = open_page(report, color_scheme=scheme)
    page.wait_for_selector(".plot canvas")

    def luminance():
        return sum(channels(page, "html", "backgroundColor")) / 3

    first = luminance()
    assert (first > 128) == (scheme == "light")
    # Pictures are drawn in the colours of the page.
    assert (sum(channels(page, "figure svg text, figure svg use, figure svg", "fill")) > 384) == (
        scheme == "dark"
    )
    page.locator("button.theme").click()
    assert (luminance() > 128) != (first > 128)


def test_on_a_telephone_only_tables_scroll(open_page, report):
    page = open_page(report, viewport={"width": 390, "height": 844}, is_mobile=True)
    page.wait_for_selector(".plot canvas")
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    page.wait_for_timeout(200)
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    assert page.evaluate(
        "[...document.querySelectorAll('.scroll')].some((d) => d.scrollWidth > d.clientWidth)"
    )


def test_print_shows_all_in_light_colours(open_page, report):
    page = open_page(report, **DARK)
    page.wait_for_selector(".plot canvas")
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    page.emulate_media(media="print")
    assert page.locator("details:not([open])").count() == 0
    assert min(channels(page, "html", "backgroundColor")) == 255
    assert page.locator("button.theme").is_hidden()
    page.emulate_media(media="screen")
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.locator("details[open]").count() == 0
    assert page.pdf(format="A4").startswith(b"%PDF")


def test_hostile_names_run_no_script(open_page, tmp_path):
    listed = list(PAYLOADS)
    # Names of a deck contain no quotation marks.
    name = " ".join(payload for payload in PAYLOADS if not {"'", '"'} & set(payload))
    text = DECK.replace("Bob", escape(name)).replace("Pivot", escape(f"{name} 2"))
    checks = {payload: {"word": "WARN", "text": payload} for payload in PAYLOADS}
    info = INFO | {
        "deck": {"path": "".join(listed), "digest": "".join(listed)},
        "warnings": listed,
        "message": "".join(listed),
        "verdict": {"word": "WARN", "reasons": listed, "checks": checks},
        "nonUniqueReactions": {f"{name} 2": listed},
    }
    write(tmp_path, info=info, text=text.replace("Conical &amp; &lt;calm&gt;", escape(name)))
    page = open_page(page_of(tmp_path))
    page.wait_for_selector(".plot canvas")
    page.evaluate("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    page.locator(".u-over").first.hover()
    assert name in page.locator(".readout").first.inner_text()
    assert page.title() == name
    assert_nothing_ran(page)


def test_hostile_texts_in_graphs_and_attributes_run_no_script(open_page, tmp_path):
    x = np.linspace(0.0, 1.0, 5)
    groups = [
        Group(p, (Graph(p, x, ((p, x), (f"{p}.", -x)), x_title=p),), note=p) for p in PAYLOADS
    ]
    buttons = [element("button", p, title=p, aria_label=p, class_=p, id=p) for p in PAYLOADS]
    path = tmp_path / "page.html"
    path.write_text(write_page("".join(PAYLOADS), wrap("main", *buttons, graphs(groups))))
    page = open_page(path)
    page.wait_for_selector(".plot canvas")
    for over in page.locator(".u-over").all():
        over.hover()
    assert_nothing_ran(page)


def test_the_policy_stops_a_script_that_were_in_the_markup(browser, tmp_path):
    """If a text were not escaped, the browser would still not run it."""
    path = tmp_path / "page.html"
    page_text = write_page("t", wrap("main", "here"))
    path.write_text(
        page_text.replace(
            "here", "<script>window.hostile=1</script><img src=x onerror=window.hostile=1>"
        )
    )
    context = browser.new_context()
    page = context.new_page()
    page.goto(path.as_uri())
    page.wait_for_timeout(100)
    assert page.evaluate("window.hostile") is None
    context.close()


def test_without_webgl_the_still_picture_is_shown(browser, tmp_path):
    write(tmp_path, info=INFO)
    context = browser.new_context()
    page = context.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page.goto(page_of(tmp_path).as_uri())
    page.wait_for_selector(".viewer[data-state=failed]")
    assert page.locator(".printed svg").is_visible()
    context.close()

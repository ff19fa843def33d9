"""Pictures: names are shown as they are, axes as formulas."""

import numpy as np
import pytest

from msahl.post.draw import draw_group, encode, plain, style
from msahl.post.graph_data import Graph, Group

TIME = np.linspace(0.0, 1.0, 5)


def drawn(title, *names, **settings):
    """The figure of a group with one graph, in which every curve has other values."""
    curves = tuple((name, TIME ** (k + 1)) for k, name in enumerate(names))
    return draw_group(Group(title, (Graph("size [m]", TIME, curves, **settings),)), "Model")


@pytest.mark.parametrize("name", ["$x_{", "$a$", r"\$", "_hidden", "plain"])
def test_a_name_is_shown_letter_by_letter(name):
    with style():
        figure = drawn(name, name, "other", log=True)
        (axes,) = figure.axes
        encode(figure, "png")
        shown, _ = figure.legends[0].get_texts()
        text, math = shown._preprocess_math(shown.get_text())
        assert (text.strip(), math) == (name, False)
        # 10^-1 and its like are formulas still.
        assert any("mathdefault" in t.get_text() for t in axes.get_yticklabels())
        assert all(t.get_parse_math() for t in axes.get_yticklabels())


def test_letters_that_the_font_lacks_are_no_warning():
    with style():
        figure = drawn("\u6f22\u5b57", "\u6f22")
        assert encode(figure, "png").startswith(b"\x89PNG")


def test_plain_names_are_left_alone():
    assert plain("Crank pin") == "Crank pin"


@pytest.mark.parametrize("what", ["reactions on the child, mean over each step", "a " * 60])
def test_a_title_does_not_run_into_the_legend(what):
    """Beside the longest names in the legend of a four-bar linkage."""
    with style():
        figure = drawn(what, "Rocker pivot of the third linkage from the left")
        figure.canvas.draw()
        (axes,) = figure.axes
        title, labels = axes.title, figure.legends[0]
        assert title.get_window_extent().x1 <= labels.get_window_extent().x0


def test_a_curve_has_the_same_colour_in_all_graphs_of_a_group():
    """Also where curves before it have no values; the legend has every name once."""
    first = Graph("a [m]", TIME, (("one", TIME), ("two", -TIME)))
    second = Graph("b [m]", TIME, (("two", TIME), ("three", TIME**2)))
    with style():
        figure = draw_group(Group("title", (first, second)), "Model")
    above, below = (
        {line.get_label(): line.get_color() for line in axes.get_lines()} for axes in figure.axes
    )
    assert above["two"] == below["two"]
    assert len({above["one"], above["two"], below["three"]}) == 3
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["one", "two", "three"]


@pytest.mark.parametrize("values", [np.zeros(5), np.array([0.0, -1e-3, 1e-30, np.nan, 1.0])])
def test_zeros_leave_a_logarithmic_panel_at_its_edge(values):
    with style():
        figure = draw_group(Group("t", (Graph("e", TIME, (("a", values),), log=True),)), "Model")
    (axes,) = figure.axes
    assert axes.get_yscale() == ("log" if values.any() else "linear")
    if values.any():
        assert axes.get_ylim()[0] == 0.5e-8  # half of eight decades below the largest


def test_a_graph_without_output_times_says_so():
    empty = np.zeros(0)
    with style():
        figure = draw_group(Group("t", (Graph("e", empty, (("a", empty),), log=True),)), "Model")
    assert [text.get_text() for text in figure.axes[0].texts] == ["no output times"]

"""Pictures: names are shown as they are, axes as formulas."""

import numpy as np
import pytest

from msahl.post.draw import curves, encode, legend, new_figure, plain, style


@pytest.mark.parametrize("name", ["$x_{", "$a$", r"\$", "_hidden", "plain"])
def test_a_name_is_shown_letter_by_letter(name):
    with style():
        figure, (axes,) = new_figure(1, title=name)
        time = np.linspace(0.0, 1.0, 5)
        curves(axes, time, np.stack([time, time**2], axis=1), [name, "other"])
        axes.set_yscale("log")
        legend(figure, axes)
        encode(figure, "png")
        shown, _ = figure.legends[0].get_texts()
        text, math = shown._preprocess_math(shown.get_text())
        assert (text.strip(), math) == (name, False)
        # 10^-1 and its like are formulas still.
        assert any("mathdefault" in t.get_text() for t in axes.get_yticklabels())
        assert all(t.get_parse_math() for t in axes.get_yticklabels())


def test_letters_that_the_font_lacks_are_no_warning():
    with style():
        figure, (axes,) = new_figure(1, title="\u6f22\u5b57")
        curves(axes, np.zeros(2), np.zeros((2, 1)), ["\u6f22"])
        assert encode(figure, "png").startswith(b"\x89PNG")


def test_plain_names_are_left_alone():
    assert plain("Crank pin") == "Crank pin"


@pytest.mark.parametrize("what", ["reactions on the child, mean over each step", "a " * 60])
def test_a_title_does_not_run_into_the_legend(what):
    """Beside the longest names in the legend of a four-bar linkage."""
    with style():
        figure, (axes,) = new_figure(1, title=f"Four-bar linkage: {what}")
        curves(axes, np.zeros(2), np.zeros((2, 1)), ["Rocker pivot\n(Fy, Mx, Mz not unique)"])
        legend(figure, axes)
        figure.canvas.draw()
        title, labels = axes.title, figure.legends[0]
        assert title.get_window_extent().x1 <= labels.get_window_extent().x0

"""A document reads the same in Markdown and in HTML, whatever its texts contain."""

import pytest

from msahl.post.document import Code, Folded, Items, Paragraph, as_markdown
from msahl.post.page.blocks import as_html
from msahl.post.table import Column, Table


@pytest.mark.parametrize("text", ["1.46e-01", "0.02 to 0.1", "-0.5", "--scheme gauss2", "-"])
def test_numbers_and_options_are_written_as_they_are(text):
    expected = text if text != "-" else "\\-"  # alone it would begin a list
    assert as_markdown([Paragraph(text)]) == f"{expected}\n"


@pytest.mark.parametrize(
    ("text", "escaped"),
    [
        ("1. first", "1\\. first"),
        ("2) second", "2\\) second"),
        ("- an item", "\\- an item"),
        ("+ an item", "\\+ an item"),
        ("---", "\\---"),
        ("==", "\\=="),
        ("a*b_c", "a\\*b_c"),
        ("_c", "\\_c"),
    ],
)
def test_what_markdown_reads_as_markup_is_escaped(text, escaped):
    assert as_markdown([Paragraph(text)]) == f"{escaped}\n"


def test_a_command_can_be_copied_as_it_is():
    command = "msahl run a_b*.xml --dt 0.01 -o 'x<y'"
    assert as_markdown([Code(command)]) == f"    {command}\n"
    html = as_html("t", [Code(command)])
    assert "<pre><code>msahl run a_b*.xml --dt 0.01 -o &#x27;x&lt;y&#x27;</code></pre>" in html


def test_texts_are_not_read_as_html():
    table = Table((Column("name", "<b>"),), (("<script>",),))
    blocks = [Paragraph("<p>"), Items((("<i>", "&"), ("", "<u>"))), Folded("<h>", (table,))]
    body = as_html("<t>", blocks).split("<body>")[1].split("<script")[0]
    for mark in ("<b>:", "<u>", "<h>"):
        assert mark not in body.replace("<b>&lt;i&gt;</b>", "")
    assert "<li><b>&lt;i&gt;</b>: &amp;</li>" in body
    assert "<summary>&lt;h&gt;</summary>" in body

"""Elements are escaped by construction; a page contains what its parts need, once."""

import json
import re
from base64 import b64encode
from hashlib import sha256

import pytest

from msahl.post.page.blocks import as_html, table
from msahl.post.page.markup import Markup, element, join, running
from msahl.post.page.parts import Part, combine, wrap, write_page
from msahl.post.table import Column, Table


def test_texts_and_attributes_are_escaped():
    assert element("p", "a < b", title='"x"') == '<p title="&quot;x&quot;">a &lt; b</p>'
    assert element("p", element("b", "&"), ["<i>"]) == "<p><b>&amp;</b>&lt;i&gt;</p>"
    assert element("p", "a\nb\x1b") == "<p>a\\nb\\x1b</p>"
    assert join("<", Markup("<br>")) == "&lt;<br>"


def test_options_and_numbers_are_not_broken():
    found = running("try --dt 1e-06, a < b")
    kept = '<span class="unbroken">{}</span>'
    assert found == f"try {kept.format('--dt')} {kept.format('1e-06,')} a &lt; b"
    assert "unbroken" not in running(f"a-{'b' * 40}")  # it would be wider than a telephone


def test_names_and_kinds_of_attributes():
    found = element("input", class_="a", aria_label="b", disabled=True, hidden=False, id=None)
    assert found == '<input class="a" aria-label="b" disabled>'


def test_the_policy_allows_the_script_of_the_page_and_nothing_else():
    page = write_page("t", wrap("main", "text"))
    (script,) = re.findall(r'<script type="module">(.*?)</script>', page, flags=re.S)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    digest = b64encode(sha256(script.encode()).digest()).decode()
    assert policy.startswith(f"default-src 'none'; script-src 'sha256-{digest}'; style-src 'sha")
    assert "unsafe" not in policy


def test_what_parts_need_is_contained_once():
    data = {"a": ["</script>", 1.5]}
    part = Part(element("p", "x"), ("graphs.css",), ("graphs.js",), ("uplot",), data)
    page = write_page("t", wrap("main", combine(part, part)))
    assert page.count("<p>x</p>") == 2
    assert page.count("function startGraphs") == 1
    assert page.count('id="bundle-uplot"') == 1
    assert page.count("<style>") == 2
    held = re.search(r'<script type="application/json" id="a">(.*?)</script>', page)[1]
    assert json.loads(held) == data["a"]


@pytest.mark.parametrize("word", ["PASS", "FAIL"])
def test_verdicts_are_coloured_numbers_stand_right_and_long_texts_may_break(word):
    columns = (Column("a", "a"), Column("b", "b", "both", ".1e"), Column("c", "c", "both"))
    page = table(Table(columns, ((word, 1.0, "long " * 20),)))
    assert f'<span class="word {word.lower()}">{word}</span>' in page
    assert '<th colspan="2" class="group">both</th>' in page
    assert '<td class="number">1.0e+00</td>' in page
    assert '<td class="long">' in page
    assert page.startswith('<div class="scroll"')


def test_the_title_stands_once():
    page = as_html("T", [])
    assert page.count("<h1>T</h1>") == 1

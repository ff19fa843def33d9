"""Names, titles and messages of any origin: shown as they are, obeyed by nothing."""

import re
from html.parser import HTMLParser

import pytest
from click.testing import CliRunner

from msahl.cli.main import main as engine
from msahl.post.cli import main as post
from msahl.post.document import Heading, Items, Paragraph, as_markdown
from msahl.post.page.blocks import as_html
from msahl.post.table import Column, Table
from msahl.printable import printable
from tests.support.run_folders import DECK, write

NASTY = (
    "\x1b[31mred\x1b[0m", "a\nPASS: b", "\x9b2J", "\u202eabc", "<script>x</script>", "a | b",
    "[a](http://b)", "![a](b)", "*a* _b_ __c__ `d`", "# a", "- a", "1. a", "+ a", "&lt;", "~~a~~",
    "\\", "=\n=", "a\tb", "{a}", "\udcff",
)  # fmt: skip
SAFE = re.compile(r"[^\x00-\x1f\x7f-\x9f\u202a-\u202e\ud800-\udfff]*")


class Texts(HTMLParser):
    """The texts of a document, and its tags."""

    def __init__(self, document):
        super().__init__()
        self.tags, self.texts = set(), []
        self.feed(document)

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)

    def handle_data(self, data):
        self.texts.append(data)


def blocks(text):
    cells = Table((Column("a", text), Column("b", "b")), ((text, text),))
    return [Heading(1, text), Paragraph(text), Items(((text, text), ("", text))), cells]


@pytest.mark.parametrize("text", NASTY)
def test_html_shows_a_text_as_it_is(text):
    plain, document = printable(text), as_html(text, blocks(text))
    assert SAFE.fullmatch(document.replace("\n", ""))
    document.encode()
    found = Texts(document)
    assert document.count("<script") == 1  # the page's own
    assert "".join(found.texts).count(plain) >= 8


@pytest.mark.parametrize("text", NASTY)
def test_markdown_shows_a_text_as_it_is(text):
    lines = as_markdown(blocks(text)).splitlines()
    heading, _, paragraph, _, term, item, _, header, rule, row = lines
    assert rule == "| --- | --- |"
    for line, before, after in (
        (heading, "# ", ""), (paragraph, "", ""), (item, "- ", ""), (row, "| ", " |"),
    ):  # fmt: skip
        assert line.startswith(before)
        assert line.endswith(after)
        held = line[len(before) : len(line) - len(after)]
        # Nothing is left that Markdown reads: not within the line, not at its beginning.
        # A list's mark is followed by a space, a line below a heading is all = or -.
        assert not re.match(r"\s*([-+](\s|$)|[-=]+\s*$|[#>]|\d+[.)](\s|$))", held)
        bare = re.sub(r"\\[!-/:-@\[-`{-~]", "", held.split(" | ")[0])
        assert not re.search(r"[`*|<>\[\]&~#]|(?<!\w)_|_(?!\w)", bare)
        assert re.sub(r"\\([!-/:-@\[-`{-~])", r"\1", held.split(" | ")[0]) == printable(text)
    assert len({line.count(" | ") for line in (header, row)}) == 1
    assert term.startswith("- **")


NAMES = ("\x1b[31mred.xml", "a\nb: PASS.xml", "\x9b2J.xml", "\u202elmx.xml")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("command", ["check", "run", "explain"])
def test_no_file_name_commands_the_terminal(tmp_path, name, command):
    path = tmp_path / name
    path.write_text(DECK.replace("<mass>2.0", "<mass>two"), encoding="utf-8")
    result = CliRunner().invoke(engine, [command, str(path)])
    assert result.exit_code == 2
    assert SAFE.fullmatch(result.stderr.replace("\n", ""))
    assert result.stderr.count("\n") == 1
    assert ascii(name)[1:-1] in result.stderr


@pytest.mark.parametrize("name", NAMES)
def test_nor_does_one_of_a_good_deck_or_of_a_folder(tmp_path, name):
    path = tmp_path / name
    path.write_text(DECK, encoding="utf-8")
    result = CliRunner().invoke(engine, ["check", str(path)])
    assert result.stdout == f"{tmp_path}/{ascii(name)[1:-1]}: good\n"
    for words in (["energy", str(path)], ["verdict", str(path)], ["compare", str(path), "none"]):
        result = CliRunner().invoke(post, words)
        assert result.exit_code == 2
        assert result.stderr.count("\n") == 1
        assert SAFE.fullmatch(result.stderr.strip("\n"))


@pytest.mark.slow
def test_a_title_and_what_run_json_says_are_no_markup(tmp_path, monkeypatch):
    monkeypatch.setattr("msahl.post.run_report._pictures", lambda run: ([], []))
    evil = "\x1b[2J | <b>x</b> [a](b)"
    info = {"deck": {"path": evil}, "warnings": [evil], "message": evil, "status": "interrupted"}
    write(tmp_path, info=info)
    result = CliRunner().invoke(post, ["report", str(tmp_path)])
    assert result.exit_code == 0
    assert SAFE.fullmatch(result.stderr.replace("\n", ""))
    for name in ("report.md", "report.html"):
        text = (tmp_path / "report" / name).read_text()
        assert SAFE.fullmatch(text.replace("\n", ""))
        assert text.count(" x") + 1
        assert "<b>x" not in text.replace("\\<b", "")

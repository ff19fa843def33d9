"""Put JavaScript, styles and data into HTML pages of one file, which may not use the network.

Our own sources are ES modules (``*.js``) in this folder, beside the vendored bundles
(``*.min.js``, described in ``vendor.json``). A page contains its modules as one inline module, the
bundles compressed, and a content policy that allows exactly these scripts, by their SHA-256.
Nothing else may run, and nothing may be loaded: a name in a deck cannot become a program.
"""

import base64
import hashlib
import re
import zlib
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import orjson

_IMPORT = re.compile(r'^import \{[^}]*\} from "\./([\w.-]+)";\n', re.MULTILINE)
_EXPORT = re.compile(r"^export (?=(async )?(function|const|let|class) )", re.MULTILINE)


@cache
def source(name: str) -> str:
    """Return the text of a file in this folder."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def joined(*names: str) -> str:
    """Return ES modules of this folder, and all that they import, as the text of one module.

    Each module stands after those that it imports, once, without its ``import`` and ``export``: a
    page of one file has no addresses to import from. So modules share one scope, and their
    outermost names must differ.
    """
    order: list[str] = []

    def visit(name: str) -> None:
        if name in order:
            return
        for needed in _IMPORT.findall(source(name)):
            visit(needed)
        order.append(name)

    for name in names:
        visit(name)
    return "".join(_EXPORT.sub("", _IMPORT.sub("", source(name))) for name in order)


def inline_script(text: str) -> str:
    """Return the element of an inline module; ``content_policy`` must get the same text."""
    _require_harmless(text, "</script")
    return f'<script type="module">{text}</script>'


def inline_style(text: str) -> str:
    """Return the element of a style sheet; ``content_policy`` must get the same text."""
    _require_harmless(text, "</style")
    return f"<style>{text}</style>"


def bundle(name: str) -> str:
    """Return the element with a vendored bundle, compressed, which ``loadBundle(name)`` of
    ``bundles.js`` runs; ``content_policy`` must get ``source(f"{name}.min.js")``."""
    data = packed(source(f"{name}.min.js").encode())
    licence = source(f"{name}.LICENSE").replace("--", "- -").strip()
    return (
        f"<!-- {name}\n{licence}\n-->\n"
        f'<script type="application/octet-stream" id="bundle-{name}">{data}</script>'
    )


def json_data(identifier: str, value: Any) -> str:
    """Return the element that holds a value as JSON; no text in it can end the element."""
    text = orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY).decode()
    for mark in "<>&\u2028\u2029":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return f'<script type="application/json" id="{identifier}">{text}</script>'


def packed(data: bytes) -> str:
    """Return bytes compressed (zlib) and in base64; ``unpack`` of ``bundles.js`` reads them."""
    return base64.b64encode(zlib.compress(data, 9)).decode()


def content_policy(scripts: Iterable[str], styles: Iterable[str], asks_server: bool = False) -> str:
    """Return the element of the content policy that allows these scripts and style sheets only,
    and no address but those of data that the page itself holds or makes, and of the server that
    the page came from if it ``asks_server``."""
    rules = (
        "default-src 'none'",
        f"script-src {_digests(tuple(scripts))}",
        f"style-src {_digests(tuple(styles))}",
        "img-src data: blob:",
        "media-src data: blob:",
        *(("connect-src 'self'",) if asks_server else ()),
        "base-uri 'none'",
        "form-action 'none'",
    )
    return f'<meta http-equiv="Content-Security-Policy" content="{"; ".join(rules)}">'


def _digests(texts: Sequence[str]) -> str:
    digests = (base64.b64encode(hashlib.sha256(text.encode()).digest()) for text in texts)
    return " ".join(f"'sha256-{digest.decode()}'" for digest in digests) or "'none'"


def _require_harmless(text: str, end: str) -> None:
    """Raise ``ValueError`` if a text of ours would end its own element."""
    if end in text.lower():
        raise ValueError(f"a page cannot hold a text with {end}")

"""Texts that run a script wherever a page shows them as markup, and how a test sees that one ran.

Each payload sets ``window.hostile``. Write them as names, titles, paths and messages, open the page
with ``open_page`` of ``tests.support.browser``, and call ``assert_nothing_ran``.
"""

from typing import Any

RUN = "window.hostile=1"
PAYLOADS = (
    f"<script>{RUN}</script>",
    f"</script><script>{RUN}</script>",
    f"</title><script>{RUN}</script>",
    f"</style><script>{RUN}</script>",
    f"--></noscript><img src=x onerror={RUN}>",
    f'"><svg onload={RUN}>',
    f"' onmouseover='{RUN}' autofocus onfocus='{RUN}' x='",
    f"<iframe srcdoc='<script>parent.{RUN}</script>'></iframe>",
    f"<a href=javascript:{RUN}>click</a>",
    f"]]>\\u003cscript>{RUN}\\u003c/script>",
    f"<details open ontoggle={RUN}>",
    f"${{{RUN}}}{{{{constructor.constructor('{RUN}')()}}}}",
    f"\\u2028{RUN}//",
    "__proto__",
)


def assert_nothing_ran(page: Any) -> None:
    """Fail if a payload ran, or stands in the page as an element or as a handler of events."""
    assert page.evaluate("window.hostile") is None
    assert page.evaluate("document.querySelectorAll('iframe, a[href^=javascript]').length") == 0
    handlers = "[...document.querySelectorAll('*')].flatMap((e) => e.getAttributeNames())"
    assert [name for name in page.evaluate(handlers) if name.startswith("on")] == []

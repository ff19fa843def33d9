"""What all tests share: hypothesis draws the same examples every time, and takes its time."""

from hypothesis import settings

from tests.support.browser import browser, open_page  # noqa: F401

settings.register_profile("steady", derandomize=True, deadline=None, database=None)
settings.load_profile("steady")

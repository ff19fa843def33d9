"""What all tests share: hypothesis draws the same examples every time, and takes its time."""

import gc
import os

# Tests run one in each core; a second thread for matrices of tests' sizes waits for the other
# tests, which takes ten times the time. Numpy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from hypothesis import settings

from tests.support.browser import browser, open_page  # noqa: F401

settings.register_profile("steady", derandomize=True, deadline=None, database=None)
settings.load_profile("steady")

LONG = ("test_installation.py", "test_kills.py")
"""Files whose tests take a minute and more each."""


def pytest_collection_modifyitems(items):
    """Begin with the long tests: at the end one core would wait for the other."""
    items.sort(key=lambda item: item.path.name not in LONG)


def pytest_collection_finish():
    """Keep the collector from going through ten thousand tests, a second each time."""
    gc.collect()
    gc.freeze()

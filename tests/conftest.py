"""What all tests share: hypothesis draws the same examples every time, and takes its time."""

import collections
import gc
import os

# Tests run one in each core; a second thread for matrices of tests' sizes waits for the other
# tests, which takes ten times the time. Numpy reads this when it is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import settings

from tests.support.browser import browser, open_page  # noqa: F401

settings.register_profile("steady", derandomize=True, deadline=None, database=None)
settings.load_profile("steady")

LONG = ("test_installation.py", "test_kills.py")
"""Files whose tests take a minute and more each."""


QUICK = 10
"""Of the cases of a sampled test one in so many is among the quick tests."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Begin with the long tests: at the end one core would wait for the other. Slow are the tests
    in a browser and most cases of sampled tests.
    """
    items.sort(key=lambda item: item.path.name not in LONG)
    cases = collections.Counter()
    for item in items:
        sampled = item.get_closest_marker("sampled") is not None
        if "browser" in item.fixturenames or (sampled and cases[item.function] % QUICK):
            item.add_marker(pytest.mark.slow)
        cases[item.function] += sampled


def pytest_collection_finish():
    """Keep the collector from going through ten thousand tests, a second each time."""
    gc.collect()
    gc.freeze()

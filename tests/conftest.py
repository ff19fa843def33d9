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


def pytest_collection_finish():
    """Keep the collector from going through ten thousand tests, a second each time."""
    gc.collect()
    gc.freeze()

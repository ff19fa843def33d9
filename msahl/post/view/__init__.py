"""Build a page that shows the motion of a run in three dimensions.

``viewer_page`` returns a page of its own, ``viewer_block`` a part of another page; both take what
``show_run`` reads from the folder of a run, or ``Shown(scene)`` for a model at rest.
"""

from msahl.post.view.viewer import (
    Shown,
    show_error,
    show_run,
    show_sample,
    viewer_block,
    viewer_page,
)

__all__ = ["Shown", "show_error", "show_run", "show_sample", "viewer_block", "viewer_page"]

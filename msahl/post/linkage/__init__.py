"""Draw a mechanism's linkage at a few instants, as textbooks do (a stroboscope).

    model, states -> scene -> parts (lines and faces of each body, its axes)
                           -> instants and view, chosen by the extent of the motion
                           -> drawing

Links are lines between their joints, bodies with more joints polygons, free bodies the outlines of
their shapes; joints are circles, points of the ground triangles, springs zigzags, dampers
cylinders with pistons.
"""

from msahl.post.linkage.draw import draw_linkage, picture
from msahl.post.linkage.motion import Motion, moves

__all__ = ["Motion", "draw_linkage", "moves", "picture"]
"""What other modules use."""

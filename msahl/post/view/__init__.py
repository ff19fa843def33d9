"""Build a page that shows the motion of a run in three dimensions."""

"""Sweeps: many runs of one deck with other numbers or options, their plan, their store, their pool.

    axes, samples -> plan -> points -> rows -> store
                             (pool: in many processes)

``plan`` is a stream of points, ``points.run_points`` is the one function that computes rows from
them, and ``store`` is the folder of a sweep. A scheduler (``pool``) hands points to processes.
"""

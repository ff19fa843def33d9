"""The post room: what a run's tables show, how wrong they are, and pictures of both.

    run folder -> Run -> rows -> measure -> tables, figures, report

Reads files only; whatever wrote them is gone by then. Pictures alone import matplotlib.
"""

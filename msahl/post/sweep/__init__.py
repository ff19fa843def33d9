"""Evaluate the folder of a sweep: statistics, sensitivity indices, pictures, page, best point.

    folder -> read.SweepRuns -> statistics, sobol -> tables, pictures -> page

Only ``plan.csv``, ``runs.csv``, ``seconds.csv`` and ``sweep.json`` are read. Points that failed are
part of no statistic; every table and picture says how many points it has, and how many are missing.
"""

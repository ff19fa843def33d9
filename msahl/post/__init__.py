"""Post-processing: accuracy metrics of a finished run, and its tables, figures and report.

    run folder -> results.read.Run -> replay -> metrics -> tables, figures, report

Post-processing reads result files only. Only the modules that draw import matplotlib.
"""

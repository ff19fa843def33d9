"""An experiment on the cause of the convergence errors that the thesis reports."""

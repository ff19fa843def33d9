"""One framework for the HTML pages of runs, sweeps and studies, and of the viewer."""

"""Fit a spring and a damper to a measured curve: a script in cells, for an editor or a notebook."""

# %% [markdown]
# # Fit a spring and a damper to a measured curve
#
# A body of 2 kg moves on a spring and a damper, whose properties are not known. It was pulled out
# and released; `measured.csv` has its position at 50 Hz, with a noise of about 1 mm. Which
# stiffness, damping and free length explain the curve best, and how well does it determine them?
#
# Run it with `python examples/fit_damper.py`, or cell by cell in an editor or notebook.

# %%
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import msahl

HERE = Path(__file__).parent
time, position = np.loadtxt(HERE / "measured.csv", delimiter=",", skiprows=1, unpack=True)
model = msahl.load(HERE.parent / "decks" / "forces" / "spring_damper.xml")

# %% [markdown]
# One run for each set of parameters, with output times at those of the measurement. The steps are
# chosen such that the error of the run is far below the noise, which one run with its error
# estimate shows; the runs of the fit need no estimate.

# %%
NAMES = ("Spring.stiffness", "Spring.damping", "Spring.freeLength")
FIRST = np.array([150.0, 2.0, 0.45])  # N/m, N s/m, m: what one would guess
OPTIONS = {"scheme": "gauss2", "dt": 0.02, "t_final": float(time[-1])}

checked = model.with_(**dict(zip(NAMES, FIRST, strict=True))).run(**OPTIONS)
print(f"{checked.verdict}: estimated error of a run {checked.error:.1e} m")


def residuals(parameters: np.ndarray) -> np.ndarray:
    """Return computed minus measured positions [m] for stiffness, damping and free length."""
    run = model.with_(**dict(zip(NAMES, parameters, strict=True))).run(error="off", **OPTIONS)
    return run["Body.x"] - position


def derivatives(parameters: np.ndarray) -> np.ndarray:
    """Return the derivatives (rows, 3) of the computed positions by the parameters."""
    at = model.with_(**dict(zip(NAMES, parameters, strict=True)))
    return at.gradient("Body.x", NAMES, error="off", **OPTIONS).columns["Body.x"]


# %% [markdown]
# The derivatives are those of the run's own steps, exact to nine digits, so no step of a difference
# quotient has to be chosen. `x_scale` makes the parameters comparable. A negative damping would be
# a fault of the deck, so the bounds keep the fit where the model makes sense.

# %%
bounds = ([1.0, 0.0, 0.1], [1e4, 50.0, 1.0])
fit = least_squares(residuals, FIRST, jac=derivatives, x_scale=FIRST, bounds=bounds)

# %% [markdown]
# The scatter of the residuals and their derivatives give the standard deviation of each parameter.

# %%
noise = np.sqrt(2.0 * fit.cost / (time.size - fit.x.size))
deviations = noise * np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
for name, value, deviation in zip(NAMES, fit.x, deviations, strict=True):
    print(f"{name}: {value:.5g} +- {deviation:.1g}")
print(f"{fit.nfev} iterations, noise {1e3 * noise:.2f} mm")

"""Numbers of coordinates and equations among the flat unknowns, and their plain units.

They are those of ``system.evaluate``, under names of their own.
"""

from msahl.system.evaluate import _coordinates as coordinate_numbers
from msahl.system.evaluate import _equation_scale as equation_scale
from msahl.system.evaluate import _equations as equation_numbers
from msahl.system.evaluate import _scales as scales

__all__ = ["coordinate_numbers", "equation_numbers", "equation_scale", "scales"]

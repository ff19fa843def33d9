"""List all models of docs/validation/error.md."""

from tools.validation import error_models
from tools.validation.error_beams import BEAMS
from tools.validation.error_contacts import CONTACTS
from tools.validation.error_scenes import SCENES

CASES = (*error_models.CASES, *SCENES, *BEAMS, *CONTACTS)

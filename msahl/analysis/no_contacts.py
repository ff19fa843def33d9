"""Analyses that know no contacts refuse models that have some."""

from msahl.model import Model
from msahl.start.velocities import StartError

REFUSED = (
    "the model has rigid contacts ({names}), which this analysis does not know; it is for runs "
    "(msahl run, msahl sweep). Remove <contacts> to analyse the model without them, or give them a "
    "<stiffness>"
)


def without_contacts(model: Model) -> str:
    """Return why the ``model`` cannot be analysed; empty if it has no rigid contacts."""
    names = ", ".join(contact.name for contact in model.rigid_contacts[:3])
    return REFUSED.format(names=names) if names else ""


def require_no_contacts(model: Model) -> None:
    """Raise ``StartError`` if the ``model`` has rigid contacts."""
    if model.rigid_contacts:
        raise StartError(without_contacts(model))

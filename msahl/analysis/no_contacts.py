"""Analyses that know no contacts refuse models that have some."""

from msahl.model import Model
from msahl.start.velocities import StartError

REFUSED = (
    "the model has contacts ({names}), which this analysis does not know; it is for runs "
    "(msahl run, msahl sweep). Remove <contacts> to analyse the model without them"
)


def without_contacts(model: Model) -> str:
    """Return why the ``model`` cannot be analysed; empty if it has no contacts."""
    names = ", ".join(contact.name for contact in model.contacts[:3])
    return REFUSED.format(names=names) if model.contacts else ""


def require_no_contacts(model: Model) -> None:
    """Raise ``StartError`` if the ``model`` has contacts."""
    if model.contacts:
        raise StartError(without_contacts(model))

"""Analyses that know neither contacts nor events refuse models that have some."""

from msahl.model import Model
from msahl.start.velocities import StartError

REFUSED = (
    "the model has {kind} ({names}), which this analysis does not know; {kind} are for runs "
    "(msahl run, msahl sweep). Remove <{kind}> to analyse the model without them"
)


def without_contacts(model: Model) -> str:
    """Return why the ``model`` cannot be analysed; empty if it has neither contacts nor events."""
    groups = ("contacts", [contact.name for contact in model.contacts]), ("events", _events(model))
    for kind, names in groups:
        if names:
            return REFUSED.format(kind=kind, names=", ".join(names[:3]))
    return ""


def _events(model: Model) -> list[str]:
    return [*(event.name for event in model.events), *model.released]


def require_no_contacts(model: Model) -> None:
    """Raise ``StartError`` if the ``model`` has contacts or events."""
    reason = without_contacts(model)
    if reason:
        raise StartError(reason)

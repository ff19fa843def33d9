"""The text of a deck as it runs."""

from msahl.deck import Source


def effective_deck(path, changes=None, settings=()):
    """The bytes of ``deck.xml`` of a run of the deck at ``path``."""
    return Source.of_file(path).text(changes or {}, settings)

"""Reader and writer of decks: XML text -> validated -> model. No other package reads XML."""

from msahl.check import check_simulation
from msahl.deck.faults import DeckError, Fault
from msahl.deck.source import ParsedDeck, Source, read_deck
from msahl.deck.write import deck_digest, listed_parameters

__all__ = [
    "DeckError",
    "Fault",
    "ParsedDeck",
    "Source",
    "check_simulation",
    "deck_digest",
    "listed_parameters",
    "read_deck",
]

"""Reader and writer of decks: XML text -> validated -> model. No other package reads XML."""

from msahl.check import check_simulation
from msahl.deck.faults import DeckError, Fault
from msahl.deck.read import read_deck
from msahl.deck.write import deck_digest, effective_deck, listed_parameters

__all__ = [
    "DeckError",
    "Fault",
    "check_simulation",
    "deck_digest",
    "effective_deck",
    "listed_parameters",
    "read_deck",
]

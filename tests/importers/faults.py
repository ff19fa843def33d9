"""Faults of files, as a user reads them."""

import pytest

from msahl.deck import DeckError


def faults_of(call, *arguments, **options):
    """Return the message with which a call refuses a file."""
    with pytest.raises(DeckError) as error:
        call(*arguments, **options)
    return str(error.value)

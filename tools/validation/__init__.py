"""Write the pages of docs/validation: run decks, compare with references, tabulate and draw.

Each page has a module that is run by ``python -m tools.validation.NAME``: thesis, closed_forms,
orders, error, stability. All pages are generated; do not edit them.
"""

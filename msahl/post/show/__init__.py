"""Build a page that shows a deck: its model at t = 0, its text, its structure and its faults.

page      ``show_deck`` returns the page of a deck, and the files that it depends on
readable  the part of a faulty deck that can be drawn
lines     where the deck's elements stand in its files
server    serves the page and says when it has changed
"""

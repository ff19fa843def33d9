"""The study room: how wrong every number of a deck is at each step, and what it costs.

    deck -> reference (closed form, independent solution, file)
         -> runs over steps and schemes -> errors -> orders, the cheapest run -> report

Runs are made in this process by the engine's own loop; nothing here knows how a step is taken.
"""

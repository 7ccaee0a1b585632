"""The table of intended differences: what the new core is meant to send otherwise, and why.

Each difference of a packet is held against the entries in order; the first that matches explains
it. After one that DIVERGES the two runs are no longer the same run (a refused *continue* leaves
the rover standing): of what follows in that record it is only seen that the new core moves no rover
that the old one leaves alone. What no entry explains is a mistake, or belongs here.

Whoever changes what is sent adds an entry in the same commit, to the file of its subject. Keep it
narrow: message, fields, values, and what led to it (``story``); an entry that matches too much
hides the next mistake.
"""

from . import (
    intended_asks,
    intended_measures,
    intended_standing,
    intended_texts,
    intended_words,
)
from .entries import Intended

INTENDED: tuple[Intended, ...] = (
    *intended_words.TABLE,
    *intended_asks.TABLE,
    *intended_standing.TABLE,
    *intended_measures.TABLE,
    *intended_texts.TABLE,
)

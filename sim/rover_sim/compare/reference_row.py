"""A row of the tables of real figures: one figure of all four rovers."""

from typing import Final

from rover_sim.compare.figure import Value

#: ArduPilot skid, ArduPilot Ackermann, PX4 differential, PX4 Ackermann. None: it did not happen, or
#: was never sent. In texts, # replaces a number
Row = tuple[Value, Value, Value, Value]

NOT_DRIVEN: Final = "not driven"  # this rover did not drive the manoeuvre

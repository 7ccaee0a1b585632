"""By how much the gateway that has a vehicle signs ahead of its clock: a fence at the vehicle.

All gateways of a fleet sign to a vehicle with one link id. A vehicle refuses what is not later than
the last packet of that, so each gateway that gets it signs ahead of the one before.
"""

#: s by which the lead grows with each takeover. The clocks of gateways may differ by that, less the
#: second from one heartbeat to the next
STEP = 3.0
#: s; a vehicle takes no stream that is new to it and a minute behind its time
MOST_LEAD = 50.0
#: s a second, by which a lead is reduced again
DECAY = 0.01

"""A ground station with QGroundControl's behaviour on the wire.

Written from notes on QGroundControl's sources and on a running one, with pymavlink's own classes
and none of the server's, so that both do not share a misunderstanding. A number in brackets, [2.4],
names the section of those notes for a rule; [11] was observed on a running one (4.3/4.4). Behaviour
that the notes lack is marked as assumed.
"""

"""A ground station that behaves as QGroundControl does, as far as the wire shows it.

Written from what is known of QGroundControl's own sources and of a running one, with pymavlink's
own classes and none of the server's: what the server misunderstands, it does not understand in the
same way. A number in brackets, [2.4], names the section of those notes that a rule is from;
[11] is what a running one (4.3/4.4) was seen to do. What no note tells is marked as assumed.
"""

"""What the server says to its operator: how an event is rendered, what is said, and where to.

It is a shell. That nobody reads what is said, or that it cannot be written, holds nothing up.
"""

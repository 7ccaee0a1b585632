"""A simulated rover that speaks MAVLink as a real one does.

It shares only the codec with the server, none of its services, so that a misunderstanding of the
protocol shows as a failure instead of cancelling itself out.
"""

"""A simulated rover that speaks MAVLink as a real one does.

It shares only the codec with the server, never its services, so that a misunderstanding of the
protocol cannot cancel itself out.
"""

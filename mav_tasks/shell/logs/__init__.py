"""The server's log: rendering events, selecting records, and writing lines.

It does I/O. A blocked log reader, or a failing one, never stalls the server.
"""

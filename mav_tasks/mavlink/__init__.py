"""MAVLink on the wire: bytes to messages and back. Pure; the only package that sees the dialect."""

"""Links: sockets and serial lines that carry bytes to and from peers."""

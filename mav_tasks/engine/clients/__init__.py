"""The clients: their links, keys and rights, and what the server sends to them."""

"""Who is on a client link, what they may do, and what they are shown."""

"""Links: bytes to and from peers, and nothing else."""

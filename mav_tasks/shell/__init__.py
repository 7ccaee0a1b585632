"""What turns the pure engine into a server: its loop, threads and log."""

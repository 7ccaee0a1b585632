"""Finding out about one rover, directly: questions, and with leave a little driving. Pure."""

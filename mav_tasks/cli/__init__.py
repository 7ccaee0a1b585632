"""The command line, one file per command. A command imports heavy modules only when it runs."""

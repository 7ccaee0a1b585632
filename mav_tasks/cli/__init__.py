"""The command line, one file per command. A command imports heavy modules only when it runs."""

import gc

# A call is mostly imports, which make many objects and no garbage: collecting in between would take
# a tenth of its time. The server sets a threshold of its own.
gc.set_threshold(50_000)

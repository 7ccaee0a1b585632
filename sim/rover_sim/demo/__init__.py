"""The demonstration: `mav-tasks demo`, `tools/demo`."""

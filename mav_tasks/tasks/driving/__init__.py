"""How a rover gets from where it is to where it is to be: geometry and closed loop, all pure."""

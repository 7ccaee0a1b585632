"""A fleet: several task servers (gateways) share vehicles; the rules of who may move which."""

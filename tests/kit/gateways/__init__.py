"""A model of a fleet: gateways, their database, what fails between them; in virtual time."""

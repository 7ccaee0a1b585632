"""The rovers: what each one reports, and how the server controls it."""

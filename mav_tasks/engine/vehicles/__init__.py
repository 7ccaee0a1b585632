"""The rovers: what each says, and how each is made to do what is wanted."""

"""What the tests share: the virtual world, fake clients, observers."""

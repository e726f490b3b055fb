"""Between numpy and the protocol."""

"""A server that meshes nothing and drives a client through the rules of the protocol."""

"""The formats that meshes are written in."""

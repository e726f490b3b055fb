"""Oracles that are programs: their processes, and what goes through the pipe."""

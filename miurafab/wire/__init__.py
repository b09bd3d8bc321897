"""Bytes from a controller, split into lines."""

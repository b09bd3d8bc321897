"""Bytes on a cable: what a controller says, split into lines."""

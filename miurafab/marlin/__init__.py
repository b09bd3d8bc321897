"""The Marlin protocol without I/O."""

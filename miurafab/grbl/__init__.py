"""The GRBL protocol without I/O: events, state table, connection, streamer, settings."""

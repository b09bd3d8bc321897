"""Everything that touches a port: transport, session, delivery, journal, resume, pre-flight."""

"""Everything that touches a port: transport, session, driver, journal, resume, pre-flight."""

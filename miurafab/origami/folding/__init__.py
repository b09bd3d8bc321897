"""Folding motion: rigid kinematics, bending, contact, thick panels."""

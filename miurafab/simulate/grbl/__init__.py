"""A GRBL 1.1 controller and its dialects, simulated step by step as the firmware runs."""

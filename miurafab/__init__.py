"""miurafab: from a curved surface to a folded origami shell, cut on a real machine."""

__version__ = "0.1.0"

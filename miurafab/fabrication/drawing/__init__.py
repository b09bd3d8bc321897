"""Drawings of sheets and guides: SVG, DXF, PDF, HPGL."""

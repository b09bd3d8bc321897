"""Plain geometry of grids, angles and distances; it knows no origami."""

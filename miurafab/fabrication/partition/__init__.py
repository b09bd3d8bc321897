"""Splitting a pattern into patches: grids, regions, rectangle covers, seam minimum cuts."""

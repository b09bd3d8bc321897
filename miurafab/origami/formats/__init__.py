"""File formats of patterns: FOLD, SVG, line drawings (DXF, CP, OPX), OBJ, meshes."""

"""The origami tower: tessellations, crease patterns, fitting, folding, energy, file formats."""

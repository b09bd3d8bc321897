"""The HPGL plotter protocol without I/O."""

"""G-code: words, programs, arcs, what a program does; HPGL as well."""

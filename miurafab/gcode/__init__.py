"""G-code and HPGL: lines to send, the parser, and what a program does."""

(one move that leaves a bed of 400 mm by 0.8 microns)
G21
G90
M4 S0
G0 X5 Y5
G1 X400.0008 S100 F1000
M5
G0 X0 Y0

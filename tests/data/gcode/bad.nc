(a line far off a bed of 400 mm, a dwell that M4 keeps dark, and more than full power)
G21
G90
M4 S0
G0 X5 Y5
G1 X500 S100 F1000
G4 P1
G1 X10 S1500
M5
G0 X0 Y0

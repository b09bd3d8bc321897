(sheet sheet-01)
(machine grbl-laser-400)
(material card-250)
M5
G21
G90
G17
G94
M4 S0
(operation engrave)
(patch 0)
G0 X3 Y4
G1 X6 Y8 S150 F3000
(operation score)
G0 X20 Y50
G1 X50 Y50 S250 F2400
(operation perforate)
G0 X60 Y50
G1 X60 Y90 S700 F1500
(operation cut)
G0 X100 Y100
G1 X130 Y100 S800 F900
G1 X130 Y140
G1 X100 Y140
M5
G0 X0 Y0
M2

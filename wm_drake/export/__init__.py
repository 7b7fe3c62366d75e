"""Export of a machine to other programs: as an FMU (Functional Mock-up Unit).

Enters: the parameters of a machine and a load. Leaves: a file. The compiled engine becomes machine
code that needs neither Python nor this package.
May import: rooms up to simulation; no plotting library.
"""

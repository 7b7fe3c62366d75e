"""Write reports as HTML pages, tables and figures, one folder per page.

Enters: results of studies and records. Leaves: files. This is the only room that imports a plotting
library or a template library.
May import: `studies` and the rooms before it.
"""

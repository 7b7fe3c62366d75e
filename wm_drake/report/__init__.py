"""Reports as HTML pages, tables and figures, one folder per page.

This is the only room that imports a plotting library. It turns results of studies into files.
"""

"""Write reports as HTML pages, tables and figures, one folder per page.

Enters: values, tables, figures. Leaves: pages, files, text on the terminal. Blocks are generic;
the page of a study is `studies/NAME/page.py`. Folders that still import studies move there.
May import: `rigs` and the rooms before it.
"""

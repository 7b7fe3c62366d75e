"""Serve a page on this computer that runs a machine again at each move of a slider.

Enters: machine files and requests of the page. Leaves: the page (`static`, plain modules), answers
in JSON, machine files in one folder, and studies as processes of the command. `machines` opens
machines and lists their numbers, `state` is what a page has chosen, `answers` runs it, `turns`
decides who runs next, `saving` writes machine files, `jobs` runs studies, `server` and `guard` are
the web server; `exported` writes the page as one file with the machine in it.
May import: `batch`, `report` (not its pages) and the rooms before them; `starlette`, `uvicorn`.
"""

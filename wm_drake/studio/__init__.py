"""Serve a page on this computer that runs a machine again at each move of a slider.

Enters: machine files and requests of the page (`wm_drake.live`). Leaves: answers in JSON, machine
files in one folder, and studies as processes of the command. `machines` opens machines, `answers`
runs what a page has chosen, `turns` decides who runs next, `saving` writes machine files, `jobs`
runs studies, `server` and `guard` are the web server.
May import: `live`, `studies` and the rooms before them; `starlette`, `uvicorn`.
"""

"""Export of a machine to other programs: as an FMU (Functional Mock-up Unit), or for a browser.

Enters: the parameters of a machine and a load. Leaves: a file, or code and numbers for a page
(`page_kernel`, `page_model`, `wasm`). The compiled engine becomes code that needs neither Python
nor this package.
May import: rooms up to simulation; no plotting library.
"""

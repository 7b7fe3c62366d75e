"""Numbers of a page are those of `wm-drake spin`: as exported, and after each slider was moved.

The page runs in node, bit for bit as in a browser (tests/browser/test_exported_page.py).
"""

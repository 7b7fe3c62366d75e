"""Scripts of a page: own files of this room, allowed by their hashes, and the packed Plotly.

A page allows no request and no script but those whose hashes it names (Content-Security-Policy),
so text that reaches a page by mistake as markup does nothing.
"""

import base64
import functools
import gzip
import hashlib
import importlib.metadata
import importlib.util
import re
from pathlib import Path

from markupsafe import Markup

from wm_drake.compiler.kept import kept

FOLDER = Path(__file__).parent

POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; "
    "script-src blob: {scripts}; {frames}base-uri 'none'; form-action 'none'"
)
"""What a page may do: show its own images and styles, and run the scripts with these hashes."""

FRAMES = "frame-src blob:; worker-src blob:; "
"""What a page with another one in a frame may do beside that."""

_POLICY = re.compile(r'http-equiv="Content-Security-Policy" content="([^"]*)"')
_HASH = re.compile(r"sha256-[\w+/]+=*")


class Scripts:
    """Scripts of one page."""

    def __init__(self) -> None:
        """Begin a page without scripts."""
        self._allowed: list[str] = []
        self._frames = ""

    def file(self, path: str | Path) -> Markup:
        """Return a script as an element, and allow it.

        Args:
            path: Name of a file in this folder, or path of one elsewhere.
        """
        return self.inline((FOLDER / path).read_text(encoding="utf-8"))

    def inline(self, text: str) -> Markup:
        """Return a text of a template as a script element, and allow it.

        Args:
            text: The script. It has no data of the user; those stand in elements of JSON.
        """
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        self._allowed.append(f"'sha256-{digest}'")
        return Markup(f"<script>{text}</script>")

    def framed(self, page: str) -> str:
        """Return a page, gzip-packed as Base64 text, and allow what it does in a frame.

        A frame inherits the policy of the page around it.

        Args:
            page: A page with a policy, which begins with it. It may use WebAssembly and workers.
        """
        policy = _POLICY.search(page)
        hashes = _HASH.findall(policy[1]) if policy else []
        self._allowed += ["'wasm-unsafe-eval'", *(f"'{digest}'" for digest in hashes)]
        self._frames = FRAMES
        return base64.b64encode(gzip.compress(page.encode(), 6, mtime=0)).decode()

    def policy(self) -> str:
        """Return the policy of the page, with the scripts that were added before."""
        return POLICY.format(scripts=" ".join(dict.fromkeys(self._allowed)), frames=self._frames)


@functools.cache
def packed_plotly() -> str:
    """Return Plotly's script, gzip-packed, as Base64 text: 1.9 MB in place of 4.8 MB."""
    spec = importlib.util.find_spec("plotly")  # importing Plotly itself is not needed
    assert spec is not None
    assert spec.origin is not None
    script = Path(spec.origin).parent / "package_data" / "plotly.min.js"
    key = f"plotly {importlib.metadata.version('plotly')}"
    return kept(
        key, lambda: base64.b64encode(gzip.compress(script.read_bytes(), 6, mtime=0))
    ).decode()

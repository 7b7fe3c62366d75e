"""Text of an SDF file as a tree of elements that know their lines.

It is read once more by sdformat, which takes of `1,5`, of `88.2 lb` and of a number with a comment
inside only what stands in front. So comments inside of values and document types are refused here,
and `wm_drake.model.sdf_elements` checks all else.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NoReturn
from xml.parsers import expat


class SdfTextError(ValueError):
    """A text that is no XML, or has more in it than an SDF file may have."""


@dataclass(eq=False)
class Node:
    """An element of an SDF file.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: Number of the line of its begin, from 1 on.
        parent: Element that contains it; None for the root.
        children: Elements in it.
        text: Text in it, without that of the elements in it.
        has_comment: Whether a comment is directly in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    parent: "Node | None"
    children: list["Node"] = field(default_factory=list)
    text: str = ""
    has_comment: bool = False

    @property
    def name(self) -> str:
        """Return its attribute `name`; empty if it has none."""
        return self.attributes.get("name", "")

    @property
    def words(self) -> str:
        """Return its text with single spaces."""
        return " ".join(self.text.split())

    def iter(self, tag: str) -> Iterator["Node"]:
        """Yield all elements below it that have a name, in the order of the file."""
        waiting = self.children[::-1]
        while waiting:
            node = waiting.pop()
            if node.tag == tag:
                yield node
            waiting.extend(node.children[::-1])

    def find(self, *path: str) -> "Node | None":
        """Return the first element at a path of names below it; None if there is none."""
        node = self
        for tag in path:
            inside = next((child for child in node.children if child.tag == tag), None)
            if inside is None:
                return None
            node = inside
        return node

    def text_at(self, *path: str) -> str:
        """Return the text of the first element at a path of names; empty if there is none."""
        node = self.find(*path)
        return node.words if node else ""

    @property
    def label(self) -> str:
        """Return what it is, in words, such as `<mass> of link 'tub'`."""
        label = f"{self.tag} '{self.name}'" if self.name else f"<{self.tag}>"
        above = self.parent
        while above is not None and not above.name:
            above = above.parent
        if above is None or above.tag == "model":
            return label
        return f"{label} of {above.label}" if self.tag != "link" else label


def read_sdf(text: str) -> Node:
    """Return the root element of an SDF text.

    Raises:
        SdfTextError: it is not XML, or has a document type.
    """
    reader = _Reader()
    try:
        reader.parser.Parse(text.encode(), True)
    except expat.ExpatError as error:
        raise SdfTextError(f"cannot be read: {error}") from None
    except ValueError as error:  # text that no encoding has, such as half a character
        raise SdfTextError(f"cannot be read: {error}") from None
    assert reader.root is not None  # expat refuses a text without an element
    return reader.root


class _Reader:
    """Handlers of expat that build the tree."""

    def __init__(self) -> None:
        self.root: Node | None = None
        self._open: list[Node] = []
        self.parser = expat.ParserCreate("utf-8")
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._data
        self.parser.CommentHandler = self._comment
        self.parser.StartDoctypeDeclHandler = self._doctype

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        parent = self._open[-1] if self._open else None
        node = Node(tag, attributes, self.parser.CurrentLineNumber, parent)
        if parent is None:
            self.root = node
        else:
            parent.children.append(node)
        self._open.append(node)

    def _end(self, _: str) -> None:
        self._open.pop()

    def _data(self, text: str) -> None:
        self._open[-1].text += text

    def _comment(self, _: str) -> None:
        if self._open:
            self._open[-1].has_comment = True

    def _doctype(self, *_: Any) -> NoReturn:
        raise SdfTextError("has a document type (<!DOCTYPE>), which is not allowed")

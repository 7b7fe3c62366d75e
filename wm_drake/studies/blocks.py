"""Blocks: what a package adds to the page of a study that knows nothing of it.

    OF_VERDICT = PageBlock("price", "verdict", begin)
    wm_drake.register_block(OF_VERDICT)

An entry point of the group `wm_drake.blocks` does the same. What to measure next, on the pages of
`verdict` and `calibrate`, and `--live` are such blocks.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

from wm_drake.registry import Registry

Extend: TypeAlias = Callable[[Any, Any], Any]
"""Function of the executor and the answer of a study that returns the answer with a block."""


@dataclass(frozen=True)
class PageBlock:
    """A block of the page of a study.

    Attributes:
        name: Name of the block.
        study: Words of the command of the study.
        begin: Called with the task when its options have been checked; returns the function that
            adds the block, or None if there is nothing to add. Whatever is wrong with the options
            raises an `InputError` here.
        options: Options that the command has for the block: type and `option(...)` by name.

    Example:
        >>> import wm_drake as wm
        >>> wm.PageBlock("price", "verdict", lambda task: None).study
        'verdict'
    """

    name: str
    study: str
    begin: Callable[[Any], Extend | None]
    options: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)


BLOCKS: Registry[PageBlock] = Registry("block of a page", "wm_drake.blocks", [])
"""Blocks by name."""


def register_block(block: PageBlock) -> PageBlock:
    """Add a block to the page of a study, and return it.

    Raises:
        ValueError: another block has this name.

    Example:
        The same declaration may be registered twice.

        >>> import wm_drake as wm
        >>> from wm_drake.studies.next.blocks import OF_VERDICT
        >>> wm.register_block(OF_VERDICT).study
        'verdict'
    """
    return BLOCKS.register(block)


def blocks_of(study: str) -> tuple[PageBlock, ...]:
    """Return the blocks of the page of a study, by the words of its command."""
    return tuple(block for block in BLOCKS.values() if block.study == study)

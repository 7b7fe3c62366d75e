"""Sources of an FMU, for importers that compile it themselves.

The machine code is in C files as text for the assembler, which GCC and Clang compile on the
platforms that the FMU is exported for.
"""

import json
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping

from wm_drake.export.description import IDENTIFIER
from wm_drake.export.object_code import Platform, assembly

LEFT_OUT = ("\t.file", "\t.ident")
"""Beginnings of lines that the compiler writes itself."""


def sources_in_c(code: Mapping[str, str], platform: Platform) -> dict[str, bytes]:
    """Return the C files with the functions of a platform, by file name.

    Each function has its own file, because labels of an assembler are valid in a whole file.

    Args:
        code: LLVM's text of the functions, as for `assembly`.
        platform: The platform; elsewhere the files are empty.
    """
    texts = assembly(code, platform)
    return {f"{symbol}_{platform.name}.c": _in_c(text, platform) for symbol, text in texts.items()}


def _in_c(text: str, platform: Platform) -> bytes:
    lines = [line for line in text.splitlines() if not line.startswith(LEFT_OUT)]
    body = "\n".join(["__asm__(", *(json.dumps(f"{line}\n") for line in lines), ");"])
    head = f"/* Machine code of the washing machine for {platform.name}. */"
    empty = "typedef int wm_other_platform;"
    return f"{head}\n#if {platform.condition}\n{body}\n#else\n{empty}\n#endif\n".encode()


def build_description(names: Iterable[str]) -> bytes:
    """Return `buildDescription.xml` of FMI 3.0 for the files that are compiled."""
    root = ET.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = ET.SubElement(root, "BuildConfiguration", modelIdentifier=IDENTIFIER)
    files = ET.SubElement(configuration, "SourceFileSet", language="C11")
    for name in names:
        ET.SubElement(files, "SourceFile", name=name)
    ET.SubElement(configuration, "Library", name="m", external="true")
    ET.indent(root)
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))

"""What is wrong with the outcome of a hostile input."""

import re

SECONDS_LIMIT = 10.0
LONGEST_LINE = 500
MOST_LINES = 25
MOST_PROBLEMS = 9
PYTHON = re.compile(
    r"Traceback|\[Errno|np\.\w+\(|<class |object at 0x|Error\(|Exception|InertiaMatrix|pydantic|ruamel|pandas|numpy|NoneType"
)
"""Python shows through in a message."""


def faults(outcome):
    """Return what is wrong with the outcome of a case, one text each."""
    found = []
    code, err = outcome["code"], outcome["err"]
    lines = err.splitlines()
    if code not in (0, 2):
        found.append(f"exit code {code}")
    if outcome["seconds"] > SECONDS_LIMIT:
        found.append(f"took {outcome['seconds']:.1f} s")
    if match := PYTHON.search(err):
        found.append(f"'{match[0]}' in the message")
    outside = [p for p in outcome["changed"] if code != 0 or not p.startswith("work/wm-drake-")]
    if outside:
        found.append(f"wrote {outside[:3]}")
    if any(len(line) > LONGEST_LINE for line in lines) or len(lines) > MOST_LINES:
        found.append(f"{len(lines)} lines, the longest of {max(map(len, lines))} characters")
    if any(not c.isprintable() for line in lines for c in line):
        found.append("control characters in the message")
    return [*found, *(faults_of_refusal(outcome) if code == 2 else [])]


def faults_of_refusal(outcome):
    """Return what is wrong with the way in which a case was refused."""
    found, err = [], outcome["err"]
    if outcome["out"]:
        found.append("standard output")
    framed = any(word in err for word in ("Usage:", "Error ──", "notice:"))
    if len(err.splitlines()) > MOST_PROBLEMS and not framed:
        found.append(f"message of {len(err.splitlines())} lines")
    if not any(name in err for name in outcome["names"]):
        found.append("names neither file nor option")
    if outcome["keys"] and not any(key in err for key in outcome["keys"]):
        found.append(f"names none of the keys {outcome['keys']}")
    return found

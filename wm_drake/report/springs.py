"""Words on springs that go slack, for pages and terminal."""

from collections.abc import Mapping, Sequence

CONSEQUENCE = (
    "A slack spring does not guide the tub, and its hooks are loaded abruptly when it pulls again."
)


def slack_warning(slack: Mapping[str, Sequence[str]], word: str) -> list[str]:
    """Return a warning in a list, or an empty list if no spring goes slack.

    Args:
        slack: Names of the springs that go slack, by case.
        word: Word before the names of cases, such as "case".
    """
    cases: dict[str, list[str]] = {}
    for case, springs in slack.items():
        for spring in springs:
            cases.setdefault(spring, []).append(case)
    if not cases:
        return []
    listing = "; ".join(f"{spring} in {word} {', '.join(of)}" for spring, of in cases.items())
    return [f"Springs go slack: {listing}. {CONSEQUENCE}"]

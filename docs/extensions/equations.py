"""Equations of docstrings in MathML: what a terminal shows as text, the manual shows typeset.

An equation is written once, in the docstring of its law, in the plain text that its code uses:

    f = -g w / (|u| + epsilon),  |w| <  |u|      [C] Eq. (7)

Three spaces or more end a column. `a b` is a product, `a(b)` a function of b, `a x b` the cross
product of two operands, ` . ` the dot product. `a/b` without spaces divides its neighbours; with
spaces it divides the product before it by the factor behind it. `_` and `^` make indices and
powers, a prime is a time derivative. Words stay words. Browsers draw MathML without any script.
"""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape

GREEK = {
    "delta": "δ",
    "eps": "ε",
    "epsilon": "ε",
    "lambda": "λ",
    "mu": "μ",
    "omega": "ω",
    "phi": "φ",
    "pi": "π",
    "tau": "τ",
    "theta": "θ",
}
FUNCTIONS = {"sin", "cos", "tan", "cot", "exp", "tanh", "sgn", "clip", "min", "max"}
FUNCTIONS |= {"HAVSIN", "curve"}
TWO_LETTERS = {"xs": ("x", "s"), "da": ("d", "a"), "dv": ("d", "v"), "dq": ("d", "q")}
"""Names of two letters: x with index s in [A], and differentials."""
RELATIONS = {"=": "=", "<": "&lt;", ">": "&gt;", "<=": "≤", ">=": "≥", "+": "+", "-": "−"}
SEPARATORS = {",": ",", ";": ";", ":": ":"}
TOKEN = re.compile(
    r"(?P<space>\s+)|(?P<number>\d+(?:\.\d+)?)|(?P<primes>'+)"
    r"|(?P<word>[A-Za-z]+(?:-[a-z][A-Za-z]+|-[A-Z][a-z]+|'s\b)*(?P<digits>\d*))"
    r"|(?P<sign><=|>=|[-=<>+*/^_.,;:|()\[\]])"
)
RELATION = re.compile("[=<>]|min over")
SOURCE = re.compile(r"\[[ABC]\]")
CITATION = re.compile(r'<mtext class="source">(\[[ABC]\]|own derivation)')
WORDS = re.compile(r"(?!for\b|min\b|max\b|sum\b|curve\b)[A-Za-z]{3,}[-' :,]")
COLUMN = re.compile(r"\s{3,}")
CODE = re.compile(r"(`+[^`]*`+)")
INDEX = re.compile(r"(?<![\w./])([A-Za-z])_([A-Za-z0-9]+)(?!\w)")
POWER = re.compile(r"(?<=[\w)|])\^(-?\w+)")


@dataclass(frozen=True)
class Token:
    """A token and whether space is around it."""

    kind: str
    text: str
    after_space: bool
    before_space: bool


@dataclass(frozen=True)
class Factor:
    """A piece of a product: its MathML, what brackets contain, and whether it is a word."""

    mathml: str
    inside: str | None = None
    is_word: bool = False


def mathml_of(block: list[str]) -> str | None:
    """Return the MathML of an indented block of a docstring, or None if it is no equation."""
    text = "\n".join(block)
    if "->" in text or not RELATION.search(text):
        return None
    try:
        return equations(block)
    except ValueError:
        return None


def with_indices(text: str) -> str:
    """Return the text of a sentence, in reStructuredText, with its indices and powers typeset.

    A formula in a sentence has no mark, so where it ends cannot be told; `x_c` and `m^2` can. A
    name of code has several underscores or letters before the first, or stands in backticks.
    """

    def index(match: re.Match[str]) -> str:
        return rf"\ *{match[1]}*\ :sub:`{match[2]}`\ "

    parts = CODE.split(text)
    raised = [POWER.sub(r"\\ :sup:`\1`\\ ", part) for part in parts[::2]]
    parts[::2] = [INDEX.sub(index, part) for part in raised]
    return "".join(parts)


def equations(lines: list[str]) -> str:
    """Return the MathML of the lines of an equation."""
    whole: list[str] = []
    for line in filter(str.strip, lines):
        if whole and _indent(line) > _indent(whole[0]) + 8:  # the last column continues
            whole[-1] += " " + line.strip()
        else:
            whole.append(line)
    return "".join(_table(list(rows)) for _, rows in itertools.groupby(whole, _second_column))


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def _second_column(line: str) -> int:
    """Return where the second column of a line begins, 0 if there is none."""
    match = COLUMN.search(line, _indent(line))
    return match.end() if match else 0


def _table(lines: list[str]) -> str:
    """Return the MathML of lines with the same columns, and their sources below."""
    rows = [[_column(cell) for cell in COLUMN.split(line.strip())] for line in lines]
    sources = [row.pop() for row in rows if CITATION.match(row[-1])]
    table = "".join(
        "<mtr>" + "".join(f"<mtd>{cell}</mtd>" for cell in row) + "</mtr>" for row in rows
    )
    whole = f'<math display="block"><mtable displaystyle="true">{table}</mtable></math>'
    below = "; ".join(re.sub("<[^>]*>", "", source) for source in sources)
    return whole + (f'<div class="source">{below}</div>' if below else "")


def _column(text: str) -> str:
    """Return the MathML of a column. A source, and a column of words, are text."""
    source = SOURCE.search(text)
    math = text[: source.start()] if source else text
    if WORDS.match(math) and not re.search("[=<>+_]", math):
        math, source = "", re.match("", text)
    note = text[source.start() :] if source else ""
    shown = _Reader(list(_tokens(math))).whole() if math.strip() else ""
    return shown + (f'<mtext class="source">{escape(note)}</mtext>' if note else "")


def _tokens(text: str) -> Iterator[Token]:
    at, spaced = 0, True
    while at < len(text):
        match = TOKEN.match(text, at)
        if match is None:
            message = f"no token of an equation: {text[at:]!r} in {text!r}"
            raise ValueError(message)
        at = match.end()
        if match["space"]:
            spaced = True
            continue
        kind = match.lastgroup if match.lastgroup != "digits" else "word"
        yield Token(str(kind), match[0], spaced, text[at : at + 1].isspace() or at == len(text))
        spaced = False


class _Reader:
    """Reads the tokens of a column from left to right."""

    def __init__(self, tokens: list[Token]) -> None:
        self.tokens, self.at = tokens, 0

    def whole(self) -> str:
        parts = []
        while self.at < len(self.tokens):
            parts.append(self._terms(closing=""))
            if self.at < len(self.tokens):  # a bracket that nothing opened
                parts.append(_sign(self._next().text))
        return f"<mrow>{''.join(parts)}</mrow>"

    def _peek(self, ahead: int = 0) -> Token | None:
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else None

    def _next(self) -> Token:
        self.at += 1
        return self.tokens[self.at - 1]

    def _terms(self, closing: str) -> str:
        """Read terms, relations and separators up to a closing bracket or the end."""
        parts: list[str] = []
        while (token := self._peek()) is not None and token.text not in (*")]", closing):
            if token.text in RELATIONS:
                self._next()
                prefix = ' form="prefix"' if not parts or parts[-1].endswith("</mo>") else ""
                parts.append(f"<mo{prefix}>{RELATIONS[token.text]}</mo>")
            elif token.text in SEPARATORS:
                self._next()
                parts.append(f"<mo separator='true'>{token.text}</mo>")
                if token.before_space:
                    parts.append("<mspace width='0.4em'/>")
            else:
                parts.append(self._product(closing))
        return "".join(parts)

    def _product(self, closing: str) -> str:
        """Read juxtaposed factors, with their quotients, cross and dot products."""
        done: list[Factor] = []
        factors: list[Factor] = []  # those since the last quotient
        while (token := self._peek()) is not None:
            if token.text in (*")]", closing) or token.text in RELATIONS | SEPARATORS:
                break
            if token.text == "/":
                self._next()
                below = self._factor(closing)
                if token.after_space:
                    done.append(_quotient(factors, below))
                    factors = []
                else:
                    factors[-1] = _quotient(factors[-1:], below)
            elif token.text in "*." or self._crosses(token, done or factors):
                self._next()
                factors.append(Factor(f"<mo>{'×' if token.text == 'x' else '⋅'}</mo>"))
            else:
                factors.append(self._factor(closing))
        return _joined(done + factors)

    def _crosses(self, token: Token, before: list[Factor]) -> bool:
        """Return whether an x between spaces stands between two operands."""
        behind = self._peek(1)
        is_between = token.text == "x" and token.after_space and token.before_space
        return bool(
            is_between
            and before
            and behind is not None
            and (behind.kind in ("word", "number") or behind.text in "(|")
        )

    def _factor(self, closing: str) -> Factor:
        """Read an atom with indices, primes, powers and arguments."""
        token = self._next()
        if token.text == "(":
            return self._scripts(self._bracket("(", ")"))
        if token.text == "[":
            return self._bracket("[", "]")
        if token.text == "|":
            return self._scripts(self._bracket("|", "|"))
        if token.kind == "number":
            return self._scripts(Factor(f"<mn>{token.text}</mn>"))
        if token.text == "sum":
            return Factor(f"<mrow><mo>∑</mo>{self._product(closing)}</mrow>")
        if token.text == "sqrt":
            self._next()
            return Factor(f"<msqrt>{self._bracket('(', ')').inside}</msqrt>")
        if token.kind == "word":
            return self._scripts(self._name(token))
        return Factor(_sign(token.text))

    def _bracket(self, opening: str, closing: str) -> Factor:
        inside = self._terms(closing)
        if self._peek() is not None:
            self._next()
        fence = (
            "<mo form='{}'>{}</mo>"
            if "mfrac" in inside
            else "<mo stretchy='false' form='{}'>{}</mo>"
        )
        whole = fence.format("prefix", opening) + inside + fence.format("postfix", closing)
        return Factor(f"<mrow>{whole}</mrow>", inside if opening == "(" else None)

    def _name(self, token: Token) -> Factor:
        """Return a name: a letter, a Greek one, a function, a letter with a number, or a word."""
        name = re.sub(r"\d+$", "", token.text)
        number = token.text[len(name) :]
        if name in TWO_LETTERS:
            first, second = TWO_LETTERS[name]
            if first == "d":
                return Factor(f"<mrow><mo>∂</mo><mi>{second}</mi></mrow>")
            return Factor(
                f"<msub><mi>{first}</mi><mrow><mi>{second}</mi>{_number(number)}</mrow></msub>"
            )
        if name in FUNCTIONS:
            return Factor(f"<mi>{name}</mi>")
        letter = GREEK.get(name, name)
        if len(letter) > 1:
            behind = self._peek()
            if behind is not None and behind.text == "_" and not behind.after_space:
                words = [letter]
                while (sub := self._peek(1)) is not None and sub.kind == "word":
                    self._next()
                    words.append(self._next().text)
                return Factor(f"<mtext>{' '.join(words)}</mtext>", is_word=True)
            return Factor(f"<mtext>{letter}{number}</mtext>", is_word=True)
        if number:
            return Factor(f"<msub><mi>{letter}</mi>{_number(number)}</msub>")
        return Factor(f"<mi>{letter}</mi>")

    def _scripts(self, base: Factor) -> Factor:
        """Read what follows an atom without a space: primes, index, power, argument."""
        bare, below, above = base, "", ""
        while (token := self._peek()) is not None and not token.after_space:
            if token.kind == "primes":
                primes = "′" * len(self._next().text)
                base = Factor(f"<mrow>{base.mathml}<mo lspace='0' rspace='0'>{primes}</mo></mrow>")
            elif token.text in "_^":
                self._next()
                script = self._script()
                below, above = (
                    (below + script, above) if token.text == "_" else (below, above + script)
                )
            else:
                break
        mathml = _scripted(base.mathml, below, above)
        token = self._peek()
        if token is not None and token.text == "(" and not token.after_space:
            self._next()
            argument = self._bracket("(", ")")
            mathml = f"<mrow>{mathml}<mo>&#x2061;</mo>{argument.mathml}</mrow>"
            return self._scripts(Factor(mathml))
        return bare if mathml == bare.mathml else Factor(mathml)

    def _script(self) -> str:
        token = self._next()
        if token.text == "(":
            return f"<mrow>{self._bracket('(', ')').inside}</mrow>"
        if token.text == "-":
            return f"<mrow><mo form='prefix'>−</mo>{self._script()}</mrow>"
        if token.kind == "number":
            return f"<mn>{token.text}</mn>"
        if len(token.text) == 1:
            return f"<mi>{token.text}</mi>"
        return f"<mtext>{GREEK.get(token.text, token.text)}</mtext>"


def _quotient(above: list[Factor], below: Factor) -> Factor:
    top = above[0].inside if len(above) == 1 and above[0].inside else _joined(above)
    bottom = below.inside or below.mathml
    return Factor(f"<mfrac><mrow>{top}</mrow><mrow>{bottom}</mrow></mfrac>")


def _joined(factors: list[Factor]) -> str:
    """Return a product, with a space between words and thin ones between other factors."""
    text, before = "", None
    for factor in factors:
        if before is not None:
            wide = before.is_word or factor.is_word
            text += f"<mspace width='{'0.35em' if wide else '0.12em'}'/>"
        text, before = text + factor.mathml, factor
    return text


def _scripted(base: str, below: str, above: str) -> str:
    if below and above:
        return f"<msubsup>{base}<mrow>{below}</mrow><mrow>{above}</mrow></msubsup>"
    if below:
        return f"<msub>{base}<mrow>{below}</mrow></msub>"
    return f"<msup>{base}<mrow>{above}</mrow></msup>" if above else base


def _number(text: str) -> str:
    return f"<mn>{text}</mn>" if text else ""


def _sign(text: str) -> str:
    return f"<mo>{escape(text)}</mo>"

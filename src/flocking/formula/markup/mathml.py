"""MathML from LaTeX: the part of LaTeX's mathematics in which formulas of this library are written."""

from __future__ import annotations

import re
from html import escape

from flocking.errors import InvalidInput

LATIN = (
    "alpha beta gamma delta epsilon varepsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon "
    "phi varphi chi psi omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega ell hbar"
)
"""Names of letters, in the order of the letters."""

LETTERS = dict(zip(LATIN.split(), "αβγδϵεζηθικλμνξπρστυϕφχψωΓΔΘΛΞΠΣΥΦΨΩℓℏ", strict=True))
"""Commands that are letters."""

OPERATORS = {
    "cdot": "⋅", "times": "×", "le": "≤", "leq": "≤", "ge": "≥", "geq": "≥", "neq": "≠", "ne": "≠", "in": "∈",
    "notin": "∉", "subset": "⊂", "cup": "∪", "cap": "∩", "to": "→", "rightarrow": "→", "Rightarrow": "⇒", "pm": "±",
    "mp": "∓", "approx": "≈", "equiv": "≡", "sim": "∼", "infty": "∞", "partial": "∂", "nabla": "∇", "sum": "∑",
    "prod": "∏", "int": "∫", "ldots": "…", "dots": "…", "cdots": "⋯", "lVert": "‖", "rVert": "‖", "Vert": "‖", "|": "‖",
    "lvert": "|", "rvert": "|", "vert": "|", "langle": "⟨", "rangle": "⟩", "lfloor": "⌊", "rfloor": "⌋", "lceil": "⌈",
    "rceil": "⌉", "prime": "′", "perp": "⊥", "top": "⊤", "wedge": "∧", "vee": "∨", "colon": ":", "{": "{", "}": "}",
    "%": "%", "mid": "|", "forall": "∀", "exists": "∃", "emptyset": "∅", "circ": "∘", "ast": "∗", "otimes": "⊗",
    "lim": "lim", "gg": "≫", "ll": "≪", "backslash": "∖", "land": "∧", "lor": "∨",
}  # fmt: skip
"""Commands that are operators or other signs."""

FUNCTIONS = (
    "log ln exp sin cos tan cot sec csc sinh cosh tanh asin acos atan arcsin arccos arctan max min sup inf det dim "
    "diag tr sign sgn arg rank ker deg gcd"
)
NAMES = frozenset(FUNCTIONS.split())
"""Commands that are names of functions, set upright."""

ACCENTS = {"hat": "^", "widehat": "^", "bar": "¯", "overline": "¯", "tilde": "~", "widetilde": "~", "dot": "˙",
           "ddot": "¨", "vec": "→"}  # fmt: skip
"""Accents over their argument."""

SPACES = {",": "0.17em", ":": "0.22em", ";": "0.28em", " ": "0.33em", "quad": "1em", "qquad": "2em", "!": "-0.17em"}
"""Spaces."""

UPRIGHT = frozenset({"mathrm", "operatorname", "text", "textrm", "mathbf", "mathcal", "mathbb", "boldsymbol"})
"""Commands whose argument is set in another font."""

FONTS = {"mathbf": "bold", "boldsymbol": "bold", "mathcal": "script", "mathbb": "double-struck"}
"""Their fonts, where they are not upright."""

ROWS = frozenset({"cases", "aligned", "align", "matrix", "pmatrix", "bmatrix", "array", "gathered"})
"""Environments of rows."""

ROW_END, END = "\\\\", "\\end"
"""Ends of rows and of environments."""

LARGE = frozenset("∑∏")
"""Operators whose bounds stand below and above."""

TOKEN = re.compile(r"\\([A-Za-z]+\*?|.)|(\d+(?:\.\d+)?)|(\s+)|(.)", re.DOTALL)

DEEPEST = 60
"""Nesting of braces at most; deeper ones are refused, as they would exhaust the stack."""


class _Reader:
    """Reads a formula from left to right."""

    def __init__(self, latex: str) -> None:
        self.latex = latex
        found = [(m.start(), m.group(0)) for m in TOKEN.finditer(latex) if not m.group(0).isspace()]
        self.tokens = [text for _, text in found]
        self.sources = [start for start, _ in found]
        self.place = 0
        self.depth = 0

    def fault(self, what: str) -> InvalidInput:
        return InvalidInput("to_mathml", "latex", f"must be a formula that can be set ({what})", self.latex)

    @property
    def next(self) -> str:
        return self.tokens[self.place] if self.place < len(self.tokens) else ""

    def take(self) -> str:
        found = self.next
        if not found:
            raise self.fault("it ends too early")
        self.place += 1
        return found

    def expect(self, token: str) -> None:
        if self.take() != token:
            raise self.fault(f"{token} is missing")

    def row(self, *ends: str) -> str:
        """Everything up to one of the ``ends``, which is left."""
        self.depth += 1
        if self.depth > DEEPEST:
            raise self.fault("it is nested too deeply")
        parts: list[str] = []
        while self.next not in ends:
            parts.append(self.scripted())
        self.depth -= 1
        return "".join(parts)

    def group(self) -> str:
        """An argument: in braces, or one token."""
        if self.next != "{":
            return self.atom()
        self.take()
        inside = self.row("}")
        self.expect("}")
        return f"<mrow>{inside}</mrow>"

    def scripted(self) -> str:
        """An atom with its subscript, superscript and primes."""
        base = self.atom()
        lower, upper = "", ""
        while self.next in ("_", "^", "'"):
            token = self.take()
            if token == "_":
                lower += self.group()
            elif token == "^":
                upper += self.group()
            else:
                upper += "<mo>′</mo>"
        lower, upper = (f"<mrow>{x}</mrow>" if x and not x.startswith("<mrow>") else x for x in (lower, upper))
        large = any(f">{sign}<" in base for sign in LARGE)
        if lower and upper:
            return (
                f"<munderover>{base}{lower}{upper}</munderover>"
                if large
                else f"<msubsup>{base}{lower}{upper}</msubsup>"
            )
        if lower:
            return f"<munder>{base}{lower}</munder>" if large else f"<msub>{base}{lower}</msub>"
        return f"<msup>{base}{upper}</msup>" if upper else base

    def atom(self) -> str:
        token = self.take()
        if token == "{":
            self.place -= 1
            return self.group()
        if token.startswith("\\") and len(token) > 1:
            return self.command(token[1:])
        if token[0].isdigit():
            return f"<mn>{token}</mn>"
        if token.isalpha():
            return f"<mi>{token}</mi>"
        if token in "}&":
            raise self.fault(f"{token} stands alone")
        sign = {"-": "−", "*": "∗", "~": "\u00a0"}.get(token, token)
        fixed = ' stretchy="false"' if token in "()[]|/" else ""
        return f"<mo{fixed}>{escape(sign)}</mo>"

    def command(self, name: str) -> str:
        if name in LETTERS:
            return f"<mi>{LETTERS[name]}</mi>"
        if name in OPERATORS:
            sign = OPERATORS[name]
            fixed = ' stretchy="false"' if sign in "‖|⟨⟩{}" else ""
            return f"<mi>{sign}</mi>" if sign in "∞∅⊤" else f"<mo{fixed}>{sign}</mo>"
        if name in NAMES:
            return f"<mi>{name}</mi><mo>&#x2061;</mo>"
        if name in SPACES:
            return f'<mspace width="{SPACES[name]}"></mspace>'
        if name in ("frac", "dfrac", "tfrac"):
            return f"<mfrac>{self.group()}{self.group()}</mfrac>"
        if name == "sqrt":
            return self.root()
        if name in ACCENTS:
            return f'<mover accent="true">{self.group()}<mo stretchy="false">{ACCENTS[name]}</mo></mover>'
        if name in UPRIGHT:
            return self.words(name)
        if name == "left":
            return self.fenced()
        if name == "begin":
            return self.environment()
        if name in ("displaystyle", "limits", "big", "Big", "bigl", "bigr"):
            return ""
        raise self.fault(f"\\{name} is unknown")

    def root(self) -> str:
        if self.next != "[":
            return f"<msqrt>{self.group()}</msqrt>"
        self.take()
        order = self.row("]")
        self.expect("]")
        return f"<mroot>{self.group()}<mrow>{order}</mrow></mroot>"

    def fenced(self) -> str:
        first = self.delimiter()
        inside = self.row("\\right")
        self.expect("\\right")
        return f"<mrow>{first}{inside}{self.delimiter()}</mrow>"

    def delimiter(self) -> str:
        token = self.take()
        sign = OPERATORS.get(token[1:], "") if token.startswith("\\") else token
        return "" if sign == "." else f'<mo stretchy="true">{escape(sign)}</mo>'

    def name(self) -> str:
        self.expect("{")
        found = []
        while self.next != "}":
            found.append(self.take())
        self.expect("}")
        return "".join(found)

    def words(self, font: str) -> str:
        """Text in braces, read from the source, as spaces count."""
        begin = self.sources[self.place] if self.place < len(self.sources) else len(self.latex)
        self.expect("{")
        depth, end = 1, begin + 1
        while depth and end < len(self.latex):
            depth += {"{": 1, "}": -1}.get(self.latex[end], 0)
            end += 1
        while self.place < len(self.tokens) and self.sources[self.place] < end:
            self.place += 1
        text = self.latex[begin + 1 : end - 1].replace("\\", "")
        if font in ("text", "textrm"):
            return f"<mtext>{escape(text)}</mtext>"
        style = FONTS.get(font)
        shown = _styled(text, style) if style else text
        tag = f'<mi mathvariant="normal">{escape(shown)}</mi>'
        return tag if font != "operatorname" else tag + "<mo>&#x2061;</mo>"

    def environment(self) -> str:
        name = self.name()
        if name.rstrip("*") not in ROWS:
            raise self.fault(f"the environment {name} is unknown")
        if name == "array":
            self.name()
        rows: list[str] = []
        cells: list[str] = []
        while True:
            starts = name != "matrix" and (len(cells) > 0 or name.rstrip("*") == "cases")
            style = ' style="text-align: left"' if starts else ' style="text-align: right"' if "align" in name else ""
            cells.append(f"<mtd{style}>{self.row('&', ROW_END, END)}</mtd>")
            token = self.take()
            if token == "&":
                continue
            rows.append(f"<mtr>{''.join(cells)}</mtr>")
            cells = []
            if token == END:
                break
        if self.name() != name:
            raise self.fault(f"{name} is not closed")
        first, last = {"cases": ("{", ""), "pmatrix": ("(", ")"), "bmatrix": ("[", "]")}.get(name, ("", ""))
        fences = [f'<mo stretchy="true">{x}</mo>' if x else "" for x in (first, last)]
        kind = name.rstrip("*")
        look = "aligned" if kind in ("aligned", "align") else "cases" if kind == "cases" else "matrix"
        return f'<mrow>{fences[0]}<mtable class="{look}" displaystyle="true">{"".join(rows)}</mtable>{fences[1]}</mrow>'


SCRIPT = "𝒜ℬ𝒞𝒟ℰℱ𝒢ℋℐ𝒥𝒦ℒℳ𝒩𝒪𝒫𝒬ℛ𝒮𝒯𝒰𝒱𝒲𝒳𝒴𝒵"
DOUBLE = "𝔸𝔹ℂ𝔻𝔼𝔽𝔾ℍ𝕀𝕁𝕂𝕃𝕄ℕ𝕆ℙℚℝ𝕊𝕋𝕌𝕍𝕎𝕏𝕐ℤ"
BOLD_CAPITAL, BOLD_SMALL = 0x1D400, 0x1D41A
"""Code points of the bold A and a."""


def _styled(text: str, style: str) -> str:
    """Letters in a font that has code points of its own."""
    found = []
    for letter in text:
        place = ord(letter) - ord("A")
        if style == "bold" and letter.isascii() and letter.isalpha():
            first, base = (BOLD_CAPITAL, "A") if letter.isupper() else (BOLD_SMALL, "a")
            found.append(chr(first + ord(letter) - ord(base)))
        elif 0 <= place < len(SCRIPT) and style != "bold":
            found.append((SCRIPT if style == "script" else DOUBLE)[place])
        else:
            found.append(letter)
    return "".join(found)


def to_mathml(latex: str, *, block: bool = False) -> str:
    """A formula as MathML, with its LaTeX as an annotation for programs that read it out.

    Parameters
    ----------
    latex
        The formula in LaTeX, without dollar signs: letters, scripts, fractions, roots, accents, functions, brackets,
        cases and matrices.
    block
        Whether it stands on a line of its own.

    Raises
    ------
    InvalidInput
        Where it contains a command that is unknown, or braces that do not close.
    """
    reader = _Reader(latex)
    inside = reader.row("")
    display = ' display="block"' if block else ""
    return (
        f"<math{display}><semantics><mrow>{inside}</mrow>"
        f'<annotation encoding="application/x-tex">{escape(latex)}</annotation></semantics></math>'
    )

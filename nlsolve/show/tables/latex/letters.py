"""Letters that LaTeX does not print as they are typed, each with the command that prints it under every engine.

All commands are those of LaTeX itself and work in its oldest font encoding (OT1), so that a table needs no fonts.
"""

from __future__ import annotations

from collections.abc import Mapping


def _pairs(text: str) -> dict[str, str]:
    """Letter, command, letter, command, …"""
    words = text.split()
    return dict(zip(words[::2], words[1::2], strict=True))


TYPED: Mapping[str, str] = _pairs(
    r"""\ \textbackslash{} { \{ } \} ^ \textasciicircum{} ~ \textasciitilde{} & \& % \% _ \_ # \# $ \$ | \textbar{}
    < \textless{} > \textgreater{} " {\char34} ` {\char96} [ {[} ] {]} * {*} – -- — --- ‐ - ‑ - ‘ \textquoteleft{}
    ’ \textquoteright{} “ \textquotedblleft{} ” \textquotedblright{} … \dots{} † \dag{} ‡ \ddag{} § \S{} ¶ \P{}
    © \copyright{} £ \pounds{} € \texteuro{} ß \ss{} æ \ae{} Æ \AE{} œ \oe{} Œ \OE{} ø \o{} Ø \O{} ł \l{} Ł \L{} ı \i{}
    ¿ \textquestiondown{} ¡ \textexclamdown{}"""
)
"""Letters of text. A quotation mark is a command of babel, a bracket or star an argument of the end of a row."""

_GREEK = "αβγδεζηθικλμνξοπρςστυφχψωΓΔΘΛΞΠΣΥΦΨΩϑϕϖϱϵ"
_COMMANDS = (
    r"\alpha \beta \gamma \delta \varepsilon \zeta \eta \theta \iota \kappa \lambda \mu \nu \xi o \pi \rho \varsigma "
    r"\sigma \tau \upsilon \varphi \chi \psi \omega \Gamma \Delta \Theta \Lambda \Xi \Pi \Sigma \Upsilon \Phi \Psi "
    r"\Omega \vartheta \phi \varpi \varrho \epsilon"
)
_LATIN = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz"

MATHEMATICS: Mapping[str, str] = (
    dict(zip(_GREEK, _COMMANDS.split(), strict=True))
    | dict(zip("ΑΒΕΖΗΙΚΜΝΟΡΤΧ", (rf"\mathrm{{{letter}}}" for letter in "ABEZHIKMNOPTX"), strict=True))
    | {chr(0x1D434 + number): letter for number, letter in enumerate(_LATIN)}  # 𝐴 to 𝑧
    | {"ℎ": "h"}
    | _pairs(
        r"""‖ \| ∥ \| ∣ \mid ∇ \nabla ∂ \partial ∞ \infty ∫ \int ∑ \sum ∏ \prod √ \surd ∆ \Delta ∈ \in ∉ \notin ∋ \ni
        ∀ \forall ∃ \exists ∅ \emptyset ⊂ \subset ⊃ \supset ⊆ \subseteq ⊇ \supseteq ∪ \cup ∩ \cap ∧ \wedge ∨ \vee ¬ \neg
        ± \pm ∓ \mp × \times · \cdot ⋅ \cdot ÷ \div − - ∘ \circ ∙ \bullet • \bullet ∗ \ast ⊗ \otimes ⊕ \oplus ≤ \leq
        ≥ \geq ≪ \ll ≫ \gg ≠ \neq ≈ \approx ≡ \equiv ∼ \sim ≃ \simeq ≅ \cong ∝ \propto ⊥ \perp ∠ \angle ⟨ \langle
        ⟩ \rangle ⌊ \lfloor ⌋ \rfloor ⌈ \lceil ⌉ \rceil ← \leftarrow → \rightarrow ↑ \uparrow ↓ \downarrow
        ↔ \leftrightarrow ⇐ \Leftarrow ⇒ \Rightarrow ⇔ \Leftrightarrow ↦ \mapsto ℓ \ell ℏ \hbar ⋯ \cdots ′ ' ″ ''
        ° ^{\circ} µ \mu ∖ \setminus"""
    )
)
"""Letters of mathematics. 𝑝 and its like are the letters of variables; a micro sign is a μ."""

RAISED: Mapping[str, str] = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱ", "0123456789+-=()ni", strict=True))
LOWERED: Mapping[str, str] = dict(
    zip("₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₒₓₕₖₗₘₙₚₛₜᵢⱼᵣᵤᵥ", "0123456789+-=()aeoxhklmnpstijruv", strict=True)
)
"""Letters above and below the line."""

_ACCENTS = r"\grave \acute \hat \tilde \bar \overline \breve \dot \ddot \mathring \check \vec \underline"

TEXT_ACCENTS: Mapping[str, str] = dict(
    zip(
        map(chr, (0x300, 0x301, 0x302, 0x303, 0x304, 0x306, 0x307, 0x308, 0x30A, 0x30B, 0x30C, 0x327, 0x323, 0x331)),
        (r"\`", r"\'", r"\^", r"\~", r"\=", r"\u", r"\.", r"\"", r"\r", r"\H", r"\v", r"\c", r"\d", r"\b"),
        strict=True,
    )
)
MATHEMATICS_ACCENTS: Mapping[str, str] = dict(
    zip(
        map(chr, (0x300, 0x301, 0x302, 0x303, 0x304, 0x305, 0x306, 0x307, 0x308, 0x30A, 0x30C, 0x20D7, 0x332)),
        _ACCENTS.split(),
        strict=True,
    )
)
"""Accents behind their letter, of text and of mathematics."""

PLAIN = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 !()+,-./:;=?@'")
"""Letters that are printed as they are typed."""

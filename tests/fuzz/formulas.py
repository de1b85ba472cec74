"""Formula texts: from the grammar, and from pieces that do not fit."""

from __future__ import annotations

from hypothesis import strategies as st

LEAVES = st.sampled_from(["r", "r", "t", "R", "a", "1", "2", "0", "0.5", "1e9", "1e-9", "pi", "-3", "64", "1e100"])


def _joined(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    pair = st.tuples(inner, st.sampled_from(["+", "-", "*", "/", "**", "^"]), inner).map(
        lambda x: f"({x[0]}{x[1]}{x[2]})"
    )
    call = st.tuples(
        st.sampled_from(["sqrt", "exp", "log", "sin", "cos", "tan", "atan", "sinh", "cosh", "tanh", "abs"]), inner
    ).map(lambda x: f"{x[0]}({x[1]})")
    power = st.tuples(inner, st.integers(-70, 70)).map(lambda x: f"({x[0]})**({x[1]})")
    tower = st.tuples(st.integers(2, 60), inner).map(lambda x: f"exp({x[0]}*log({x[1]}))")
    where = st.tuples(inner, st.sampled_from("<>"), inner, inner, inner).map(
        lambda x: f"where({x[0]} {x[1]} {x[2]}, {x[3]}, {x[4]})"
    )
    return pair | call | power | tower | where


GRAMMAR = st.recursive(LEAVES, _joined, max_leaves=14)

SOUP = st.lists(
    st.sampled_from(
        [
            "r",
            "1",
            "(",
            ")",
            "+",
            "-",
            "*",
            "/",
            "**",
            ",",
            "where",
            "exp(",
            "log(",
            "<",
            ".",
            "[",
            "]",
            "_",
            "lambda",
            ":",
        ]
        + [" ", "\n", "0", "e9", "__class__", "if", "else", "j", "'", "#", "\\", "ｒ", "²"]
    ),
    max_size=25,
).map("".join)

FORMULAS = st.one_of(GRAMMAR, GRAMMAR, GRAMMAR, SOUP, st.text(max_size=30))

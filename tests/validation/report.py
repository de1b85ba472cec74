"""What many compared runs say together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from tests.validation.comparison import Finding


def open_share(findings: Sequence[Finding]) -> float:
    """Share of the draws of which some verdict stays ``not resolved``."""
    return sum(f.open > 0 for f in findings) / max(1, len(findings))


def told(findings: Sequence[Finding]) -> str:
    """Counts, contradictions, what stayed open, and true errors over stated ones."""
    lines = [f"{len(findings):,} runs compared with their Taylor integration"]
    ordinary = [f for f in findings if f.kind == "ordinary"]
    for name, group in (("ordinary", ordinary), ("adversarial", [f for f in findings if f.kind != "ordinary"])):
        asked, unresolved = sum(f.asked for f in group), sum(f.open for f in group)
        lines.append(
            f"  {name}: {len(group):,} runs, {sum(bool(f.contradictions) for f in group)} contradicted, "
            f"{sum(bool(f.refusal) for f in group)} refused ({sum(not f.legitimate for f in group)} of them wrongly), "
            f"{100 * open_share(group):.1f} % with something not resolved "
            f"({100 * unresolved / max(1, asked):.1f} % of {asked:,} verdicts), "
            f"{sum(bool(f.trouble) for f in group)} beyond the judge"
        )
    kinds = Counter(f.kind for f in findings)
    for kind in sorted(kinds, key=lambda k: (k != "ordinary", k)):
        group = [f for f in findings if f.kind == kind]
        lines.append(f"    {kind}: {kinds[kind]}, {100 * open_share(group):.1f} % with something not resolved")
    claims = Counter(key for f in findings for key, verdict in f.verdicts.items() if verdict == "not resolved")
    lines.append("  not resolved: " + ", ".join(f"{key} {count}" for key, count in claims.most_common()))
    refusals = Counter(f.refusal.partition(":")[0] for f in findings if f.refusal)
    lines.append("  refused: " + ", ".join(f"{key} {count}" for key, count in refusals.most_common()))
    for name in sorted({name for f in findings for name in f.ratios}):
        values = np.array([f.ratios[name] for f in findings if name in f.ratios])
        quantiles = ", ".join(f"{100 * x:g} % {np.quantile(values, x):.2g}" for x in (0.5, 0.9, 0.99, 0.999))
        lines.append(f"  {name}: {quantiles}, largest {values.max():.2g} ({len(values):,} runs)")
    seconds = [sum(f.seconds[k] for f in findings) for k in range(3)]
    lines.append("  processor time: " + ", ".join(
        f"{name} {value:.0f} s" for name, value in zip(("runs", "audits", "judge"), seconds, strict=True)))  # fmt: skip
    return "\n".join(lines)


def contradictions(findings: Sequence[Finding], most: int = 40) -> str:
    """The contradictions and wrong refusals in words, each with the number of its draw."""
    found = [f for f in findings if f.contradictions or not f.legitimate]
    lines = [
        f"draw {f.number} ({f.law}, {f.kind} {f.note}, tolerance {f.tolerance:.1e}): "
        + "; ".join(f.contradictions or [f.refusal])
        for f in found[:most]
    ]
    return "\n".join([*lines, f"{len(found)} in all"] if found else [])

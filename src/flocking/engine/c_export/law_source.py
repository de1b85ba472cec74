"""The source of an exported law: tables of its numbers, its memory, and the loops over neighbours and obstacles."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flocking.arrays import Array
from flocking.engine.c_export.elementary_functions import Precision, elementary_functions
from flocking.engine.c_export.entry_source import block, entry_source
from flocking.engine.c_export.exported_law import ExportedGraph, ExportedLaw
from flocking.engine.c_export.memory_source import memory_source
from flocking.engine.c_export.steering_source import steering_functions, steering_source
from flocking.engine.c_export.velocity_source import velocity_source
from flocking.engine.kernels.pieces import held
from flocking.engine.kernels.source_text import free_names, nonzero
from flocking.errors import UnsupportedLaw
from flocking.formula.c_source import CSource, NoCError
from flocking.formula.printing import statements

if TYPE_CHECKING:
    import sympy


def c_source(law: ExportedLaw, name: str, *, single: bool) -> str:
    """Text of the source file.

    Parameters
    ----------
    law, name, single
        As for `flocking.engine.c_export.header.header`.

    Raises
    ------
    UnsupportedLaw
        When a formula has no translation.
    """
    writer = _Writer(law, name, single=single)
    kind, X = "FLT" if single else "DBL", name.upper()
    head = (
        "/* Written by flocking; see README.md. Compile with -ffp-contract=off and without -ffast-math. */\n"
        f'#include "{name}.h"\n\n#include <float.h>\n\n'
        f"#define {X}_LARGEST {kind}_MAX\n#define {X}_LEAST_NORMAL {kind}_MIN\n\n"
    )
    try:
        # The memory and the tables follow from what the formulas read.
        body = writer.control()
        memory, tables = memory_source(law, name, writer.c), writer.tables()
    except NoCError as error:
        raise UnsupportedLaw(
            f"export_c cannot write {error} in C. Write the law with sqrt, exp, log, sin and cos, and with numbers of "
            "ordinary size."
        ) from None
    functions = elementary_functions(writer.c.used, f"{name}_", Precision(single))
    return head + "\n".join(x for x in (tables, functions, memory, body) if x)


class _Writer:
    """Prints the parts of the source."""

    def __init__(self, law: ExportedLaw, name: str, *, single: bool) -> None:
        self.law, self.x, self.X = law, f"{name}_", f"{name.upper()}_"
        self.real = f"{name}_real"
        self.c = CSource(single=single, prefix=self.x)
        self.phases = len(law.changes) + 1
        self.agents = 1 if (law.A[:, :, :1] == law.A).all() else law.n
        self._read: set[str] = set()
        # Laws of agents of order 1 see no velocities.
        self.moves = law.scenario.agents.order > 1

    # Tables.

    def table(self, values: Array) -> str:
        """Numbers in braces, nested as the array is."""
        if values.ndim == 0:
            return self.c.literal(float(values))
        return "{ " + ", ".join(self.table(x) for x in values) + " }"

    def tables(self) -> str:
        """Tables of the numbers that the formulas read."""
        law, found = self.law, []
        described = {slot: f"{owner} {name}" for (owner, name), slot in law.layout.slots.items()}

        def add(name: str, shape: str, values: Array, comment: str, kind: str = self.real) -> None:
            text = self.table(values)
            found.append(f"/* {comment} */\nstatic const {kind} {self.x}{name}{shape} = {text};\n")

        for slot in sorted(self._read, key=lambda s: (s[0], int(s[1:]))):
            number, comment = int(slot[1:]), described.get(slot, {"A0": "mass", "A1": "damping"}.get(slot, slot))
            if slot[0] == "P":
                add(slot, f"[{self.phases}]", law.P[:, number], comment)
            elif slot[0] == "A":
                values = law.A[:, number, : self.agents]
                add(slot, f"[{self.phases}][{self.agents}]", values, f"{comment}, of each agent")
            elif slot[0] == "W":
                add(slot, f"[{law.n}][{law.n}]", law.W[number], f"{comment}, of each pair")
            else:
                add(slot, f"[{law.rows.shape[1]}]", np.nan_to_num(law.rows[number]), f"{comment}, of each obstacle")
        return "\n".join(found)

    def _unpacked(self, names: Iterable[str], *, sender: str = "", obstacle: str = "") -> list[str]:
        """Lines that read slots."""
        agent = "agent" if self.agents > 1 else "0"
        phase = "phase" if self.phases > 1 else "0"
        places = {"P": f"[{phase}]", "A": f"[{phase}][{agent}]", "W": f"[agent][{sender}]", "O": f"[{obstacle}]"}
        slots = sorted((n for n in names if n[0] in places and n[1:].isdigit()), key=lambda s: (s[0], int(s[1:])))
        self._read |= set(slots)
        return [f"const {self.real} {n} = {self.x}{n}{places[n[0]]};" for n in slots]

    # Formulas.

    def _vector(self, name: str, array: str, used: Iterable[str]) -> list[str]:
        value = f"{array}[{{k}}]" if name != "p" or self.moves else self.c.literal(0.0)
        return [
            f"const {self.real} {name}{k} = {value.format(k=k)};"
            for k in range(self.law.m)
            if f"{name}{k}" in set(used)
        ]

    def pairs(self, number: int) -> str:
        """Loop over the neighbours in one graph."""
        law, m, x = self.law, self.law.m, self.x
        pair = law.formulas.pairs[number]
        chosen, split = held(nonzero({"along": pair.along, "drag": pair.drag}), "r")
        if not chosen:
            return ""
        graph = law.graphs[number]
        names = free_names(chosen.values())
        offset = "along" in chosen or "radial" in names.others
        body = [f"const {self.real} d{k} = seen->offset[slot][{k}];" for k in range(m)] if offset else []
        if "drag" in chosen or names.others & {"speed2", "radial"}:
            moving = "memory->known[slot].p[{k}] - p[{k}]" if self.moves else self.c.literal(0.0)
            body += [f"const {self.real} v{k} = {moving.format(k=k)};" for k in range(m)]
        needs_r = "along" in chosen or split or names.others & {"r", "radial"}
        if needs_r:
            body += [f"const {self.real} r = seen->distance[slot];"]
        if split:
            body += [f"const {self.real} {name} = r;" for name in ("side", "reach") if name in names.others]
        zero = self.c.literal(0.0)
        if "speed2" in names.others:
            body += [f"const {self.real} speed2 = " + " + ".join(f"(v{k} * v{k})" for k in range(m)) + ";"]
        if "radial" in names.others:
            projected = " + ".join(f"(d{k} * v{k})" for k in range(m))
            body += [f"const {self.real} radial = (r > {zero}) ? (({projected}) / r) : {zero};"]
        slots = [*names.scalars, *names.per_agent, *names.per_pair]
        body += self._unpacked(slots, sender="memory->known[slot].sender")
        body += self.c.statements(statements(chosen, arrays=False, prefix=f"g{number}_"))
        if "along" in chosen:
            body += [f"const {self.real} scale = (r > {zero}) ? (along / r) : (along * {zero});"]
        for k in range(m):
            parts = [f"(scale * d{k})"] * ("along" in chosen) + [f"(drag * v{k})"] * ("drag" in chosen)
            body += [f"sum[{k}] = sum[{k}] + ({' + '.join(parts)});"]
        head = ["for (k = 0u; k < memory->count; k++)", "{"]
        inside = ["const uint16_t slot = memory->order[k];", f"if ({x}bit(seen->next[{number}], slot) != 0u)", "{"]
        checks = self._pole(graph, zero)
        text = block(head, 1) + block(inside, 2) + block([*body, *checks], 3) + block(["}"], 2) + block(["}"], 1)
        if "functional" in names.others:
            text = self._average(number) + text
        return text

    def _average(self, number: int) -> str:
        one = self.c.literal(1.0)
        lines = [f"functional = {self.c.literal(0.0)};", "for (k = 0u; k < memory->count; k++)", "{"]
        lines += [f"    if ({self.x}bit(seen->next[{number}], memory->order[k]) != 0u)", "    {"]
        lines += [f"        functional = functional + {one};", "    }", "}"]
        return block([*lines, f"functional = {one} / ({one} + functional);"], 1)

    def _pole(self, graph: ExportedGraph, zero: str) -> list[str]:
        """Lines that note a neighbour where the law may have no force."""
        found, (least, most) = [], graph.poles
        wrong = [f"(seen->distance[slot] <= {self.c.literal(least)})"] if least > 0.0 else []
        wrong += [f"(seen->distance[slot] >= {self.c.literal(most)})"] if np.isfinite(most) else []
        if wrong:
            found = [f"if ({' || '.join(wrong)})", "{", f"    pole = {self.X}POLE;", "}"]
        return [*found, f"if (!(seen->distance[slot] > {zero}))", "{", f"    meets = {self.X}COINCIDENT;", "}"]

    def obstacles(self, number: int) -> str:
        """Loop over one group of obstacles."""
        law, m = self.law, self.law.m
        formulas, (most, count) = law.formulas.obstacles[number], law.ranges[number]
        stages = [dict(stage) for stage in formulas.stages()]
        stages[-1] = {name: value for name, value in stages[-1].items() if name.startswith("force")}
        stages = _needed(stages)
        used = {str(s) for stage in stages for e in stage.values() for s in e.free_symbols}
        body = self._vector("q", "q", used) + self._vector("p", "p", used)
        body += self._unpacked(used, obstacle="o")
        text, depth = block(["for (o = 0u; o < " + str(count) + "u; o++)", "{"], 1) + block(body, 2), 2
        for k, stage in enumerate(stages):
            chosen, split = held(stage, "distance")
            lines = [f"const {self.real} {n} = distance;" for n in ("side", "reach") if split and _reads(chosen, n)]
            lines = [line for line in lines if line not in text]
            text += block(
                [*lines, *self.c.statements(statements(chosen, arrays=False, prefix=f"o{number}_{k}_"))], depth
            )
            if "distance" in stage:
                text += block([f"if (distance <= {self.c.literal(most)})", "{"], depth)
                depth += 1
        text += block([f"sum[{k}] = sum[{k}] + force{k};" for k in range(m) if f"force{k}" in stages[-1]], depth)
        return text + block(["}"], 2) + block(["}"], 1)

    def alone(self) -> str:
        """The force of the agent's own terms."""
        law = self.law
        chosen = nonzero({f"force{k}": f for k, f in enumerate(law.formulas.body.force)})
        if not chosen:
            return ""
        names = free_names(chosen.values())
        body = self._vector("q", "q", names.others) + self._vector("p", "p", names.others)
        body += self._unpacked([*names.scalars, *names.per_agent])
        body += self.c.statements(statements(chosen, arrays=False, prefix="b_"))
        body += [f"sum[{k}] = sum[{k}] + force{k};" for k in range(law.m) if f"force{k}" in chosen]
        return block(["{"], 1) + block(body, 2) + block(["}"], 1)

    # The function.

    def control(self) -> str:
        """Source of the force of the law."""
        law, x, X, m, real = self.law, self.x, self.X, self.law.m, self.real
        parts = [self.pairs(k) for k in range(len(law.graphs))]
        parts += [self.obstacles(k) for k in range(len(law.formulas.obstacles))]
        parts.append(self.alone())
        steering = steering_source(law.scenario.law.steering_terms, self.c, m)
        code = "".join([*parts, steering])
        zero = self.c.literal(0.0)
        reads = _words(code)
        declared = ["const uint16_t agent = memory->agent;"] if "agent" in reads else []
        if "t" in reads:
            start = self.c.literal(law.scenario.start.t)
            declared += [f"const {real} t = {start} + {x}seconds(now);"]
        declared += ["uint32_t phase = 0u;"] if self.phases > 1 else []
        declared += [f"{real} functional;"] if "functional" in reads else []
        declared += ["uint32_t o;"] if "o" in reads else []
        declared += ["uint32_t k;"] if "k" in reads else []
        declared += [f"int32_t {name} = {X}OK;" for name in ("pole", "meets") if name in reads]
        steps = [f"phase = (now >= INT64_C({t})) ? {k + 1}u : phase;" for k, t in enumerate(law.changes)]
        self.c.used.add("sqrt")
        # Lengths of space do not change.
        lengths = sorted(str(period) for period in law.formulas.periods if period is not None)
        self._read |= set(lengths)
        finish = self._finish("pole" in reads, "meets" in reads)
        signature = (
            f"static int32_t {x}force(const {x}memory *memory, int64_t now, const {real} q[{X}DIMENSION],\n"
            f"    const {real} p[{X}DIMENSION], const {x}view *seen, {real} u[{X}DIMENSION])\n"
        )
        known = reads | _words("".join([*declared, *steps]))
        unused = [name for name in ("memory", "now", "q", "p", "seen") if name not in known]
        lines = [*declared, f"{real} sum[{X}DIMENSION] = {{ {', '.join([zero] * m)} }};"]
        lines += [f"(void){name};" for name in unused]
        acting = entry_source(law, self.x[:-1], self.c, lengths) + velocity_source(law, self.c)
        return steering_functions(steering + acting, self.c) + (
            f"/* Neighbours as they are seen now, by slot, and a bit for each that is linked, of every graph. */\n"
            f"typedef struct\n{{\n    {real} offset[{X}NEIGHBOURS][{X}DIMENSION];\n"
            f"    {real} distance[{X}NEIGHBOURS];\n"
            f"    uint32_t next[{X}GRAPHS][{X}WORDS];\n}} {x}view;\n\n"
            f"/* The sum over neighbours, obstacles and the agent's own terms. */\n{signature}{{\n"
            f"{block([*lines, *steps], 1)}{code}{block(finish, 1)}}}\n\n" + acting
        )

    def _finish(self, pole: bool, meets: bool) -> list[str]:
        """Lines that give the force, or state why there is none."""
        m, x, X = self.law.m, self.x, self.X
        finite = " && ".join(f"({x}finite(sum[{k}]) != 0u)" for k in range(m))
        why = f"{X}NO_FORCE"
        for name in ("pole",) * pole + ("meets",) * meets:
            why = f"(({name} != {X}OK) ? {name} : {why})"
        lines = [f"u[{k}] = sum[{k}];" for k in range(m)]
        lines += [f"if (!({finite}))", "{", f"    return {why};", "}"]
        return [*lines, f"return {'pole' if pole else f'{X}OK'};"]


def _words(text: str) -> set[str]:
    """Names in a text of C, but those of members of structures."""
    return set(re.findall(r"(?<![.>\w])[A-Za-z_]\w*", text))


def _reads(formulas: dict[str, sympy.Expr], name: str) -> bool:
    return any(str(s) == name for e in formulas.values() for s in e.free_symbols)


def _needed(stages: Sequence[dict[str, sympy.Expr]]) -> list[dict[str, sympy.Expr]]:
    """Stages without what no later formula reads; the distance stays."""
    requested, found = {"distance"}, []
    for place, stage in reversed(list(enumerate(stages))):
        last = place + 1 == len(stages)
        needed = {name: e for name, e in stage.items() if (last and e != 0) or name in requested}
        requested |= {str(s) for e in needed.values() for s in e.free_symbols}
        found.append(needed)
    return found[::-1]

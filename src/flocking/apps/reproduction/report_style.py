"""Style sheet, font and script of reports: for light and dark screens, phones, keyboards and paper, offline."""

from __future__ import annotations

import base64
from functools import lru_cache
from importlib.resources import files

STYLE = """
:root { color-scheme: light dark; --ink: #1c1e21; --paper: #ffffff; --panel: #f3f4f6; --line: #d9dce1;
  --dim: #555d68;
  --good: #00664a; --bad: #a63a00; --open: #005a94; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --paper: #15181c; --panel: #1e2227; --line: #343a42;
  --dim: #a9b2bd; --good: #4fd1a5; --bad: #ff9d66; --open: #6cc0ff; } }
* { box-sizing: border-box; }
html { scroll-padding-top: 1rem; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 78rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
.skip { position: absolute; left: -100rem; } .skip:focus { left: 1rem; top: .5rem; background: var(--paper);
  padding: .4rem .7rem; z-index: 2; }
:focus-visible { outline: 3px solid var(--open); outline-offset: 2px; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.4rem; margin: 3rem 0 .3rem; padding-top: 1rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.1rem; margin: 1.8rem 0 .5rem; } h4 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
p { margin: .3rem 0 .8rem; max-width: 50rem; }
.dim { color: var(--dim); }
.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .8rem; margin: 1.2rem 0; }
.numbers div {
  background: var(--panel); border-radius: .5rem; padding: .7rem .9rem; }
.numbers b { display: block; font-size: 1.6rem; line-height: 1.2; font-variant-numeric: tabular-nums; }
a { color: var(--open); }
nav ul { columns: 22rem; padding-left: 1.2rem; } nav li { break-inside: avoid; margin: .1rem 0; }
nav li ul { columns: auto; }
.scroll, .formula { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th { text-align: left; font-weight: 600; color: var(--dim); }
thead th { border-bottom: 1px solid var(--line); padding: .35rem .6rem .35rem 0; }
td, tbody th { vertical-align: top; border-bottom: 1px solid var(--line); padding: .45rem .6rem .45rem 0; }
table.values td, table.values th { padding: .2rem .8rem .2rem 0; } table.values { width: auto; }
td.count { white-space: nowrap; font-variant-numeric: tabular-nums; }
.verdict { white-space: nowrap; font-weight: 600; }
.holds { color: var(--good); } .fails, .wrong { color: var(--bad); } .other { color: var(--open); }
.groups { display: grid; gap: 1.6rem; }
.beside { display: grid; grid-template-columns: minmax(0, 30rem) minmax(0, 1fr); gap: 1.4rem; align-items: start; }
.claim { border-left: .25rem solid var(--line); padding: .1rem 0 .1rem .8rem; margin: 0 0 .8rem; }
.claim p { margin: 0; max-width: none; } .claim .small { font-size: .88rem; color: var(--dim); }
.claim.holds { color: inherit; border-color: var(--good); }
.claim.fails { color: inherit; border-color: var(--bad); border-left-style: double; border-left-width: .4rem; }
.claim.other { color: inherit; border-color: var(--open); border-left-style: dashed; }
.claim.unexpected { border: 2px solid var(--bad); border-left-width: .4rem; border-radius: .2rem;
  padding: .3rem .8rem; }
ul { padding-left: 1.2rem; } li { margin: .15rem 0; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(26rem, 100%), 1fr)); gap: 1rem;
  align-items: start; }
figure { margin: 0; border: 1px solid var(--line); border-radius: .5rem; overflow: hidden; }
figure img, figure video { display: block; width: 100%; height: auto; background: #ffffff; }
figcaption { padding: .5rem .7rem; font-size: .9rem; color: var(--dim); }
button.enlarge { display: block; width: 100%; padding: 0; border: 0; background: none; cursor: zoom-in; }
dialog { width: min(96vw, 100rem); max-width: none; max-height: 96vh; border: 1px solid var(--line);
  border-radius: .5rem; background: var(--paper); color: var(--ink); padding: 1rem; }
dialog::backdrop { background: rgb(0 0 0 / 60%); }
dialog img { display: block; width: 100%; max-height: 80vh; object-fit: contain; background: #ffffff; }
dialog button { float: right; font: inherit; padding: .2rem .8rem; }
.formula { padding: .3rem 0; } .formula math { margin: .4rem 0; text-align: left; }
math { font-family: "Report Mathematics", "STIX Two Math", "Cambria Math", math; font-size: 1.06em; }
mtable.aligned mtd, mtable.cases mtd { padding: .25em .35em; }
details { margin: .6rem 0; } summary { cursor: pointer; } details.more > summary { color: var(--open); }
details.folds { border-bottom: 1px solid var(--line); padding-bottom: .4rem; }
details.folds > summary h3, details.folds > summary h2 { display: inline; border: 0; margin: 0; padding: 0; }
details.folds > summary { margin: 1.2rem 0 .5rem; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; font-size: .92rem; }
dt { color: var(--dim); } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 48rem) {
  .beside { grid-template-columns: minmax(0, 1fr); gap: .6rem; }
  table.claims thead { position: absolute; left: -100rem; }
  table.claims tr { display: block; padding: .5rem 0; border-bottom: 1px solid var(--line); }
  table.claims td { display: block; border: 0; padding: .05rem 0; }
  table.claims td.count { display: inline-block; margin-right: 1rem; }
  table.claims td[data-name]::before { content: attr(data-name) ": "; color: var(--dim); }
  table.claims td:empty { display: none; }
  dl { grid-template-columns: minmax(0, 1fr); } dd { margin: 0 0 .4rem; }
}
@page { margin: 16mm 14mm; }
@media print { :root { color-scheme: light; --ink: #000000; --paper: #ffffff; --line: #bbbbbb; --dim: #444444;
  --good: #00664a; --bad: #a63a00; --open: #005a94; }
  h2 { break-before: page; } h3 { break-after: avoid; } figure, tr, .claim { break-inside: avoid; }
  a { color: inherit; text-decoration: none; } body { font-size: 10pt; }
  .groups { display: block; }
  .beside { grid-template-columns: 2.6in minmax(0, 1fr); margin: 0 0 1rem; break-inside: avoid; }
  .figures { grid-template-columns: repeat(3, 1fr); }
  figure:has(video) { display: none; }
  .numbers div { border: 1px solid var(--line); } table { font-size: 8.5pt; } main { max-width: none; padding: 0; } }
"""

SCRIPT = """
(() => {
  const all = (what) => document.querySelectorAll(what);
  const box = document.getElementById('enlarged');
  const image = box.querySelector('img'), words = box.querySelector('p');
  for (const button of all('button.enlarge')) button.addEventListener('click', () => {
    const shown = button.querySelector('img');
    image.src = shown.src; image.alt = shown.alt; words.textContent = shown.alt; box.showModal();
  });
  box.querySelector('button').addEventListener('click', () => box.close());
  box.addEventListener('click', (event) => { if (event.target === box) box.close(); });
  if (matchMedia('(max-width: 48rem)').matches) for (const part of all('details.folds')) part.open = false;
  const unfold = () => {
    const place = document.getElementById(decodeURIComponent(location.hash.slice(1)));
    for (let part = place; part; part = part.parentElement) if (part.tagName === 'DETAILS') part.open = true;
    if (place) place.scrollIntoView();
  };
  addEventListener('hashchange', unfold);
  addEventListener('beforeprint', () => { for (const part of all('details')) part.open = true; });
  if (location.hash) unfold();
})();
"""
"""Pictures enlarge, sections fold on a phone, links unfold what they lead to. The page is whole without it."""


@lru_cache(maxsize=1)
def font_face() -> str:
    """The font of formulas as a rule of the style sheet: without one brackets and roots would not grow everywhere."""
    data = (files("flocking.formula.markup.font") / "stix-two-math-subset.woff").read_bytes()
    source = f"data:font/woff;base64,{base64.b64encode(data).decode()}"
    return f'@font-face {{ font-family: "Report Mathematics"; src: url("{source}") format("woff"); }}\n'

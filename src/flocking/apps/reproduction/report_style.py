"""Style sheet of the report: for light and dark screens, phones and paper; nothing is fetched."""

STYLE = """
:root { color-scheme: light dark; --ink: #1c1e21; --paper: #ffffff; --panel: #f3f4f6; --line: #d9dce1;
  --dim: #5c6470;
  --good: #00664a; --bad: #a63a00; --open: #005a94; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --paper: #15181c; --panel: #1e2227; --line: #343a42;
  --dim: #a2abb6; --good: #4fd1a5; --bad: #ff9d66; --open: #6cc0ff; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 72rem; margin: 0 auto; padding: 1.5rem 1rem 4rem; }
h1 { font-size: 1.9rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.35rem; margin: 3rem 0 .3rem; padding-top: 1rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.8rem 0 .5rem; }
p { margin: .3rem 0 .8rem; max-width: 46rem; }
.dim { color: var(--dim); }
.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(9rem, 1fr)); gap: .8rem; margin: 1.2rem 0; }
.numbers div {
  background: var(--panel); border-radius: .5rem; padding: .7rem .9rem; }
.numbers b { display: block; font-size: 1.6rem; line-height: 1.2; font-variant-numeric: tabular-nums; }
a { color: var(--open); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
th { text-align: left; font-weight: 600; color: var(--dim); }
th { border-bottom: 1px solid var(--line); padding: .35rem .6rem .35rem 0; }
td { vertical-align: top; border-bottom: 1px solid var(--line); padding: .45rem .6rem .45rem 0; }
td.count { white-space: nowrap; font-variant-numeric: tabular-nums; }
.verdict { white-space: nowrap; font-weight: 600; }
.holds { color: var(--good); } .fails, .wrong { color: var(--bad); } .other { color: var(--open); }
.groups { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(30rem, 100%), 1fr)); gap: 1.4rem; }
.beside { display: grid; grid-template-columns: minmax(0, 15rem) minmax(0, 1fr); gap: 1rem; align-items: start; }
.claim { border-left: .25rem solid var(--line); padding: .1rem 0 .1rem .8rem; margin: 0 0 .8rem; }
.claim p { margin: 0; max-width: none; } .claim .small { font-size: .85rem; color: var(--dim); }
.claim.holds { color: inherit; border-color: var(--good); } .claim.fails { color: inherit; border-color: var(--bad); }
.claim.other { color: inherit; border-color: var(--open); }
.claim.unexpected { border: 2px solid var(--bad); border-left-width: .25rem; border-radius: .2rem;
  padding: .3rem .8rem; }
ul { padding-left: 1.2rem; } li { margin: .15rem 0; }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(18rem, 1fr)); gap: 1rem; }
figure { margin: 0; border: 1px solid var(--line); border-radius: .5rem; overflow: hidden; }
figure img, figure video { display: block; width: 100%; height: auto; background: #ffffff; }
figcaption { padding: .5rem .7rem; font-size: .88rem; color: var(--dim); }
.formula { overflow-x: auto; padding: .4rem 0; } .formula svg { display: block; margin: .6rem 0; }
details { margin: .6rem 0; } summary { cursor: pointer; color: var(--open); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1rem; font-size: .92rem; }
dt { color: var(--dim); } dd { margin: 0; overflow-wrap: anywhere; }
@media (max-width: 40rem) {
  .beside { grid-template-columns: minmax(0, 1fr); gap: .6rem; }
  table.claims thead { display: none; }
  table.claims tr { display: block; padding: .5rem 0; border-bottom: 1px solid var(--line); }
  table.claims td { display: block; border: 0; padding: .05rem 0; }
  table.claims td.count { display: inline-block; margin-right: 1rem; }
  table.claims td[data-name]::before { content: attr(data-name) ": "; color: var(--dim); }
}
@page { margin: 16mm 14mm; }
@media print { :root { color-scheme: light; --ink: #000000; --paper: #ffffff; --line: #bbbbbb; --dim: #444444;
  --good: #00664a; --bad: #a63a00; --open: #005a94; }
  h2 { break-before: page; } h3 { break-after: avoid; } figure, tr, .claim { break-inside: avoid; }
  details summary { display: none; } a { color: inherit; text-decoration: none; } body { font-size: 10pt; }
  .groups { display: block; }
  .beside { grid-template-columns: 2.4in minmax(0, 1fr); margin: 0 0 1rem; break-inside: avoid; }
  .figures { grid-template-columns: repeat(3, 1fr); }
  figure:has(video) { display: none; }
  .numbers div { border: 1px solid var(--line); } table { font-size: 8.5pt; } main { max-width: none; padding: 0; } }
"""

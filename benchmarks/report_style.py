"""The look of the report of ``bench``."""

STYLE = """
:root { --ink: #20262e; --faint: #68727f; --line: #e1e5ea; --paper: #fbfaf8; --warm: #d6361f;
  --good: #1d7a55; --bad: #b3261e; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
  font: 17px/1.6 Charter, "Bitstream Charter", "Sitka Text", Cambria, Georgia, serif; }
main { max-width: 1240px; margin: 0 auto; padding: 64px 32px 96px; }
h1 { font-size: 42px; line-height: 1.15; margin: 0 0 12px; letter-spacing: -0.01em; }
h2 { font-size: 27px; line-height: 1.25; margin: 0 0 6px; }
h3 { font-size: 18px; margin: 28px 0 0; }
.lead { color: var(--faint); font-size: 19px; max-width: 46em; margin: 0 0 20px; }
.question { color: var(--faint); max-width: 52em; margin: 0 0 12px; }
.place, .machine, .small, th, td, footer, summary { font-family: "Inter", "Helvetica Neue",
  "Segoe UI", Roboto, "DejaVu Sans", Arial, sans-serif; }
.place, .machine, .small { color: var(--faint); font-size: 13px; margin: 0 0 6px; }
.small { margin-top: 14px; }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 34px 38px 24px; margin: 32px 0; }
figure { margin: 18px 0 8px; }
figure img { display: block; width: 100%; height: auto; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 14px; margin: 14px 0 6px;
  font-variant-numeric: tabular-nums; }
th { font-weight: 600; color: var(--faint); font-size: 12.5px; }
th, td { padding: 6px 12px; border-bottom: 1px solid var(--line); text-align: right; }
td { white-space: nowrap; }
.word { text-align: left; white-space: normal; }
th:first-child, td:first-child { text-align: left; padding-left: 0; white-space: normal; }
thead th { border-bottom: 1.5px solid var(--ink); }
tbody tr:last-child td { border-bottom: 0; }
.bar { display: inline-block; width: 180px; height: 9px; background: #f0f1f3; border-radius: 5px;
  overflow: hidden; vertical-align: middle; }
.bar i { display: block; height: 100%; background: var(--warm); opacity: 0.85; }
.good { color: var(--good); font-weight: 600; } .bad { color: var(--bad); font-weight: 600; }
a { color: inherit; text-decoration-color: #b9c0c9; text-underline-offset: 3px; }
summary { cursor: pointer; color: var(--faint); font-size: 14px; margin-top: 18px; }
footer { color: var(--faint); font-size: 13px; margin-top: 40px; }
code { font: 0.92em ui-monospace, "SF Mono", Menlo, "DejaVu Sans Mono", monospace; }
@media (max-width: 760px) { main { padding: 32px 14px; } section { padding: 22px 16px; } }
@media print { section { break-inside: avoid; border: 0; padding: 0; } body { background: #fff; } }
"""
"""A sheet as wide as its plots, words in serifs, numbers in tabular figures."""

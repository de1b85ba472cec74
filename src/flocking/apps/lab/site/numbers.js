// Numbers and times in few digits.

// A time of a run with four digits, and with more where the run begins late: see time_text in safe_digits.py.
export function timeText(t, first, last) {
  if (!Number.isFinite(t)) return "–";
  const latest = Math.max(Math.abs(first), Math.abs(last)), span = last - first;
  const later = span > 0 && span < latest ? Math.ceil(Math.log10(latest / span)) : 0;
  return String(Number(t.toPrecision(Math.min(4 + later, 17))));
}

export function short(x) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  return size >= 1e5 || size < 1e-3 ? x.toExponential(2) : String(Number(x.toPrecision(4)));
}

// Send what is typed into a field where it is a number; else show again the one that holds, which the returned
// function is told: browsers empty a field of what is none.
export function whenNumber(field, send) {
  let holds = field.value;
  field.onchange = () => {
    if (field.value !== "" && Number.isFinite(Number(field.value))) send(Number(field.value));
    else field.value = holds;
  };
  return (value = holds) => {
    field.value = holds = value;
  };
}

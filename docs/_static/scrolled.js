// What scrolls sideways is reached by the keyboard: code, tables and formulas that are wider than their place.
"use strict";
const SCROLLED = "pre, .table-wrapper, div.math, math[display='block'], .highlight";

function reach() {
  for (const part of document.querySelectorAll(SCROLLED)) {
    const scrolls = part.scrollWidth > part.clientWidth || part.scrollHeight > part.clientHeight;
    if (scrolls) part.setAttribute("tabindex", "0");
    else part.removeAttribute("tabindex");
  }
}

addEventListener("DOMContentLoaded", reach);
addEventListener("load", reach);
addEventListener("resize", reach);

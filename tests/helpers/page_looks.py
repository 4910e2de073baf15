"""The looks of a page: words that stick out of the window, are cut off, too small or too pale."""

from __future__ import annotations

import json
from typing import Any

SMALLEST_PX = 9.0  # of a letter's height, of words that a picture scales as well
PALEST = 4.5  # contrast of words and what is behind them, as WCAG asks; of large ones 3
# Words that are seen: what lies outside the window, is cut off, small or pale. Colours as the browser paints them.
COMPLAINTS = """([smallest, palest]) => {
  const numbers = (colour) => (colour.match(/[\\d.]+/g) || []).map(Number);
  const light = (colour) => numbers(colour).slice(0, 3).map((c) => c / 255)
    .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
    .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
  const over = (front, back) => {
    const [r, g, b, a = 1] = numbers(front), under = numbers(back);
    return `rgb(${[r, g, b].map((c, k) => a * c + (1 - a) * under[k]).join(",")})`;
  };
  const ground = (node) => {
    const layers = [];
    for (let at = node; at; at = at.parentElement) {
      const colour = getComputedStyle(at).backgroundColor;
      if (numbers(colour)[3] !== 0) layers.push(colour);
      if (numbers(colour).length === 3) break;
    }
    return layers.reverse().reduce((back, front) => over(front, back), "rgb(255,255,255)");
  };
  const scrolls = (node) => {
    for (let at = node.parentElement; at; at = at.parentElement) {
      if (["auto", "scroll"].includes(getComputedStyle(at).overflowX)) return true;
    }
    return false;
  };
  const found = [], wide = document.documentElement.clientWidth;
  for (const node of document.querySelectorAll("body *")) {
    const own = [...node.childNodes].filter((one) => one.nodeType === 3).map((one) => one.textContent.trim()).join("");
    const control = node.matches("button, input, select, .button, progress, svg, figure");
    if (!own && !control) continue;
    const box = node.getBoundingClientRect(), style = getComputedStyle(node);
    const hidden = box.width <= 1 || box.height <= 1 || style.visibility === "hidden" || style.opacity === "0";
    const aside = ".skip, [hidden], option, noscript, #js-plotly-tester, script, style, title, desc";
    if (hidden || node.closest(aside)) continue;
    const words = `${node.tagName} ${(own || node.getAttribute("class") || node.id).slice(0, 40)}`;
    const drawn = node.ownerSVGElement;
    if (!scrolls(node) && (box.right > wide + 1 || box.left < -1)) found.push(`out of the window: ${words}`);
    if (!own) continue;
    let outer = drawn;
    while (outer?.ownerSVGElement) outer = outer.ownerSVGElement;
    const picture = outer?.getBoundingClientRect();
    if (picture && (box.left < picture.left - 2 || box.right > picture.right + 2)) found.push(`cut: ${words}`);
    if (!drawn && node.scrollWidth > node.clientWidth + 1 && style.overflowX === "hidden") found.push(`cut: ${words}`);
    const matrix = drawn ? node.getScreenCTM() : { c: 0, d: 1 };
    const size = parseFloat(style.fontSize) * Math.hypot(matrix.c, matrix.d);
    if (size < smallest) found.push(`${size.toFixed(1)} px: ${words}`);
    if (node.matches(":disabled")) continue;
    const back = ground(drawn ? drawn.parentElement : node), ink = over(drawn ? style.fill : style.color, back);
    const [low, high] = [light(ink), light(back)].sort((a, b) => a - b), contrast = (high + 0.05) / (low + 0.05);
    const large = size >= 24 || (size >= 18.6 && style.fontWeight >= 600) || drawn;  // a picture's key is its lines'
    if (contrast < (large ? 3 : palest) - 0.05) found.push(`contrast ${contrast.toFixed(1)}: ${words}`);
  }
  if (document.documentElement.scrollWidth > wide) found.push("the page scrolls sideways");
  return [...new Set(found)];
}"""


def complaints(page: Any, smallest_px: float = SMALLEST_PX) -> list[str]:
    """The complaints of a reader of the page as it stands, a line each; none of a good page."""
    return list(page.evaluate(COMPLAINTS, [smallest_px, PALEST]))


def ground_of(page: Any) -> str:
    """The page's own background."""
    return str(page.evaluate("getComputedStyle(document.body).backgroundColor"))


def rgb(colour: str) -> str:
    """A colour such as #14181d as the browser writes it."""
    return f"rgb({', '.join(str(int(colour[k : k + 2], 16)) for k in (1, 3, 5))})"


def answers(canned: dict[str, Any]) -> str:
    """A worker's program that has an answer ready for each kind of question."""
    ready = json.dumps(json.dumps(canned))
    return (
        f"import json, sys\nready = json.loads({ready})\n"
        "for line in sys.stdin:\n    print(json.dumps(ready[json.loads(line)['what']]), flush=True)\n"
    )

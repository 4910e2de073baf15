// Draws the page's figures, in the colours of the reader's system, and again on paper.
"use strict";
(() => {
  const darkOf = JSON.parse(document.getElementById("dark-colours").textContent);
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  const coarse = matchMedia("(pointer: coarse)").matches;
  const plots = [...document.querySelectorAll("[data-figure]")];
  const sources = new Map(plots.map((plot) => [plot, JSON.parse(document.getElementById(`figure-${plot.dataset.figure}`).textContent)]));
  const config = { responsive: true, displaylogo: false, showSendToCloud: false, plotlyServerURL: "", modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  const PAPER_WIDTH_PX = 660;

  // A copy of a figure with each light colour replaced by its dark one.
  function coloured(node, dark) {
    if (typeof node === "string") return (dark && darkOf[node]) || node;
    if (Array.isArray(node)) return node.map((item) => coloured(item, dark));
    if (node === null || typeof node !== "object") return node;
    return Object.fromEntries(Object.entries(node).map(([key, value]) => [key, key === "bdata" ? value : coloured(value, dark)]));
  }

  function say(plot, words) {
    plot.classList.add("words");
    plot.removeAttribute("role");
    plot.replaceChildren(Object.assign(document.createElement("p"), { textContent: words }));
    plot.dataset.drawn = "words";
  }

  // On a narrow page the legend stands below the axes, clear of the buttons above them.
  function narrow(plot, data, layout) {
    const names = data.filter((trace) => trace.showlegend !== false).map((trace) => trace.name);
    const width_px = names.reduce((sum, name) => sum + 52 + 7 * name.length, 0);
    const legend_px = 22 * Math.ceil((1.15 * width_px) / (plot.clientWidth - 60));
    const axes_px = layout.height - layout.margin.t - layout.margin.b;
    // "90°" stands right of a wind's circle
    Object.assign(layout.margin, { l: layout.polar ? 36 : 54, r: layout.polar ? 36 : 6, t: 34, b: 46 + legend_px });
    Object.assign(layout.legend, { y: -46 / axes_px, yanchor: "top" });
    layout.height = axes_px + layout.margin.t + layout.margin.b;
  }

  // Plotly's script is packed, a third of its size; the policy names it by its digest and lets it run unpacked.
  async function unpacked() {
    const packed = Uint8Array.from(atob(document.getElementById("plotly").textContent), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    const text = await new Response(stream).text();
    document.head.append(Object.assign(document.createElement("script"), { textContent: text }));
    if (!window.Plotly) throw new Error("Plotly's script did not run");
  }
  const ready = unpacked();
  ready.catch(() => {}); // each figure says so in its place

  async function draw(plot, dark, width) {
    await ready;
    if (plot.dataset.drawn === "words") return;
    const { data, layout } = coloured(sources.get(plot), dark);
    if (width) Object.assign(layout, { width, autosize: false });
    else if (plot.clientWidth < 480) narrow(plot, data, layout);
    if (coarse) layout.dragmode = false; // a finger scrolls the page
    if (plot.dataset.drawn) await Plotly.react(plot, data, layout, config);
    else {
      plot.replaceChildren();
      await Plotly.newPlot(plot, data, layout, config);
    }
    plot.dataset.drawn = "figure";
  }

  async function drawAll() {
    delete document.documentElement.dataset.figures;
    for (const plot of plots) {
      try {
        await draw(plot, prefersDark.matches);
      } catch (error) {
        console.error(error);
        say(plot, `This figure could not be drawn: ${error.message}`);
      }
      await new Promise((resume) => setTimeout(resume)); // the page stays alive between figures
    }
    document.documentElement.dataset.figures = "drawn";
  }

  prefersDark.addEventListener("change", drawAll);
  let closed = [];
  addEventListener("beforeprint", () => {
    closed = [...document.querySelectorAll("details:not([open])")];
    for (const part of closed) part.open = true;
    for (const plot of plots) draw(plot, false, PAPER_WIDTH_PX);
  });
  addEventListener("afterprint", () => {
    for (const part of closed) part.open = false;
    drawAll();
  });
  drawAll();
})();

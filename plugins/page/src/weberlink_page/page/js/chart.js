// The chart of a panel: uPlot with bands, zones and marks. Draws the rows of the store between two times.

import uPlot from "../vendor/uplot.js";
import { element, press } from "./dom.js";
import { amount } from "./format.js";
import { merge } from "./ring.js";
import { theme } from "./theme.js";

const LEGEND_EVERY_MS = 250;
const LEGEND_CLASSES = { quiet: "all", bad: "missed" };

// The panel around a chart: title with unit, choices, legend, help.
export function frame({ name, title, unit = "", help, choices = [], ofAxes = false }, parent, choose = null) {
  const heading = element("h2", { id: `title-${name}` }, title, " ", element("span", { className: "unit" }, unit));
  const head = element("header", {}, heading);
  const buttons = choices.map((choice) => element("button", { type: "button" }, choice));
  for (const [k, button] of buttons.entries())
    button.addEventListener("click", () => {
      press(button, buttons);
      choose(choices[k]);
    });
  if (buttons.length)
    head.append(element("span", { className: "choice", role: "group", "aria-label": `${title}: component` }, ...buttons));
  const axes = ofAxes ? element("select", { className: "axes", "aria-label": `${title}: axis` }) : null;
  axes?.addEventListener("change", () => choose(axes.selectedIndex));
  const legend = element("ul", { className: "legend" });
  const tip = element("p", { id: `help-${name}`, popover: "auto", className: "tip" }, help);
  const button = element("button", { type: "button", className: "help", "aria-label": `About ${title}`, popoverTargetElement: tip }, "?");
  head.append(...(axes ? [axes] : []), legend, button, tip);
  const note = element("p", { className: "empty" });
  const body = element("div", { className: "chart", id: `chart-${name}` }, note);
  parent.append(element("section", { className: "panel", id: `panel-${name}`, "aria-labelledby": heading.id }, head, body));
  return { body, legend, note, axes, buttons };
}

// Draws a vertical line with the new setting for each live change.
export function marks(u, changes) {
  const { ctx, bbox } = u;
  for (const { t, label } of changes) {
    if (t < u.scales.x.min || t > u.scales.x.max) continue;
    const x = Math.round(u.valToPos(t, "x", true));
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = theme.text;
    rule(ctx, [x, bbox.top], [x, bbox.top + bbox.height], [3 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    const left = x + ctx.measureText(label).width + 8 * devicePixelRatio > bbox.left + bbox.width;
    ctx.textAlign = left ? "right" : "left";
    ctx.textBaseline = "top";
    ctx.fillText(label, x + (left ? -4 : 4) * devicePixelRatio, bbox.top + 2 * devicePixelRatio);
    ctx.restore();
  }
}

// What all plots share: the time line, and a cursor at the same time in each.
export function options(body, least, span) {
  const axis = { stroke: () => theme.quiet, font: theme.font, ticks: { show: false } };
  return {
    width: Math.max(120, body.clientWidth),
    height: Math.max(least, body.clientHeight),
    legend: { show: false },
    cursor: { sync: { key: "time", scales: ["x", null] }, y: false, drag: { x: false, y: false }, points: { show: false } },
    x: { time: false, range: span },
    axis,
    time: { ...axis, size: 22, gap: 5, space: 60, values: (u, splits) => splits.map((v) => `${+v.toFixed(2)} s`) },
  };
}

export class Chart {
  constructor(panel, store, parent) {
    this.panel = panel;
    this.store = store;
    this.choice = panel.ofAxes ? 0 : (panel.choice ?? panel.choices?.[0]);
    this.data = [];
    this.shown = 0;
    this.span = [0, 5];
    const made = frame(panel, parent, (choice) => this.#choose(choice));
    this.body = made.body;
    this.legend = made.legend;
    this.note = made.note;
    this.axes = made.axes;
    press(made.buttons[panel.choices?.indexOf(this.choice)], made.buttons);
    this.#build();
    new ResizeObserver(() => this.plot.setSize(options(this.body, 60, null))).observe(this.body);
  }

  // `side`: the one that is shown of a session that has only that one.
  draw(from, to, side) {
    this.span = [from, to];
    const { alone } = this.panel;
    if (alone) for (const [k, { ring }] of this.panel.sources().entries()) this.sources[k].ring = this.store.rings[side === alone ? alone : ring];
    merge(this.sources, from, to, this.data);
    this.plot.setData(this.data);
    this.#say();
  }

  // Offers the axes of an arm to choose from; keeps the choice while they are the same.
  offer(names) {
    const { axes } = this;
    if (!axes || [...axes.options].map(({ text }) => text).join() === names.join()) return;
    axes.replaceChildren(...names.map((name) => new Option(name)));
    this.#choose(0);
  }

  #choose(choice) {
    this.choice = choice;
    this.#build();
    this.draw(...this.span);
  }

  #build() {
    this.plot?.destroy();
    const chosen = this.panel.sources(this.choice, this.store.axes);
    this.sources = chosen.map(({ ring, series }) => ({ ring: this.store.rings[ring], values: series.map((s) => s.of) }));
    this.series = chosen.flatMap(({ series }) => series);
    this.data = Array.from({ length: this.series.length + 1 }, () => []);
    this.plot = new uPlot(this.#options(), this.data, this.body);
    this.legend.replaceChildren(...this.series.filter((s) => s.name).map(entry));
    this.shown = 0;
  }

  #options() {
    const { panel } = this;
    const range = panel.range(this.choice);
    const { x, axis, time, ...common } = options(this.body, 60, () => this.span);
    const grid = { stroke: () => theme.grid, width: 1 };
    const values = (u, splits) => splits.map((v) => (v === null ? "" : panel.axis(+v.toPrecision(6))));
    const side = { ...axis, size: 50, gap: 4, space: 22 };
    /** @type {any[]} */
    const axes = [{ ...time, grid }, { ...side, grid, values, ...(panel.splits ? { splits: () => panel.splits } : {}) }];
    if (panel.right)
      axes.push({ ...side, side: 1, scale: "y", grid: { show: false }, values: (u, splits) => splits.map((v) => panel.right(v, this.store)) });
    return {
      ...common,
      axes,
      padding: [6, panel.right ? 0 : 10, 0, 0],
      pxAlign: 0,
      scales: { x, y: { distr: panel.log ? 3 : 1, range: (u, low, high) => range(low ?? 0, high ?? 0) }, marks: { range: () => [0, 1] } },
      series: [{}, ...this.series.map(line)],
      bands: panel.band ? [{ series: panel.band, fill: () => theme["zone-fill"] }] : [],
      hooks: {
        setCursor: [() => this.plot && this.#say()],
        drawAxes: [(u) => this.#under(u)],
        draw: [(u) => marks(u, this.store.changes)],
      },
    };
  }

  #under(u) {
    const { zone, line: limit } = this.panel;
    const { ctx, bbox } = u;
    const across = (y, colour, dash) => {
      ctx.strokeStyle = colour;
      rule(ctx, [bbox.left, y], [bbox.left + bbox.width, y], dash);
    };
    ctx.save();
    if (zone) {
      const [low, high] = zone.map((v) => u.valToPos(v, "y", true));
      ctx.fillStyle = theme["zone-fill"];
      ctx.fillRect(bbox.left, high, bbox.width, low - high);
      across(high, theme.zone, []);
    }
    if (limit) across(u.valToPos(limit(this.store), "y", true), theme.quiet, [5, 4]);
    ctx.restore();
  }

  // Writes the newest values, or those at the cursor, into the legend.
  #say() {
    const now = performance.now();
    const at = this.plot.cursor.idx;
    clearTimeout(this.later);
    if (now - this.shown < LEGEND_EVERY_MS && at === this.at) {
      this.later = setTimeout(() => this.#say(), LEGEND_EVERY_MS);
      return;
    }
    this.shown = now;
    this.at = at;
    const values = this.series.map((_, k) => latest(this.data[k + 1], at));
    const places = this.legend.querySelectorAll("li");
    for (const [k, series] of this.series.filter((s) => s.name).entries()) {
      const place = places[k].querySelector("b");
      const text = series.unit ? amount(values[this.series.indexOf(series)], series) : "";
      if (place && place.textContent !== text) place.textContent = text;
    }
    const first = values.find((value, k) => !this.series[k].mark && Number.isFinite(value));
    const note = first === undefined ? this.panel.empty : (this.panel.quietNote?.(this.store) ?? "");
    if (this.note.textContent !== note) this.note.textContent = note;
  }
}

function entry({ name, colour, faint, unit }) {
  const item = element("li", { className: `${LEGEND_CLASSES[colour] ?? colour}${faint ? " faint" : ""}` }, `${name} `);
  if (unit) item.append(element("b", {}, "–"));
  return item;
}

// The newest known value at a row or up to 200 rows before; at the last row if none is given.
function latest(values, at) {
  let i = Math.min(at ?? values.length - 1, values.length - 1);
  for (const stop = Math.max(0, i - 200); i >= stop; i -= 1) if (values[i] !== undefined) return values[i] ?? NaN;
  return NaN;
}

function line({ colour, width, alpha = 1, dash, hidden, poles: share, dots }) {
  const stroke = hidden ? "transparent" : () => theme[colour];
  if (share) return { scale: "marks", stroke, width: 1.25, paths: poles(share), points: { show: false } };
  if (dots) return { paths: () => null, points: { show: true, size: dots, width: 0, fill: stroke, stroke } };
  return { stroke, width: hidden ? 0 : width, alpha, dash, points: { show: false }, spanGaps: false };
}

// An upright line wherever there is a value, over a share of the height.
function poles(share) {
  return (u, k, first, last) => {
    const path = new Path2D();
    const { top, height } = u.bbox;
    for (let i = first; i <= last; i += 1) {
      if (u.data[k][i] === null || u.data[k][i] === undefined) continue;
      const x = u.valToPos(u.data[0][i], "x", true);
      path.moveTo(x, top + height);
      path.lineTo(x, top + height * (1 - share));
    }
    return { stroke: path, fill: null, clip: null, band: null, gaps: null, flags: 3 };
  };
}

function rule(ctx, from, to, dash) {
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash(dash);
  ctx.beginPath();
  for (const point of [from, to]) ctx.lineTo(...point);
  ctx.stroke();
}

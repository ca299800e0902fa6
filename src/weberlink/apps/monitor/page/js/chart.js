// The chart of a panel: uPlot with bands, zones and marks. Draws the rows of the store between two times.

import uPlot from "../vendor/uplot.js";
import { entry, frame } from "./frame.js";
import { marks } from "./marks.js";
import { amount } from "./panels.js";
import { merge } from "./ring.js";
import { theme } from "./theme.js";

const SYNC = uPlot.sync("time");
const LEGEND_EVERY_MS = 250;

export class Chart {
  constructor(panel, store, parent) {
    this.panel = panel;
    this.store = store;
    this.choice = panel.ofAxes ? 0 : panel.choice;
    this.data = [];
    this.shown = 0;
    this.span = [0, 5];
    Object.assign(this, frame(panel, parent, (choice) => this.#choose(choice)));
    this.#build();
    new ResizeObserver(() => this.#resize()).observe(this.body);
  }

  draw(from, to) {
    this.span = [from, to];
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

  restyle() {
    this.plot.redraw();
  }

  #choose(choice) {
    this.choice = choice;
    this.#build();
    this.draw(...this.span);
  }

  #build() {
    this.plot?.destroy();
    const { panel, store } = this;
    const chosen = panel.sources(this.choice, store.axes);
    this.sources = chosen.map(({ ring, series }) => ({
      ring: store.rings[ring],
      name: ring,
      values: series.map((s) => s.of),
    }));
    this.series = chosen.flatMap(({ series }) => series);
    this.data = Array.from({ length: this.series.length + 1 }, () => []);
    this.plot = new uPlot(this.#options(), this.data, this.body);
    this.legend.replaceChildren(...this.series.filter((s) => s.name).map(entry));
    this.shown = 0;
  }

  // A panel of one side shows the other side in a session that has only that one.
  prefer(side) {
    const { alone } = this.panel;
    if (!alone) return;
    for (const [k, { ring }] of this.panel.sources().entries())
      this.sources[k].ring = this.store.rings[side === alone ? alone : ring];
  }

  #options() {
    const { panel } = this;
    const range = panel.range(this.choice);
    const grid = { stroke: () => theme.grid, width: 1 };
    const common = { stroke: () => theme.quiet, font: theme.font, ticks: { show: false }, grid };
    const y = {
      ...common,
      size: 50,
      gap: 4,
      space: 22,
      values: (u, splits) => splits.map((v) => (v === null ? "" : panel.axis(+v.toPrecision(6)))),
    };
    if (panel.splits) y.splits = () => panel.splits;
    const axes = [
      { ...common, size: 22, gap: 5, space: 60, values: (u, splits) => splits.map((v) => `${+v.toFixed(2)} s`) },
      y,
    ];
    if (panel.right)
      axes.push({
        ...common,
        side: 1,
        scale: "y",
        size: 50,
        gap: 4,
        space: 22,
        grid: { show: false },
        values: (u, splits) => splits.map((v) => panel.right(v, this.store)),
      });
    return {
      ...this.#size(),
      axes,
      padding: [6, panel.right ? 0 : 10, 0, 0],
      pxAlign: 0,
      legend: { show: false },
      cursor: {
        sync: { key: SYNC.key, scales: ["x", null] },
        y: false,
        drag: { x: false, y: false },
        points: { show: false },
      },
      scales: {
        x: { time: false, range: () => this.span },
        y: { distr: panel.log ? 3 : 1, range: (u, low, high) => range(low ?? 0, high ?? 0) },
        marks: { range: () => [0, 1] },
      },
      series: [{}, ...this.series.map(line)],
      bands: panel.band ? [{ series: [panel.band[0], panel.band[1]], fill: () => theme["zone-fill"] }] : [],
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
    ctx.save();
    if (zone) {
      const [low, high] = zone.map((v) => u.valToPos(v, "y", true));
      ctx.fillStyle = theme["zone-fill"];
      ctx.fillRect(bbox.left, high, bbox.width, low - high);
      rule(ctx, bbox, high, theme.zone, []);
    }
    if (limit) rule(ctx, bbox, u.valToPos(limit(this.store), "y", true), theme.quiet, [5, 4]);
    ctx.restore();
  }

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
    let item = 0;
    let known = false;
    let first = NaN;
    this.series.forEach((series, k) => {
      const value = latest(this.data[k + 1], at);
      if (!series.mark && !known && Number.isFinite(value)) [known, first] = [true, value];
      if (!series.name) return;
      const place = this.legend.children[item++].querySelector("b");
      const text = series.unit ? amount(value, series) : "";
      if (place && place.textContent !== text) place.textContent = text;
    });
    const note = known ? (this.panel.quietNote?.(this.store, first) ?? "") : this.panel.empty;
    if (this.note.textContent !== note) this.note.textContent = note;
  }

  #size() {
    return { width: Math.max(120, this.body.clientWidth), height: Math.max(60, this.body.clientHeight) };
  }
  #resize() {
    const size = this.#size();
    if (size.width !== this.plot.width || size.height !== this.plot.height) this.plot.setSize(size);
  }
}

// The newest known value at a row or up to 50 rows before; at the last row if none is given.
function latest(values, at) {
  let i = Math.min(at ?? values.length - 1, values.length - 1);
  for (const stop = Math.max(0, i - 50); i >= stop; i -= 1) if (values[i] !== undefined) return values[i] ?? NaN;
  return NaN;
}

function line(series) {
  if (series.hidden) return { show: true, stroke: "transparent", width: 0, points: { show: false }, spanGaps: false };
  if (series.poles)
    return {
      scale: "marks",
      stroke: () => theme[series.colour],
      width: 1.25,
      paths: poles(series.poles),
      points: { show: false },
    };
  if (series.dots) {
    const fill = () => theme[series.colour];
    return { paths: () => null, points: { show: true, size: series.dots, width: 0, fill, stroke: fill } };
  }
  return {
    stroke: () => theme[series.colour],
    width: series.width,
    alpha: series.alpha ?? 1,
    dash: series.dash,
    points: { show: false },
    spanGaps: false,
  };
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

function rule(ctx, bbox, y, colour, dash) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash(dash);
  ctx.beginPath();
  ctx.moveTo(bbox.left, y);
  ctx.lineTo(bbox.left + bbox.width, y);
  ctx.stroke();
}

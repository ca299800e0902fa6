// Bands over time: state of each side, predicted model, faults.

import uPlot from "../vendor/uplot.js";
import { frame, marks, options } from "./chart.js";
import { modelName } from "./format.js";
import { theme } from "./theme.js";

const STATE_COLOURS = { 1: "quiet", 2: "warn", 3: "warn", 4: "good", 5: "bad", 6: "quiet" };
const MODEL_COLOURS = { 0: "quiet", 1: "third", 2: "model", 3: "master" };
const state = (side) => ({ label: side, of: "state", rings: () => [side], text: (v, store) => store.stateName(v), colour: (v) => STATE_COLOURS[v] });
const felt = (store) => [store.rings.master.empty ? "slave" : "master"];
const MODEL = { label: "model", of: "model", rings: felt, text: modelName, colour: (v) => MODEL_COLOURS[v] };
const faulty = () => ["master", "slave"];
const FAULTS = { label: "faults", of: "fault", rings: faulty, text: (v, store) => store.faultName(v), colour: (v) => (v ? "bad" : null) };

// The stretches of one value in a column of a ring, between two times, as {value, from, to}.
export function stretches(ring, name, from, to) {
  if (ring.empty || !ring.has(name)) return [];
  const { t, [name]: values } = ring.columns;
  const end = Math.min(ring.end, ring.at(to) + 1);
  const found = [];
  let start = Math.max(ring.begin, ring.at(from) - 1);
  for (let i = start + 1; i <= end; i += 1) {
    if (i < end && values[i] === values[start]) continue;
    found.push({ value: values[start], from: t[start], to: t[Math.min(i, ring.end - 1)] });
    start = i;
  }
  return found;
}

export class Timeline {
  constructor(store, parent) {
    this.store = store;
    this.span = [0, 5];
    const help = "State of each side, the predicted model, and faults, over time.";
    const { body } = frame({ name: "timeline", title: "State", help }, parent);
    this.body = body;
    const { x, axis, time, ...common } = options(body, 40, () => this.span);
    const labels = { ...axis, grid: { show: false }, size: 50, gap: 4 };
    this.plot = new uPlot(
      {
        ...common,
        padding: [2, 10, 0, 0],
        scales: { x, y: { range: () => [0, this.rows.length] } },
        axes: [
          { ...time, grid: { show: false }, size: 20, gap: 3 },
          { ...labels, splits: () => this.rows.map((_, k) => k + 0.5), values: () => this.rows.map(({ label }) => label).reverse() },
        ],
        series: [{}, { paths: () => null, points: { show: false } }],
        hooks: { draw: [(u) => this.#bands(u)] },
      },
      [[], []],
      body,
    );
    new ResizeObserver(() => this.plot.setSize(options(body, 40, null))).observe(body);
  }

  // No predictor of an arm has a model of a surface.
  get rows() {
    return [state("master"), state("slave"), ...(this.store.axes ? [] : [MODEL]), FAULTS];
  }

  draw(from, to) {
    this.span = [from, to];
    this.plot.setData([this.span, [0, 0]]);
  }

  #bands(u) {
    const { ctx, bbox } = u;
    const { store, span } = this;
    const height = bbox.height / this.rows.length;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    for (const [k, { rings, of, text, colour }] of this.rows.entries())
      for (const { value, from, to } of rings(store).flatMap((name) => stretches(store.rings[name], of, ...span)))
        if (colour(value)) piece(u, theme[colour(value)], text(value, store), [from, to], bbox.top + k * height, height);
    ctx.restore();
    marks(u, store.changes);
  }
}

function piece(u, colour, text, span, top, height) {
  const { ctx, bbox } = u;
  const [from, to] = span.map((t) => u.valToPos(t, "x", true));
  const [left, right] = [Math.max(bbox.left, from), Math.min(bbox.left + bbox.width, to)];
  const gap = 2 * devicePixelRatio;
  ctx.fillStyle = colour;
  ctx.globalAlpha = 0.3;
  ctx.fillRect(left, top + gap, Math.max(1, right - left), height - 2 * gap);
  ctx.globalAlpha = 1;
  ctx.fillRect(left, top + gap, devicePixelRatio, height - 2 * gap);
  if (right - left < ctx.measureText(text).width + 10 * devicePixelRatio) return;
  ctx.fillStyle = theme.text;
  ctx.fillText(text, left + 5 * devicePixelRatio, top + height / 2);
}

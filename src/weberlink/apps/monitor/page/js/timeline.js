// Bands over time: state of each side, predicted model, faults.

import uPlot from "../vendor/uplot.js";
import { frame } from "./frame.js";
import { marks } from "./marks.js";
import { modelName } from "./names.js";
import { theme } from "./theme.js";

const HELP = "State of each side, the predicted model, and faults, over time.";
const STATE_COLOURS = { 1: "quiet", 2: "warn", 3: "warn", 4: "good", 5: "bad", 6: "quiet" };
const MODEL_COLOURS = { 0: "quiet", 1: "third", 2: "model", 3: "master" };
const ROWS = [
  ...["master", "slave"].map((side) => ({
    label: side,
    ring: side,
    of: "state",
    text: (v, store) => store.stateName(v),
    colour: (v) => STATE_COLOURS[v],
  })),
  {
    label: "model",
    ring: "master",
    other: "slave",
    of: "model",
    text: modelName,
    colour: (v) => MODEL_COLOURS[v],
  },
  {
    label: "faults",
    ring: "master",
    also: "slave",
    of: "fault",
    text: (v, store) => store.faultName(v),
    colour: (v) => (v ? "bad" : null),
  },
];

const ROWS_OF_ARM = ROWS.filter(({ of }) => of !== "model"); // no predictor of an arm has a model of a surface

export class Timeline {
  get rows() {
    return this.store.axes ? ROWS_OF_ARM : ROWS;
  }

  constructor(store, parent) {
    this.store = store;
    this.span = [0, 5];
    const { body, note } = frame({ name: "timeline", title: "State", help: HELP }, parent);
    Object.assign(this, { body, note });
    const axis = { stroke: () => theme.quiet, font: theme.font, ticks: { show: false }, grid: { show: false } };
    this.plot = new uPlot(
      {
        ...this.#size(),
        padding: [2, 10, 0, 0],
        legend: { show: false },
        cursor: {
          sync: { key: "time", scales: ["x", null] },
          y: false,
          drag: { x: false, y: false },
          points: { show: false },
        },
        scales: { x: { time: false, range: () => this.span }, y: { range: () => [0, this.rows.length] } },
        axes: [
          { ...axis, size: 20, gap: 3, space: 60, values: (u, splits) => splits.map((v) => `${+v.toFixed(2)} s`) },
          {
            ...axis,
            size: 50,
            gap: 4,
            splits: () => this.rows.map((_, k) => k + 0.5),
            values: () => this.rows.map((row) => row.label).reverse(),
          },
        ],
        series: [{}, { paths: () => null, points: { show: false } }],
        hooks: { draw: [(u) => this.#bands(u)] },
      },
      [[], []],
      body,
    );
    new ResizeObserver(() => this.plot.setSize(this.#size())).observe(body);
  }

  draw(from, to) {
    this.span = [from, to];
    this.plot.setData([
      [from, to],
      [0, 0],
    ]);
  }

  restyle() {
    this.plot.redraw();
  }

  #bands(u) {
    const { ctx, bbox } = u;
    const height = bbox.height / this.rows.length;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    this.rows.forEach((row, k) => {
      const top = bbox.top + k * height + 2 * devicePixelRatio;
      const rings = this.store.rings;
      const first = row.other && rings[row.ring].empty ? row.other : row.ring;
      for (const ring of [first, row.also])
        if (ring) this.#band(u, row, rings[ring], top, height - 4 * devicePixelRatio);
    });
    ctx.restore();
    marks(u, this.store.changes);
  }

  #band(u, row, ring, top, height) {
    if (ring.empty || !ring.has(row.of)) return;
    const [from, to] = this.span;
    const values = ring.columns[row.of];
    const { t } = ring.columns;
    const end = Math.min(ring.end, ring.at(to) + 1);
    let start = Math.max(ring.begin, ring.at(from) - 1);
    for (let i = start + 1; i <= end; i += 1) {
      if (i < end && values[i] === values[start]) continue;
      const colour = row.colour(values[start]);
      if (colour) {
        const text = row.text(values[start], this.store);
        piece(u, theme[colour], text, t[start], t[Math.min(i, ring.end - 1)], top, height);
      }
      start = i;
    }
  }

  #size() {
    return { width: Math.max(120, this.body.clientWidth), height: Math.max(40, this.body.clientHeight) };
  }
}

function piece(u, colour, text, from, to, top, height) {
  const { ctx, bbox } = u;
  const left = Math.max(bbox.left, u.valToPos(from, "x", true));
  const right = Math.min(bbox.left + bbox.width, u.valToPos(to, "x", true));
  ctx.fillStyle = colour;
  ctx.globalAlpha = 0.3;
  ctx.fillRect(left, top, Math.max(1, right - left), height);
  ctx.globalAlpha = 1;
  ctx.fillRect(left, top, devicePixelRatio, height);
  if (right - left < ctx.measureText(text).width + 10 * devicePixelRatio) return;
  ctx.fillStyle = theme.text;
  ctx.fillText(text, left + 5 * devicePixelRatio, top + height / 2);
}

// Marks of live changes in the charts.

import { theme } from "./theme.js";

// Draws a vertical line with the new setting for each live change.
export function marks(u, changes) {
  const { ctx, bbox } = u;
  for (const { t, label } of changes) {
    if (t < u.scales.x.min || t > u.scales.x.max) continue;
    const x = Math.round(u.valToPos(t, "x", true));
    ctx.save();
    ctx.strokeStyle = theme.text;
    ctx.fillStyle = theme.text;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
    const left = x + ctx.measureText(label).width + 8 * devicePixelRatio > bbox.left + bbox.width;
    ctx.textAlign = left ? "right" : "left";
    ctx.textBaseline = "top";
    ctx.fillText(label, x + (left ? -4 : 4) * devicePixelRatio, bbox.top + 2 * devicePixelRatio);
    ctx.restore();
  }
}

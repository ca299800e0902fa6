// The paths of the link: a line for each in the panel, and how they go in the tile of the round trip.

import { show } from "./format.js";

const by = (id) => document.getElementById(id);

export class Paths {
  // The paths of a message of figures: [{side, place, route, words, remote, changes, class}].
  show(paths = []) {
    const list = by("paths");
    const wanted = JSON.stringify(paths);
    if (list.dataset.value !== wanted) {
      list.dataset.value = wanted;
      list.replaceChildren(...paths.map(item));
    }
    const routes = [...new Set(paths.map(({ route }) => route).filter(Boolean))];
    show(by("route"), routes.length > 1 ? "mixed" : (routes[0] ?? ""), routes.sort().join(" "));
  }
}

function item({ side, place, words, remote, changes, class: service }) {
  const made = document.createElement("li");
  const name = document.createElement("i");
  name.className = side;
  name.textContent = place ? `${side}, path ${place + 1}` : side;
  const more = [remote && `to ${remote}`, changes && `${changes} change${changes === 1 ? "" : "s"}`, service];
  made.append(name, ` ${[words, ...more].filter(Boolean).join(", ")}`);
  return made;
}

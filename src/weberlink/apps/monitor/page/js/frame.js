// The panel around a chart: title with unit, choices, legend, help.

function element(tag, properties, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

export function entry(series) {
  const kind = { quiet: "all", bad: "missed" }[series.colour] ?? series.colour;
  const item = element("li", { className: `${kind}${series.faint ? " faint" : ""}` }, `${series.name} `);
  if (series.unit) item.append(element("b", {}, "–"));
  return item;
}

export function frame({ name, title, unit, help, choices, choice, ofAxes }, parent, choose) {
  const heading = element(
    "h2",
    { id: `title-${name}` },
    title,
    " ",
    element("span", { className: "unit" }, unit ?? ""),
  );
  const legend = element("ul", { className: "legend" });
  const button = element("button", { type: "button", className: "help" }, "?");
  button.setAttribute("aria-describedby", `help-${name}`);
  button.setAttribute("aria-label", `About ${title}`);
  const tip = element("p", { className: "tip", id: `help-${name}` }, help);
  tip.setAttribute("role", "tooltip");
  const head = element("header", {}, heading);
  if (choices) head.append(picker(choices, choice, title, choose));
  const axes = ofAxes ? element("select", { className: "axes" }) : null;
  if (axes) {
    axes.setAttribute("aria-label", `${title}: axis`);
    axes.addEventListener("change", () => choose(axes.selectedIndex));
    head.append(axes);
  }
  head.append(legend, button, tip);
  const note = element("p", { className: "empty" });
  const body = element("div", { className: "chart", id: `chart-${name}` }, note);
  const panel = element("section", { className: "panel", id: `panel-${name}` }, head, body);
  panel.setAttribute("aria-labelledby", heading.id);
  parent.append(panel);
  return { body, legend, note, axes };
}

function picker(choices, chosen, title, choose) {
  const group = element("span", { className: "choice" });
  group.setAttribute("role", "group");
  group.setAttribute("aria-label", `${title}: component`);
  for (const choice of choices) {
    const button = element("button", { type: "button" }, choice);
    button.setAttribute("aria-pressed", String(choice === chosen));
    button.addEventListener("click", () => {
      for (const other of group.children) other.setAttribute("aria-pressed", String(other === button));
      choose(choice);
    });
    group.append(button);
  }
  return group;
}

// The document: elements by name, text with its exact value, and what the page says of the person's requests.

/** @param {string} id @returns {any} */
export const by = (id) => document.getElementById(id);

/** @param {string} selector @returns {any[]} */
export const all = (selector) => [...document.querySelectorAll(selector)];

// An element; properties that are no properties of it are attributes.
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) name in made ? (made[name] = value) : made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// Text and exact value of an element; writes to the document only what has changed.
export function show(place, text, value) {
  if (place.textContent !== text) place.textContent = text;
  const exact = value === null || value === undefined || value !== value ? "" : String(value);
  if (place.dataset.value !== exact) place.dataset.value = exact;
}

// Options of a select, as [value, text]; left as they are if they are the same.
export function fill(select, items) {
  const wanted = items.map((item) => item.join("\t")).join("\n");
  if (select.dataset.names === wanted) return;
  const { value } = select;
  select.replaceChildren(...items.map(([name, text]) => new Option(text, name)));
  select.dataset.names = wanted;
  if (items.some(([name]) => name === value)) select.value = value;
}

// One line for the person; `kind` is "", "good", "warn" or "bad".
export function notice(text, kind = "") {
  show(by("notice"), text, kind);
  by("notice").title = text;
}

// Spoken at once by a screen reader, not drawn.
export const announce = (text) => (by("alert").textContent = text);

// Presses one button of a group, and lets the others go.
export function press(chosen, buttons) {
  for (const button of buttons) button.setAttribute("aria-pressed", String(button === chosen));
}

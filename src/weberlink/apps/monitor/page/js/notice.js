// What the page says of the person's requests: one line, and the words that a screen reader speaks at once.

const by = (id) => document.getElementById(id);

// `kind` is "", "good", "warn" or "bad".
export function notice(text, kind = "") {
  const place = by("notice");
  place.textContent = text;
  place.title = text;
  place.dataset.value = kind;
}

// Spoken at once, not drawn.
export function announce(text) {
  by("alert").textContent = text;
}

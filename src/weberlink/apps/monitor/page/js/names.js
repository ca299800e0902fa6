// What the numbers of a record mean, in the words of the page.

export const STATES = { 1: "idle", 2: "connecting", 3: "listening", 4: "engaged", 5: "silent", 6: "closed" };
export const ENGAGED = 4;
export const FAULTS = {
  1: "silence",
  2: "device",
  3: "refused",
  4: "update",
  5: "unheard",
  6: "stalled",
  7: "taken over",
  8: "tripped",
};
export const RELEASED = 2; // of `ramping`: the operator does not hold the button that lets the robot follow
export const MODELS = { 0: "hold", 1: "line", 2: "plane", 3: "sphere" };

export const word = (table, number) => table[number] ?? "unknown";

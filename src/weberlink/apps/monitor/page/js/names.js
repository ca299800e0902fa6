// Numbers in a record that the greeting does not name.

export const ENGAGED = 4; // of `state`
export const RELEASED = 2; // of `ramping`: the operator does not hold the button that lets the robot follow
export const modelName = (number) => ["hold", "line", "plane", "sphere"][number] ?? "unknown";

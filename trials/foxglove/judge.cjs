// A client of the Foxglove WebSocket protocol out of packages by Foxglove: it reads every topic, checks each message
// against the schema of its channel, and sets parameters. Run by trial.py; see package.json for the packages.
//
// Usage: node judge.cjs URL [parameters]; the second reads no topics. Each line of standard input is a command: {"set": {NAME: VALUE}}, {"get": []},
// {"watch": [NAME]}, {"settle": true} or {"report": true}. Each line of standard output is an event.

const { parse: parseRos } = require("@foxglove/rosmsg");
const { MessageReader, MessageWriter } = require("@foxglove/rosmsg2-serialization");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const Ajv = require("ajv");
const { createInterface } = require("readline");
const { WebSocket } = require("ws");

const ajv = new Ajv({ allErrors: true, strict: false });
const say = (event, facts) => console.log(JSON.stringify({ event, ...facts }));
const now = () => performance.timeOrigin + performance.now(); // [ms since 1970]

function jsonReader(channel) {
  const isRight = ajv.compile(JSON.parse(channel.schema));
  return (data) => {
    const message = JSON.parse(new TextDecoder().decode(data));
    return [message, isRight(message) ? null : ajv.errorsText(isRight.errors)];
  };
}

// A message is right if Foxglove's writer makes the same bytes of what its reader has read.
function rosReader(channel) {
  const definitions = parseRos(channel.schema, { ros2: true });
  const reader = new MessageReader(definitions);
  const writer = new MessageWriter(definitions);
  return (data) => {
    const message = reader.readMessage(data);
    return [message, Buffer.compare(writer.writeMessage(message), data) ? "it is written in other bytes" : null];
  };
}

const READERS = { json: jsonReader, cdr: rosReader };

class Topic {
  constructor(channel) {
    this.read = READERS[channel.encoding](channel);
    Object.assign(this, { checked: 0, wrong: 0, why: null });
    this.settle();
  }

  // Counts from now on: what came in the beginning waited until the schemas were compiled.
  settle() {
    Object.assign(this, { count: 0, late: [], skipped: 0, bytes: 0, first: this.last });
  }

  take({ data, timestamp }) {
    const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
    const [message, why] = this.read(bytes);
    this.late.push(now() - Number(timestamp) / 1e6);
    this.checked += 1;
    this.count += 1;
    this.bytes += bytes.length;
    if (why) [this.wrong, this.why] = [this.wrong + 1, why];
    if (this.last?.tick !== undefined) this.skipped += Number(message.tick - this.last.tick) - 1;
    this.first ??= message;
    this.last = message;
  }

  get report() {
    const { count, checked, wrong, why, skipped, bytes, first, last } = this;
    const late = [...this.late].sort((a, b) => a - b);
    const share = (p) => late[Math.min(late.length - 1, Math.floor(p * late.length))];
    return { count, checked, wrong, why, skipped, bytes, first, last, late_ms: { p50: share(0.5), p99: share(0.99) } };
  }
}

BigInt.prototype.toJSON = function () {
  return Number(this);
};

const client = new FoxgloveClient({ ws: new WebSocket(process.argv[2], ["foxglove.sdk.v1"]) });
const topics = new Map();
const subscribed = new Map();
client.on("error", (error) => say("error", { text: String(error) }));
client.on("close", () => process.exit(0));
client.on("serverInfo", ({ name, capabilities }) => say("server", { name, capabilities }));
client.on("status", ({ level, message }) => say("status", { level, text: message }));
client.on("parameterValues", ({ parameters, id }) =>
  say("parameters", { id, values: Object.fromEntries(parameters.map(({ name, value }) => [name, value])) }),
);
client.on("advertise", (channels) => {
  if (process.argv[3] === "parameters") return;
  for (const channel of channels) {
    topics.set(channel.topic, new Topic(channel));
    subscribed.set(client.subscribe(channel.id), topics.get(channel.topic));
  }
  say("topics", { types: Object.fromEntries(channels.map(({ topic, schemaName }) => [topic, schemaName])) });
});
client.on("message", (event) => {
  try {
    subscribed.get(event.subscriptionId)?.take(event);
  } catch (error) {
    say("error", { text: String(error) });
  }
});
createInterface({ input: process.stdin }).on("line", (line) => {
  const { set, get, watch, settle, report } = JSON.parse(line);
  if (set) {
    const parameters = Object.entries(set).map(([name, value]) => ({ name, value }));
    client.setParameters(parameters, "set");
  }
  if (get) client.getParameters(get, "get");
  if (watch) client.subscribeParameterUpdates(watch);
  if (settle) for (const topic of topics.values()) topic.settle();
  if (report) say("report", { topics: Object.fromEntries([...topics].map(([name, of]) => [name, of.report])) });
});
